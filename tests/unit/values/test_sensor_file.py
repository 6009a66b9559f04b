"""The sensor file: what is read is what was written, and every mistake is named."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.errors import OutputError, SensorError
from manytouch.geometry.camera import project
from manytouch.geometry.refraction import rest_px
from manytouch.limits import MAX_MARKERS
from manytouch.values import Sensor
from manytouch.values.sensor_file.read import known_sensors, load_sensor
from manytouch.values.sensor_file.schema import MarkersSection
from manytouch.values.sensor_file.write import save_sensor

TEXT = """
schema = 1
name = "demo sheet"
[camera]
model = "pinhole"
width_px = 2560
height_px = 1440
fx_px = 2061.0
fy_px = 2050.0
cx_px = 1279.5
cy_px = 719.5
distortion = [-0.1, 0.0, 0.0, 0.0, 0.0]
[camera.pose]
rotation_vector = [0.0, 0.0, 0.01]
translation_mm = [0.0, 1.0, 116.3]
[sheet]
size_mm = [120.0, 80.0]
thickness_mm = 3.0
[markers]
rows = 20
columns = 30
pitch_mm = [4.0, 3.0]
offset_mm = [1.0, 0.0]
radius_mm = 1.0
polarity = "light"
missing = [[3, 29]]
[noise]
centre_px = 0.03
[provenance]
made_by = "hand"
"""


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / "sensor.toml"
    path.write_text(TEXT)
    return path


def test_rest_positions_follow_from_rows_columns_pitch_and_offset(written: Path) -> None:
    layout = load_sensor(written).layout
    assert layout is not None
    assert layout.shape == (20, 30)
    marker = 3 * 30 + 29
    np.testing.assert_array_equal(layout.row_column[marker], [3, 29])
    np.testing.assert_allclose(layout.rest_mm[marker], [(29 - 14.5) * 4 + 1, (3 - 9.5) * 3, 0])
    assert layout.is_missing.sum() == 1
    assert layout.is_missing[marker]


def test_absent_keys_are_unknown(written: Path) -> None:
    sheet = load_sensor(written).sheet
    assert sheet is not None
    assert sheet.young_MPa is None
    assert sheet.pretension_N_per_mm is None


def test_saved_sensor_reads_back_the_same(written: Path, tmp_path: Path) -> None:
    sensor = load_sensor(written)
    again_path = tmp_path / "again.toml"
    save_sensor(sensor, again_path)
    again = load_sensor(again_path)
    assert again.name == sensor.name
    assert again.provenance == sensor.provenance
    assert again.centre_noise_px == sensor.centre_noise_px
    np.testing.assert_array_equal(again.layout.rest_mm, sensor.layout.rest_mm)
    np.testing.assert_array_equal(again.layout.is_missing, sensor.layout.is_missing)
    np.testing.assert_array_equal(again.camera.distortion, sensor.camera.distortion)
    np.testing.assert_array_equal(again.camera.translation_mm, sensor.camera.translation_mm)
    assert again.sheet.young_MPa is None
    assert list(tmp_path.glob(".*")) == []


DEVIATIONS = """
outline_std_mm = 0.2
thickness_std_mm = 0.1
poisson = 0.45
poisson_std = 0.01
pretension_N_per_mm = 0.3
pretension_std_N_per_mm = 0.05
bending_factor = 1.1
bending_factor_std = 0.04
density_kg_m3 = 960.0
density_std_kg_m3 = 20.0
"""
PAD = """
boundary = "bonded"
marker_depth_mm = 2.5
marker_depth_std_mm = 0.05
window_mm = 4.0
window_std_mm = 0.1
window_index = 1.49
window_index_std = 0.005
pad_index = 1.41
pad_index_std = 0.02
"""


def loaded_again(sensor: Sensor, folder: Path) -> Sensor:
    save_sensor(sensor, folder / "again.toml")
    return load_sensor(folder / "again.toml")


@pytest.mark.parametrize("keys", [DEVIATIONS, PAD])
def test_keys_of_the_sheet_round_trip(written: Path, tmp_path: Path, keys: str) -> None:
    written.write_text(TEXT.replace("thickness_mm = 3.0", f"thickness_mm = 3.0{keys}"))
    sheet = load_sensor(written).sheet
    again = loaded_again(load_sensor(written), tmp_path).sheet
    for name, value in tomllib.loads(keys).items():
        assert getattr(again, name) == getattr(sheet, name) == value


def test_deviations_of_the_camera_round_trip(written: Path, tmp_path: Path) -> None:
    numbers = "fx_std_px = 3.0\nfy_std_px = 4.0\ncx_std_px = 5.0\ncy_std_px = 6.0\n"
    numbers += "distortion_std = [0.1, 0.2, 0.3, 0.4, 0.5]\n"
    text = TEXT.replace("[camera.pose]", f"{numbers}[camera.pose]")
    pose = "rotation_vector_std = [0.001, 0.002, 0.003]\ntranslation_std_mm = [0.1, 0.2, 0.3]\n"
    written.write_text(text.replace("[sheet]", f"{pose}[sheet]"))
    camera = loaded_again(load_sensor(written), tmp_path).camera
    assert (camera.fx_std_px, camera.fy_std_px, camera.cx_std_px, camera.cy_std_px) == (3.0, 4.0, 5.0, 6.0)
    np.testing.assert_array_equal(camera.distortion_std, [0.1, 0.2, 0.3, 0.4, 0.5])
    np.testing.assert_array_equal(camera.rotation_vector_std, [0.001, 0.002, 0.003])
    np.testing.assert_array_equal(camera.translation_std_mm, [0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            "pretension_std_N_per_mm = 0.1",
            "pretension_std_N_per_mm is the standard deviation of",
        ),
        ("thickness_std_mm = -0.1", "sheet.thickness_std_mm = -0.1"),
        ("thickness_std_px = 0.1", "unknown key sheet.thickness_std_px"),
        ("marker_depth_mm = 1.0", 'marker_depth_mm belong to boundary = "bonded", but boundary = "clamped"'),
        ('boundary = "bonded"', "needs marker_depth_mm"),
        ('boundary = "glued"', "sheet.boundary = 'glued'"),
        (PAD + "pretension_N_per_mm = 0.1", 'pretension_N_per_mm belong to boundary = "clamped"'),
        (PAD.replace("= 2.5", "= 3.5"), "marker_depth_mm = 3.5 is larger than thickness_mm = 3"),
        (PAD.replace("= 1.49", "= 0.9"), "sheet.window_index = 0.9"),
        ('boundary = "bonded"\nmarker_depth_mm = 1.0\nwindow_index = 1.5', "specify window_mm"),
    ],
)
def test_mistakes_in_deviations_and_pads_are_named(written: Path, keys: str, message: str) -> None:
    written.write_text(TEXT.replace("thickness_mm = 3.0", f"thickness_mm = 3.0\n{keys}"))
    with pytest.raises(SensorError) as refusal:
        load_sensor(written)
    assert message in str(refusal.value)


def test_the_markers_of_a_pad_have_no_height(written: Path) -> None:
    text = TEXT.replace("thickness_mm = 3.0", f"thickness_mm = 3.0{PAD}")
    written.write_text(text.replace("radius_mm = 1.0", "radius_mm = 1.0\nheight_mm = 0.5"))
    with pytest.raises(SensorError, match=r"markers.height_mm = 0.5 is for a clamped sheet"):
        load_sensor(written)


def test_the_deviation_of_stiffness_needs_a_stiffness(written: Path, tmp_path: Path) -> None:
    both = TEXT.replace("thickness_mm = 3.0", "thickness_mm = 3.0\nyoung_MPa = 2.5\nyoung_std_MPa = 0.1")
    written.write_text(both)
    sensor = load_sensor(written)
    save_sensor(sensor, tmp_path / "again.toml")
    assert load_sensor(tmp_path / "again.toml").sheet.young_std_MPa == sensor.sheet.young_std_MPa == 0.1
    written.write_text(both.replace("young_MPa = 2.5\n", ""))
    with pytest.raises(SensorError, match="young_std_MPa is the standard deviation of young_MPa"):
        load_sensor(written)


def several_views(text: str) -> str:
    """The sensor file with a second camera 20 mm to the right of the first."""
    begin, rest = text.split("[camera]\n")
    camera, rest = rest.split("[sheet]\n")
    camera = camera.replace("[camera.pose]", "[views.pose]")
    right = camera.replace("translation_mm = [0.0", "translation_mm = [-20.0")
    views = f'[[views]]\nname = "left"\n{camera}[[views]]\nname = "right"\n{right}'
    return f"{begin}{views}[sheet]\n{rest}"


def test_several_views_round_trip(tmp_path: Path) -> None:
    (tmp_path / "views.toml").write_text(several_views(TEXT))
    read = load_sensor(tmp_path / "views.toml")
    save_sensor(read, tmp_path / "again.toml")
    again = load_sensor(tmp_path / "again.toml")
    assert (read.camera.width_px, read.camera.height_px) == (2 * 2560, 1440)
    assert [view.name for view in again.camera.views] == ["left", "right"]
    assert [view.left_px for view in again.camera.views] == [0, 2560]
    point_mm = np.array([[3.0, 2.0, -1.0], [40.0, -7.0, 0.0]])
    for before, after in zip(read.camera.views, again.camera.views, strict=True):
        assert np.array_equal(project(before.camera, point_mm), project(after.camera, point_mm))
    left, right = (view.camera for view in again.camera.views)
    assert right.translation_mm[0] - left.translation_mm[0] == -20.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "right"', 'name = "left"', "views need different names"),
        ('name = "right"', 'name = "right/a"', "views.1.name"),
        (
            '[[views]]\nname = "left"',
            '[camera]\nwidth_px = 3\n[[views]]\nname = "left"',
            "camera.height_px is missing",
        ),
        ("[views.pose]", "[views.place]", "unknown key views.0.place"),
        ("[sheet]", '[sheet]\nboundary = "bonded"\nmarker_depth_mm = 1.0', 'boundary = "clamped"'),
    ],
)
def test_mistakes_in_views_are_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "views.toml"
    path.write_text(several_views(TEXT).replace(old, new, 1))
    with pytest.raises(SensorError, match=re.escape(message)):
        load_sensor(path)


def test_a_layout_that_is_no_rectangle_is_a_table(written: Path, tmp_path: Path) -> None:
    text = TEXT.replace("rows = 20\ncolumns = 30\npitch_mm = [4.0, 3.0]\noffset_mm = [1.0, 0.0]\n", "")
    text = text.replace("missing = [[3, 29]]", "rest_mm = [[0, 0], [5, 0], [0, 5.5], [7, 7], [20.0, 1]]")
    written.write_text(text)
    sensor = load_sensor(written)
    assert sensor.layout.row_column is None
    np.testing.assert_allclose(sensor.layout.rest_mm[3], [7, 7, 0])
    save_sensor(sensor, tmp_path / "again.toml")
    np.testing.assert_array_equal(load_sensor(tmp_path / "again.toml").layout.rest_mm, sensor.layout.rest_mm)


def test_measured_positions_keep_rows_and_columns(written: Path, tmp_path: Path) -> None:
    text = TEXT.replace("rows = 20\ncolumns = 30", "rows = 2\ncolumns = 3").replace("[[3, 29]]", "[]")
    text = text.replace(
        "radius_mm", "rest_mm = [[-4, -2], [0, -2], [4, -2], [-4, 1], [0.1, 1], [4, 1]]\nradius_mm"
    )
    written.write_text(text)
    sensor = load_sensor(written)
    save_sensor(sensor, tmp_path / "again.toml")
    again = load_sensor(tmp_path / "again.toml")
    assert again.layout.shape == (2, 3)
    np.testing.assert_array_equal(again.layout.rest_mm[4], [0.1, 1, 0])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("columns = 30", "colums = 30", "unknown key markers.colums"),
        ("fx_px = 2061.0", 'fx_px = "a"', "camera.fx_px = 'a'"),
        ("thickness_mm = 3.0", "thickness_mm = -3.0", "sheet.thickness_mm = -3.0"),
        ("width_px = 2560\n", "", "camera.width_px is missing"),
        ("[[3, 29]]", "[[3, 30]]", "missing [3, 30] is outside 20 x 30"),
        ("schema = 1", "schema = 2", "schema = 2: 1 is expected"),
        ("schema = 1", "schema = true", "schema = True"),
        ("schema = 1\n", "", "schema is missing: give 1"),
        ("[0.0, 1.0, 116.3]", "[116.3]", "translation_mm = [116.3]: a list of 3 numbers is expected"),
        ("distortion = [-0.1, 0.0, 0.0, 0.0, 0.0]", "distortion = [0.1]", "has 5 numbers, found 1"),
        ('polarity = "light"', 'polarity = "grey"', "markers.polarity = 'grey'"),
        ("rows = 20\n", "", "rows and columns belong together"),
        ("[camera.pose]\nrotation_vector = [0.0, 0.0, 0.01]\ntranslation_mm = [0.0, 1.0, 116.3]", "", "pose"),
        ("schema = 1", "schema = ", "not valid TOML"),
        (
            "radius_mm = 1.0",
            "radius_mm = 2.5",
            "radius_mm = 2.5 overlap: the smallest distance between two is 3 mm",
        ),
        ("radius_mm = 1.0", "radius_mm = -1.0", "wrong: markers.radius_mm = -1.0: input should be greater"),
        ("pitch_mm = [4.0, 3.0]", "pitch_mm = [4.0]", "wrong: markers.pitch_mm = [4.0]: list should have at"),
        ("pitch_mm = [4.0, 3.0]", "pitch_mm = 9.0", "markers are outside the clamped outline"),
        ("size_mm = [120.0, 80.0]", "size_mm = [1e9, 80.0]", "longer side has at most 10000 thicknesses"),
        ("thickness_mm = 3.0", "thickness_mm = 1e-9", "sheet: a sheet of 120 x 80 mm that is 1e-09 mm thick"),
        ("thickness_mm = 3.0", "thickness_mm = 1e9", "at most 10 times its shorter side"),
    ],
)
def test_a_mistake_is_named(written: Path, old: str, new: str, message: str) -> None:
    assert old in TEXT
    written.write_text(TEXT.replace(old, new))
    with pytest.raises(SensorError) as refusal:
        load_sensor(written)
    assert message in str(refusal.value)
    assert written.name in str(refusal.value)
    assert "\n" not in str(refusal.value)


IN_A_ROW = [[4.0 * number, 2.0] for number in range(-14, 15)]


@pytest.mark.parametrize(
    ("new", "found"),
    [
        ("rows = 1\ncolumns = 30\npitch_mm = 4.0", "rows = 1, columns = 30, 30 markers"),
        ("rows = 20\ncolumns = 1\npitch_mm = 4.0", "rows = 20, columns = 1, 20 markers"),
        (f"rest_mm = {IN_A_ROW}", "markers: 29 markers"),
        (f"rest_mm = {[[x * 0.6, x * 0.2 + 0.01 * y] for x, y in IN_A_ROW]}", "markers: 29 markers"),
    ],
)
def test_markers_on_one_line_are_refused(written: Path, new: str, found: str) -> None:
    written.write_text(of_markers(new))
    with pytest.raises(SensorError, match=f"{found} on one line determine no pose of the camera: at least 2"):
        load_sensor(written)


@pytest.mark.parametrize(
    "new",
    [
        "rows = 2\ncolumns = 30\npitch_mm = 4.0",
        "rows = 2\ncolumns = 2\npitch_mm = 4.0\nmissing = [[0, 0], [0, 1]]",
        f"rest_mm = {[*IN_A_ROW, [0.0, 6.0]]}",
    ],
)
def test_markers_to_both_sides_of_any_line_are_read(written: Path, new: str) -> None:
    written.write_text(of_markers(new))
    assert load_sensor(written).layout is not None


def of_markers(new: str) -> str:
    """The file with other rows, columns, pitch and missing markers."""
    before, after = TEXT.split("rows = 20")
    return f"{before}{new}\n{after[after.index('radius_mm') :].replace('missing = [[3, 29]]', '')}"


def test_all_mistakes_are_named_at_once(written: Path) -> None:
    written.write_text(
        TEXT.replace("columns", "colums").replace("[noise]", "[nois]").replace("3.0]", "-3.0]")
    )
    with pytest.raises(SensorError, match=r"(?=.*colums)(?=.*nois)(?=.*pitch_mm)"):
        load_sensor(written)


def message_of(path: Path, *changes: tuple[str, str]) -> str:
    """What is reported about the sensor file with some changes."""
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    with pytest.raises(SensorError) as refusal:
        load_sensor(path)
    return str(refusal.value)


def test_all_contradictions_are_named_at_once(written: Path) -> None:
    message = message_of(
        written,
        ("size_mm = [120.0, 80.0]", "size_mm = [60.0, 40.0]\nyoung_std_MPa = 0.1\nwindow_mm = 2.0"),
        ("radius_mm = 1.0", "radius_mm = 5.0"),
        ("[[3, 29]]", "[[3, 29], [3, 30], [20, 0]]"),
        ("distortion = [-0.1, 0.0, 0.0, 0.0, 0.0]", "distortion = [0.1]"),
    )
    for words in (
        "camera: distortion of a pinhole camera has 5 numbers, found 1; ",
        "sheet: young_std_MPa is the standard deviation of young_MPa",
        'sheet: window_mm belong to boundary = "bonded"',
        "markers: missing [3, 30], and 1 more are outside 20 x 30 markers; ",
        "markers: markers of radius_mm = 5 overlap",
        "of 600 markers are outside the clamped outline",
    ):
        assert message.count(words) == 1, message


def test_contradictions_are_named_beside_wrong_keys_and_types(written: Path) -> None:
    outline = ("size_mm = [120.0, 80.0]", "size_mm = [60.0, 40.0]")
    message = message_of(
        written, outline, ("[noise]\n", "[noise]\nnois = 1.0\n"), ("fx_px = 2061.0", 'fx_px = "a"')
    )
    for words in ("unknown key noise.nois", "camera.fx_px = 'a'", "markers are outside the clamped outline"):
        assert message.count(words) == 1, message
    assert "either one [camera]" not in message


def test_contradictions_of_a_section_are_named_beside_its_wrong_values(written: Path) -> None:
    message = message_of(
        written,
        ("width_px = 2560", 'width_px = "a"'),
        ("cx_px = 1279.5", "cx_px = 1e6"),
        ("cy_px = 719.5", "cy_px = 1e6\ndistortion_std = [0.1]"),
        ("rotation_vector = [0.0, 0.0, 0.01]", "rotation_vector = [0.0, 0.0]"),
        ("thickness_mm = 3.0", "thickness_mm = -3.0\nmarker_depth_mm = 2.0\nthickness_std_mm = 0.1"),
        (
            "size_mm = [120.0, 80.0]",
            "size_mm = [120.0, 80.0]\npoisson = 0.7\npoisson_std = 0.1\nyoung_std_MPa = 0.1",
        ),
        ("radius_mm = 1.0", "radius_mm = 5.0"),
        ("[[3, 29]]", "[[3, 29], [3, 30]]"),
        ('polarity = "light"', 'polarity = "grey"'),
    )
    for words in (
        "camera.width_px = 'a'",
        "cy_px = 1e+06 is not within",
        "distortion_std has 1 numbers, but distortion has 5",
        "camera.pose.rotation_vector = [0.0, 0.0]: a list of 3 numbers is expected",
        "sheet.thickness_mm = -3.0",
        "sheet: young_std_MPa is the standard deviation of young_MPa",
        'sheet: marker_depth_mm belong to boundary = "bonded"',
        "sheet.poisson = 0.7",
        "markers.polarity = 'grey'",
        "markers: missing [3, 30] is outside 20 x 30 markers",
        "markers: markers of radius_mm = 5 overlap",
    ):
        assert message.count(words) == 1, message
    for words in (
        "cx_px = 1e+06",
        "thickness_std_mm is",
        "poisson_std is",
        "needs [camera.pose]",
        "larger than",
    ):
        assert words not in message


@pytest.mark.parametrize(
    ("keys", "absent"),
    [
        (("boundary", "1"), "belong to boundary"),
        (("marker_depth_mm", "-1"), "needs marker_depth_mm"),
        (("rows", "0"), "belong together"),
        (("pitch_mm", "-4"), "specify rows"),
        (("size_mm", "[1]"), "outline"),
    ],
)
def test_what_a_wrong_value_leaves_open_is_not_named(written: Path, keys, absent: str) -> None:
    key, value = keys
    text = TEXT.replace("[sheet]\n", '[sheet]\nboundary = "bonded"\nmarker_depth_mm = 1.0\n')
    lines = [f"{key} = {value}" if line.startswith(f"{key} =") else line for line in text.splitlines()]
    written.write_text("\n".join(lines))
    with pytest.raises(SensorError) as refusal:
        load_sensor(written)
    assert f".{key} = {value}" in str(refusal.value)
    assert absent not in str(refusal.value)


def test_mistakes_in_a_view_hide_no_contradictions_of_the_others(tmp_path: Path) -> None:
    path = tmp_path / "views.toml"
    text = several_views(TEXT).replace("fx_px = ", "fx_px = -", 1)
    path.write_text(text.replace("cy_px = ", "cy_px = 1e6 # "))
    with pytest.raises(SensorError, match=r"views\.0\.fx_px = -.*views\.0: cy_px.*views\.1: cy_px"):
        load_sensor(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[noise]", "[nois]", "unknown key nois, did you mean noise?"),
        ("columns = 30", "colums = 30", "unknown key markers.colums, did you mean columns?"),
        (
            "radius_mm = 1.0",
            "radius_mm = 1.0\nshade = 1\ntint = 2",
            "unknown key markers.shade (allowed are rows, columns, pitch_mm, offset_mm, rest_mm, radius_mm, "
            "height_mm, polarity, colour_weights, missing); unknown key markers.tint",
        ),
        ("thickness_mm = 3.0\n", "thickness_mm = 3.0\ntint = 2\n", "window_mm, window_index, pad_index)"),
        ("thickness_mm = 3.0\n", "", "sheet.thickness_mm is missing: give a number above 0"),
        ("width_px = 2560\n", "", "camera.width_px is missing: give a whole number above 0"),
        ("cx_px = 1279.5\n", "", "camera.cx_px is missing: give a number"),
        ("size_mm = [120.0, 80.0]\n", "", "sheet.size_mm is missing: give a list"),
    ],
)
def test_a_mistake_in_a_key_names_what_is_allowed(written: Path, old: str, new: str, words: str) -> None:
    assert words in message_of(written, (old, new))


def test_unknown_keys_of_views_name_what_is_allowed(tmp_path: Path) -> None:
    path = tmp_path / "views.toml"
    path.write_text(several_views(TEXT).replace("cx_px", "cxpx", 1))
    with pytest.raises(SensorError, match=r"unknown key views.0.cxpx, did you mean cx_px\?"):
        load_sensor(path)


def test_what_could_not_be_read_again_is_not_saved(written: Path, tmp_path: Path) -> None:
    sensor = load_sensor(written)
    small = replace(sensor, sheet=replace(sensor.sheet, size_mm=np.array([50.0, 40.0])))
    with pytest.raises(SensorError, match="markers are outside the clamped outline"):
        save_sensor(small, tmp_path / "small.toml")
    assert not (tmp_path / "small.toml").exists()


def test_a_missing_file_raises(tmp_path: Path) -> None:
    with pytest.raises(SensorError, match="does not exist"):
        load_sensor(tmp_path / "nowhere.toml")


def test_a_known_sensor_loads_by_its_name_and_lists_its_assumptions() -> None:
    assert known_sensors() == ["a4-dots", "fingervision-um", "gelsight-fots", "gelsight-mini"]
    for name in known_sensors():
        sensor = load_sensor(name)
        assert sensor.layout is not None
        place = rest_px(sensor, sensor.layout)
        is_tilted = bool(sensor.camera.rotation_vector.any())
        middle = place.mean(axis=0)
        if not is_tilted:
            assert middle == pytest.approx([sensor.camera.cx_px, sensor.camera.cy_px], abs=0.01)
        assert (place > 0).all()
        assert (place < [sensor.camera.width_px, sensor.camera.height_px]).all()
        is_pad = name in ("fingervision-um", "gelsight-mini")
        assert (sensor.sheet is not None) == is_pad
        assert sensor.provenance["sources"]
        assert sensor.provenance["assumed"]


@pytest.mark.parametrize(
    ("name", "pitch_px"),
    [("gelsight-mini", (31.0, 32.0)), ("gelsight-fots", (29.0, 26.0)), ("a4-dots", (64.0, 80.0))],
)
def test_the_dots_of_a_known_sensor_are_as_far_apart_as_published(name: str, pitch_px) -> None:
    sensor = load_sensor(name)
    rows, columns = sensor.layout.shape
    place = project(sensor.camera, sensor.layout.rest_mm).reshape(rows, columns, 2)
    assert np.diff(place[0, :2, 0])[0] == pytest.approx(pitch_px[0], rel=2e-3)
    assert abs(np.diff(place[:2, 0, 1])[0]) == pytest.approx(pitch_px[1], rel=2e-3)


def test_a_file_goes_before_a_known_name(written: Path, tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "gelsight-mini").write_text(written.read_text())
    monkeypatch.chdir(tmp_path)
    assert load_sensor("gelsight-mini").name != "GelSight Mini with markers (nominal)"
    with pytest.raises(SensorError, match=r"a4-dots, fingervision-um, gelsight-fots, gelsight-mini"):
        load_sensor("gelsight-maxi")


def test_an_unwritable_folder_raises(written: Path, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write the sensor file"):
        save_sensor(load_sensor(written), tmp_path / "no" / "such" / "folder.toml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rows = 20\ncolumns = 30", "rows = 100000\ncolumns = 100000", "10000000000 markers are too many"),
        ("cx_px = 1279.5", "cx_px = 1e29", "cx_px"),
        ("cx_px = 1279.5", "cx_px = 1e8", "cx_px = 1e\\+08 is not within"),
        ("width_px = 2560", "width_px = 2000000", "2000000 x 1440 px are too many"),
        ("thickness_mm = 3.0", "thickness_mm = 1e-300", "thickness_mm"),
        ("size_mm = [120.0, 80.0]", "size_mm = [1e300, 80.0]", "size_mm"),
    ],
)
def test_limits_are_checked_before_anything_is_computed_for_each_marker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, old: str, new: str, words: str
) -> None:
    def of_few(markers: MarkersSection) -> np.ndarray:
        assert markers.count <= MAX_MARKERS, "positions of too many markers were computed"
        return np.zeros((markers.count, 2))

    monkeypatch.setattr("manytouch.values.sensor_file.schema.MarkersSection.rest_xy_mm", property(of_few))
    monkeypatch.setattr(
        "manytouch.values.sensor_file.schema.MarkersSection.min_distance_mm", property(lambda _: 3.0)
    )
    path = tmp_path / "sensor.toml"
    assert old in TEXT
    path.write_text(TEXT.replace(old, new))
    with pytest.raises(SensorError, match=words):
        load_sensor(path)


def test_many_mistakes_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "sensor.toml"
    path.write_text(TEXT + "".join(f"[wrong{number}]\n" for number in range(50)))
    with pytest.raises(SensorError, match="wrong19; and 30 more"):
        load_sensor(path)


@pytest.mark.parametrize("name", ["gelsight-mimi", "GelSight-Mini", "sensors/gelsight_mini.toml"])
def test_a_missing_file_that_resembles_a_known_sensor_is_followed_by_its_name(name):
    with pytest.raises(SensorError, match=r"did you mean gelsight-mini\?$"):
        load_sensor(name)


def test_a_missing_file_that_resembles_no_known_sensor_has_no_suggestion():
    with pytest.raises(SensorError, match=r"gelsight-fots, gelsight-mini$"):
        load_sensor("finger.toml")
