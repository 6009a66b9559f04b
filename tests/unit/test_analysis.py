"""Results read back, and drawings of readings and results."""

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

import manytouch
from manytouch.geometry.camera import project
from manytouch.session.results import process_job
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.files.regions import RegionTable
from manytouch.sources.simulated import simulated_source
from results import rows_of

pytest.importorskip("matplotlib")

SECONDS = 2.0  # the first contact of the built-in scene begins after 1 s

WRONG_ARGUMENTS = """
from itertools import islice
import numpy as np
import manytouch
sensor = manytouch.load_sensor("a4-dots")
frames = list(islice(manytouch.open_source("sim:"), 1))
pipeline = manytouch.pipeline_for("perimeter")
grey = frames[0].image

def frame(image):
    return manytouch.Frame(index=0, timestamp_ns=0, camera="mine", image=image)

rest = manytouch.sensor_from_rest(frames, name="a")
(surface,) = (reading.surface for reading in pipeline.run(frames, rest))
calls = [
    lambda: manytouch.open_source(1.5),
    lambda: manytouch.open_source("sim:", fps="30"),
    lambda: manytouch.prepare([1, 2]),
    lambda: manytouch.prepare("sim:", sensor=3),
    lambda: manytouch.prepare("sim:", roi_px=(1, 2, 3, 4)),
    lambda: manytouch.prepare("sim:", parameters=[3]),
    lambda: manytouch.prepare("sim:", observer=print),
    lambda: manytouch.pipeline_for("perimeter", (1, 2, 3, 4)),
    lambda: manytouch.pipeline_for("perimeter", None, [3]),
    lambda: manytouch.pipeline_for("perimeter", None, {"detect.least_share": [0.5]}),
    lambda: manytouch.pipeline_for("perimeter", None, {"detect.least_share": 1j}),
    lambda: manytouch.Roi(0, 0, 10.5, 10),
    lambda: manytouch.process(None, out="x"),
    lambda: manytouch.process("sim:", out=3),
    lambda: manytouch.run("press.mp4"),
    lambda: manytouch.run(manytouch.prepare("sim:", method="perimeter"), print),
    lambda: manytouch.run(manytouch.prepare("sim:", method="perimeter"), [print]),
    lambda: manytouch.run(manytouch.prepare("sim:", method="perimeter"), [], observer=print),
    lambda: manytouch.run(manytouch.prepare("sim:", method="perimeter"), [], stop=True),
    lambda: manytouch.stream("sim:", to="osc://127.0.0.1:9000"),
    lambda: manytouch.stream("sim:", to=None),
    lambda: manytouch.stream("sim:", record=3),
    lambda: manytouch.stream("sim:").send("tare"),
    lambda: manytouch.sensor_from_rest("press.mp4", name="a"),
    lambda: manytouch.sensor_from_rest([np.zeros((4, 4))], name="a"),
    lambda: manytouch.sensor_from_rest(frames, name="a", pitch_mm="4"),
    lambda: manytouch.sensor_from_rest(frames, name="a", pitch_mm=(4.0, None)),
    lambda: manytouch.sensor_from_rest(frames, name="a", hfov_deg="60"),
    lambda: manytouch.sensor_from_rest(frames, name="a", roi_px=(1, 2, 3, 4)),
    lambda: manytouch.sensor_from_rest(frames, name=3),
    lambda: pipeline.run("press.mp4", sensor),
    lambda: pipeline.run(frames, "sensor.toml"),
    lambda: list(pipeline.run([grey], sensor)),
    lambda: frame("press.png"),
    lambda: frame(grey.tolist()),
    lambda: frame(grey / 255.0),
    lambda: frame(grey > 100),
    lambda: frame(grey.astype(">u2")),
    lambda: frame(grey.ravel()),
    lambda: frame(grey[0, 0]),
    lambda: frame(np.dstack([grey] * 4)),  # BGRA
    lambda: manytouch.Frame(index=1.5, timestamp_ns=0, camera="mine", image=None),
    lambda: manytouch.Frame(index="1", timestamp_ns=0, camera="mine", image=None),
    lambda: manytouch.Frame(index=1, timestamp_ns="0", camera="mine", image=None),
    lambda: manytouch.Frame(index=1, timestamp_ns=float("nan"), camera="mine", image=None),
    lambda: manytouch.Frame(index=1, timestamp_ns=0, camera="mine", image=None, encoded="press.jpg"),
    lambda: manytouch.Frame(index=1, timestamp_ns=0, camera="mine", image=None, arrived_ns="now"),
    lambda: manytouch.Frame(index=1, timestamp_ns=0, camera=3, image=None),
    lambda: manytouch.sample(sensor, np.zeros(2), np.zeros(2)),
    lambda: manytouch.sample(surface, "left", np.zeros(1)),
    lambda: manytouch.sample(surface, np.zeros(3), np.zeros(2)),
    lambda: manytouch.sample(surface, *np.meshgrid(np.zeros(3), np.zeros(2))),
    lambda: manytouch.sample(surface, np.array([np.nan, 0.0]), np.zeros(2)),
    lambda: manytouch.load_sensor(sensor),
    lambda: manytouch.save_sensor("sensor.toml", sensor),
    lambda: manytouch.plot_surface(sensor),
    lambda: manytouch.plot_contacts(sensor),
    lambda: manytouch.plot_layout("a4-dots"),
    lambda: manytouch.read_results(3),
]
try:
    manytouch.sensor_from_rest(frames, name="a", pitch_mm=(4.0, 4.0, 4.0))
except manytouch.SensorError as error:
    assert "(4.0, 4.0, 4.0) mm was given" in str(error)
else:
    raise AssertionError("a pitch of three numbers was accepted")
for number, call in enumerate(calls):
    try:
        call()
    except manytouch.ArgumentError as error:
        assert isinstance(error, TypeError) and ": give " in str(error), (number, error)
    else:
        raise AssertionError(f"call {number} was accepted")
"""

NUMPY_ARGUMENTS = """
import json
import tempfile
from dataclasses import replace
from itertools import islice
from pathlib import Path
import cv2
import numpy as np
import manytouch
from manytouch.session import Request, request_hashes
source = manytouch.open_source("sim:")
own = Request(hfov_deg=60.0, pitch_mm=4.0, roi_px=manytouch.Roi(2, 0, 20, 10))
numbers = np.array([2, 0, 20, 10])
request = Request(hfov_deg=np.float32(60.0), pitch_mm=np.float32(4.0), roi_px=manytouch.Roi(*numbers))
assert request_hashes(source, "sim:", request) == request_hashes(source, "sim:", own)
frames = list(islice(source, 3))
grey = frames[0].image
one = manytouch.Frame(index=np.int32(3), timestamp_ns=np.int32(10), camera="mine", image=grey[..., None])
assert np.array_equal(one.image, grey)
assert (type(one.index), type(one.timestamp_ns)) == (int, int)
third = manytouch.Frame(index=1, timestamp_ns=1e9 / 30, camera="mine", image=grey)
assert (third.timestamp_ns, type(third.timestamp_ns)) == (33_333_333, int)
buffer = bytearray(b"JPEG")
fourth = replace(third, encoded=buffer, arrived_ns=np.float64(2.6))
buffer[0] = 0
assert (fourth.encoded, fourth.arrived_ns, type(fourth.arrived_ns)) == (b"JPEG", 3, int)
sensor = manytouch.sensor_from_rest(frames, name="a", hfov_deg=np.float32(60.0))
assert isinstance(sensor.camera.fx_px, float)
assert request.roi_px == own.roi_px and repr(request.roi_px) == repr(own.roi_px)
for fps in (np.int64(50), np.float32(50.0)):
    source = manytouch.open_source("sim:", fps=fps)
    assert type(source.fps) in (int, float)
    assert [frame.timestamp_ns for frame in islice(source, 2)] == [0, 20_000_000]
try:
    manytouch.prepare(np.int64(99))
except manytouch.SourceError as error:
    assert "camera" in str(error), error
else:
    raise AssertionError("there is a camera 99")


def process(folder, number, real, pair):
    name = "estimate.contact_tracker.bridge_frames"
    parameters = {name: number(3), "detect.least_share": real(0.25)}
    options = {"fps": number(25), "hfov_deg": number(50), "pitch_mm": pair([number(4), number(5)])}
    made = manytouch.process(
        folder / "images", out=folder / number.__name__, method="mechanics", parameters=parameters, **options
    )
    return json.loads((made / "summary.json").read_text()), (made / "markers.parquet").read_bytes()


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    known = manytouch.prepare("sim:rest").sensor
    sheet = replace(known.sheet, young_MPa=np.float32(1.5))
    camera = replace(known.camera, width_px=np.int64(known.camera.width_px))
    known = replace(known, sheet=sheet, camera=camera, provenance={"steps": [np.int64(3)], "at": np.ones(2)})
    manytouch.save_sensor(known, folder / "sensor.toml")
    loaded = manytouch.load_sensor(folder / "sensor.toml")
    assert (loaded.sheet.young_MPa, dict(loaded.provenance)) == (1.5, {"steps": [3], "at": [1.0, 1.0]})
    made = manytouch.process("sim:rest", out=folder / "rest", method="perimeter", sensor=known)
    assert json.loads((made / "summary.json").read_text())["sensor"]["sheet"]["young_MPa"] == 1.5
    (folder / "images").mkdir()
    for frame in frames:
        cv2.imwrite(str(folder / "images" / f"{frame.index}.png"), frame.image)
    plain, table = process(folder, int, float, tuple)
    summary, same = process(folder, np.int64, np.float32, np.array)
assert table == same
assert plain["hash"] == summary["hash"] and plain["parameters"] == summary["parameters"]
assert summary["parameters"]["estimate"]["contact_tracker"]["bridge_frames"] == 3
assert summary["parameters"]["detect"]["least_share"] == 0.25
"""


@pytest.fixture(scope="module")
def processed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, manytouch.Reading]:
    """The folder of a short simulated recording, and its last reading."""
    folder = tmp_path_factory.mktemp("results") / "sim"
    last = LastReading()
    job = manytouch.prepare(simulated_source(fps=20.0, width_px=640).lasting(SECONDS), method="perimeter")
    process_job(job, folder, sinks=[last])
    return folder, last.reading


@pytest.fixture(autouse=True)
def closed_figures() -> Iterator[None]:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    yield
    pyplot.close("all")


class LastReading:
    """Keeps the newest reading."""

    reading: manytouch.Reading

    def write(self, reading: manytouch.Reading) -> None:
        self.reading = reading

    def close(self) -> None:
        pass


def test_results_have_every_row_and_unknown_values_are_null(processed: tuple) -> None:
    folder, _ = processed
    results = manytouch.read_results(folder)
    lines = rows_of(folder / "contacts.csv")
    assert len(lines) > 10
    assert results.contacts["contact"].to_pylist() == [int(line["contact"]) for line in lines]
    assert results.contacts["depth_mm"].to_pylist() == [float(line["depth_mm"]) for line in lines]
    assert results.contacts["phase"].to_pylist() == [line["phase"] for line in lines]
    assert results.contacts["normal_force_N"].null_count == len(lines)  # this method estimates no force
    assert len(results.frames) == len(rows_of(folder / "frames.csv"))
    assert len(results.markers) == 600 * len(results.frames)
    assert len(repr(results)) < 200
    assert "depth_mm" in results._repr_html_()


def test_trackpy_gets_its_columns_and_only_markers_that_were_seen(processed: tuple) -> None:
    results = manytouch.read_results(processed[0])
    table = results.trackpy()
    assert table.column_names == ["frame", "particle", "x", "y"]
    assert len(table) == sum(results.markers["seen"].to_pylist())
    assert table["x"].null_count == 0


def test_regions_are_a_table_which_is_empty_where_the_folder_has_none(
    processed: tuple, tmp_path: Path
) -> None:
    folder, reading = processed
    for path in folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    corners_mm = np.array([[1.0, -2.0], [4.0, -2.0], [4.0, 0.0]])
    ring = manytouch.OutlineRing(point_mm=corners_mm)
    contact = replace(reading.contacts.touching[0], outline=(ring,))
    written = RegionTable(tmp_path, demo_sensor())
    written.write(replace(reading, contacts=replace(reading.contacts, contacts=(contact,))))
    written.close()
    regions = manytouch.read_results(tmp_path).regions
    assert regions.drop_columns("outline").to_pylist() == [
        {"frame": reading.frame.index, "contact": contact.id, "ring": 0, "is_hole": False}
    ]
    assert regions["outline"].to_pylist() == [corners_mm.tolist()]
    (tmp_path / "regions.parquet").unlink()
    none = manytouch.read_results(tmp_path).regions
    assert (len(none), none.schema) == (0, regions.schema)


def test_a_folder_without_results_is_refused_with_what_to_give(processed: tuple, tmp_path: Path) -> None:
    with pytest.raises(manytouch.SourceError, match="no folder"):
        manytouch.read_results(tmp_path / "nothing")
    with pytest.raises(manytouch.SourceError, match=r"contacts\.csv"):
        manytouch.read_results(tmp_path)
    with pytest.raises(manytouch.SourceError, match=r"give one of its folders, such as '.*sim'"):
        manytouch.read_results(processed[0].parent)


@pytest.mark.parametrize(
    "name", ["contacts.csv", "markers.parquet", "frames.csv", "regions.parquet", "summary.json"]
)
@pytest.mark.parametrize("content", [b"", b"a,b\n1,2\n", b"\xff\xfe\x00"])
def test_a_damaged_file_is_refused_with_its_name(
    processed: tuple, tmp_path: Path, name: str, content: bytes
) -> None:
    for path in processed[0].iterdir():
        (tmp_path / path.name).write_bytes(content if path.name == name else path.read_bytes())
    with pytest.raises(manytouch.SourceError, match=name):
        manytouch.read_results(tmp_path)


def test_a_reading_is_drawn_with_its_markers_and_contacts(processed: tuple) -> None:
    _, reading = processed
    axes = reading.draw()
    (markers, *_) = axes.lines
    assert np.array_equal(markers.get_xydata(), reading.grid.position_px[reading.grid.is_seen])
    assert [text.get_text() for text in axes.texts] == [str(each.id) for each in reading.contacts.touching]
    assert axes.images
    (arrows,) = axes.collections
    true_px = project(demo_sensor(640).camera, demo_sensor(640).layout.rest_mm)[reading.grid.is_seen]
    moved_px = np.column_stack([arrows.U, arrows.V]) / 3.0
    expected_px = reading.grid.position_px[reading.grid.is_seen] - true_px
    assert np.abs(expected_px).max() > 1.0
    assert np.abs(moved_px - expected_px).max() < 0.35 * np.abs(expected_px).max()
    assert reading.draw(axes) is axes
    undecoded = replace(reading, frame=replace(reading.frame, image=None)).draw()
    assert undecoded.yaxis_inverted()


def test_the_surface_is_drawn_at_its_place_with_its_contacts(processed: tuple) -> None:
    _, reading = processed
    axes = manytouch.plot_surface(reading)
    (contact, *_) = reading.contacts.touching
    assert axes.collections[0].get_array().max() == pytest.approx(contact.depth_mm, rel=0.2)
    assert axes.yaxis_inverted()
    assert len(axes.texts) == len(reading.contacts.touching)


def test_contacts_over_time_are_one_line_each(processed: tuple) -> None:
    results = manytouch.read_results(processed[0])
    axes = manytouch.plot_contacts(results)
    assert len(axes.lines) == len(set(results.contacts["contact"].to_pylist()))
    assert axes.get_ylabel() == "depth (mm)"
    assert len(axes.collections) == len(axes.lines)
    assert "2 standard deviations" in axes.get_title()
    assert axes.get_legend() is not None
    with pytest.raises(manytouch.ManytouchError, match="normal_force_over_E or shear_x"):
        manytouch.plot_contacts(results, quantity="colour")


def test_an_empty_plot_states_why(processed: tuple) -> None:
    results = manytouch.read_results(processed[0])
    axes = manytouch.plot_contacts(results, quantity="normal_force")
    assert not axes.lines
    assert axes.texts[0].get_text() == "the method perimeter does not estimate normal force"
    stiff = replace(results, summary={**results.summary, "method": "mechanics"})
    assert "young_MPa" in manytouch.plot_contacts(stiff, quantity="normal_force").texts[0].get_text()
    none = replace(results, contacts=results.contacts[:0])
    assert manytouch.plot_contacts(none).texts[0].get_text() == "no contact was found"


def test_up_to_twenty_contacts_have_a_legend_and_their_own_colours(processed: tuple) -> None:
    results = manytouch.read_results(processed[0])
    rows = results.contacts[:20]
    count = len(rows)
    assert count > 10
    rows = rows.set_column(rows.column_names.index("contact"), "contact", [list(range(count))])
    rows = rows.set_column(rows.column_names.index("phase"), "phase", [["move"] * count])
    axes = manytouch.plot_contacts(replace(results, contacts=rows), quantity="x")
    assert len(axes.get_legend().get_texts()) == count
    assert len({tuple(line.get_color()) for line in axes.lines}) == count


def test_the_layout_is_drawn_with_the_outline_of_the_sheet() -> None:
    axes = manytouch.plot_layout(demo_sensor(640))
    markers, outline = axes.lines
    assert len(markers.get_xdata()) == 600
    assert outline.get_xdata().max() == pytest.approx(60.0)


def test_values_have_short_tables_and_texts_are_escaped(processed: tuple) -> None:
    _, reading = processed
    sensor = replace(demo_sensor(640), name="<b>")
    for value in (reading, reading.contacts, reading.contacts.contacts[0], sensor):
        table = value._repr_html_()
        assert table.startswith("<table>")
        assert len(table) < 3000
    assert "&lt;b&gt;" in sensor._repr_html_()


@pytest.mark.parametrize("script", [WRONG_ARGUMENTS, NUMPY_ARGUMENTS], ids=["wrong", "numpy"])
def test_wrong_types_are_refused_in_a_sentence_and_numbers_of_numpy_are_those_of_python(script: str) -> None:
    """In a process without the type checks of the tests, as they would refuse first."""
    environment = {name: value for name, value in os.environ.items() if name != "CHECK_TYPES"}
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_wide_bands_do_not_hide_the_values(processed: tuple) -> None:
    results = manytouch.read_results(processed[0])
    rows = results.contacts
    place = rows.column_names.index("x_std_mm" if results.unit == "mm" else "x_std_pitch")
    wide = rows.set_column(place, rows.column_names[place], pa.array([1000.0] * len(rows)))
    axes = manytouch.plot_contacts(replace(results, contacts=wide), quantity="x")
    values = np.concatenate([line.get_ydata() for line in axes.lines])
    low, high = axes.get_ylim()
    assert low < values.min() <= values.max() < high
    assert high - low < 3.0 * (np.ptp(values) + abs(values).max())
