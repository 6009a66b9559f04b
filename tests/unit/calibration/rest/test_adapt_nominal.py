"""Nominal sensor files on recordings with other rows and columns."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from clips import COLUMNS, HEIGHT_PX, PITCH_PX, ROWS, WIDTH_PX, picture
from layouts import lattice_layout
from manytouch.calibration.outline.clamp_line import ClampLine
from manytouch.calibration.rest.adapt_nominal import register_nominal
from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.rest.rest_calibration import RestCalibration, with_provenance
from manytouch.errors import LayoutError
from manytouch.values import Frame, Sensor
from manytouch.values.sensor_file.read import known_sensors, load_sensor
from straight import straight_camera

PITCH_MM = (1.6, 1.7)
FOCAL_PX, DISTANCE_MM = 300.0, 15.0  # 20 px per mm


def frames() -> list[Frame]:
    return [
        Frame(index=index, timestamp_ns=index, camera="drawn", image=picture(seed=index))
        for index in range(6)
    ]


def nominal(rows: int, columns: int) -> Sensor:
    return Sensor(
        name="kind of sensor",
        camera=straight_camera(WIDTH_PX, HEIGHT_PX, focal_px=FOCAL_PX, distance_mm=DISTANCE_MM),
        layout=lattice_layout(rows, columns, PITCH_MM, radius_mm=0.35, polarity="dark"),
        provenance={"nominal": True},
    )


@pytest.mark.parametrize("shape", [(ROWS, COLUMNS - 2), (ROWS - 2, COLUMNS), (ROWS + 2, COLUMNS + 1)])
def test_rows_columns_and_pose_are_those_of_the_frames(shape: tuple[int, int]) -> None:
    given = nominal(*shape)
    found = register_nominal(given, frames())
    assert found.layout is not None
    assert found.layout.shape == (ROWS, COLUMNS)
    assert found.layout.pitch_mm.tolist() == list(PITCH_MM)
    assert np.ptp(found.layout.rest_px[:, 0]) == pytest.approx((COLUMNS - 1) * PITCH_PX[0], abs=0.5)
    assert found.camera.fx_px == given.camera.fx_px
    assert found.camera.translation_mm[2] == pytest.approx(DISTANCE_MM, rel=0.02)
    assert f"{shape[0]} x {shape[1]} markers, but {ROWS} x {COLUMNS} were found" in found.assumptions[0]


def test_a_nominal_file_that_fits_is_used_as_it_is() -> None:
    given = nominal(ROWS, COLUMNS)
    found, usual = register_nominal(given, frames()), register_rest(given, frames())
    np.testing.assert_array_equal(found.layout.rest_px, usual.layout.rest_px)
    assert found.camera is given.camera
    assert found.assumptions == usual.assumptions


def test_the_files_of_the_package_are_nominal_and_others_are_not() -> None:
    assert all(load_sensor(name).is_nominal for name in known_sensors())
    assert not replace(nominal(ROWS, COLUMNS), provenance={}).is_nominal


def test_another_print_keeps_the_distance_of_the_camera_and_has_a_pitch_of_its_own() -> None:
    coarse = nominal(ROWS + 3, COLUMNS + 3)
    assert coarse.layout is not None
    finer = lattice_layout(ROWS + 3, COLUMNS + 3, (1.2, 1.27), radius_mm=0.2, polarity="dark")
    found = register_nominal(replace(coarse, layout=finer), frames())
    assert found.layout is not None
    assert found.layout.shape == (ROWS, COLUMNS)
    np.testing.assert_allclose(found.layout.pitch_mm, np.array(PITCH_PX) * DISTANCE_MM / FOCAL_PX, rtol=0.03)
    assert found.camera.translation_mm[2] == pytest.approx(DISTANCE_MM, rel=0.03)
    assert "The pitch of" in found.assumptions[0]


@pytest.mark.parametrize("given_mm", [2.0, (2.0, 2.2)])
def test_a_pitch_that_is_given_is_that_of_the_print_and_moves_the_camera(
    given_mm: float | tuple[float, float],
) -> None:
    wanted = np.broadcast_to(given_mm, 2)
    for known in (nominal(ROWS, COLUMNS), nominal(ROWS - 1, COLUMNS + 1)):
        found = calibrate_rest(known, frames(), pitch_mm=given_mm)
        layout = found.sensor.layout
        assert layout is not None
        assert layout.shape == (ROWS, COLUMNS)
        np.testing.assert_allclose(layout.pitch_mm, wanted)
        np.testing.assert_allclose(np.ptp(layout.rest_mm[:, :2], axis=0) / (COLUMNS - 1, ROWS - 1), wanted)
        expected_mm = DISTANCE_MM * float(np.mean(wanted / np.array(PITCH_MM)))
        assert found.sensor.camera.translation_mm[2] == pytest.approx(expected_mm, rel=0.03)
        assert any("check pitch_mm" in sentence for sentence in found.warnings)


def test_a_sheet_that_is_pressed_where_it_begins_is_named_as_a_cause() -> None:
    """A wide press moves the markers as another sensor would."""
    given = nominal(ROWS + 2, COLUMNS + 2)
    pressed = frames()
    assert pressed[0].image is not None
    height, width = pressed[0].image.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    dx, dy = x - 0.6 * width, y - 0.55 * height
    near = np.exp(-(dx**2 + dy**2) / (2.0 * (0.13 * width) ** 2))
    sources = (x - 0.6 * near * dx).astype(np.float32), (y - 0.6 * near * dy).astype(np.float32)
    moved = [
        replace(
            each, image=cv2.remap(each.image, *sources, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        )
        for each in pressed
    ]
    with pytest.raises(
        LayoutError, match="something presses on it where it begins: begin it untouched, give"
    ):
        register_nominal(given, moved)


def test_markers_that_no_camera_sees_so_are_refused() -> None:
    given = nominal(ROWS + 2, COLUMNS + 2)
    skewed = replace(given.camera, distortion=np.array([-3.0, 40.0, 0.3, 0.3, 0.0]))
    with pytest.raises(LayoutError, match=r"of another sensor|from no place"):
        register_nominal(replace(given, camera=skewed), frames())


def rest_calibration(sensor: Sensor) -> RestCalibration:
    return RestCalibration(
        sensor=sensor,
        residual_px=np.zeros((4, 2)),
        pose_std=np.zeros(6),
        noise_px=0.1,
        contrast=100.0,
        frames=30,
        frames_given=30,
        first_and_last=(0, 29),
        motion_px=0.02,
        clamp=ClampLine(side_mm=np.full(4, np.nan)),
        warnings=(),
    )


def test_the_name_of_a_sensor_that_was_calibrated_at_rest_is_not_that_of_a_nominal_one() -> None:
    sensor = load_sensor("gelsight-mini")
    assert sensor.name == "GelSight Mini with markers (nominal)"
    assert with_provenance(rest_calibration(sensor), "rest.mcap").name == "GelSight Mini with markers"


def test_a_calibration_at_rest_does_not_make_the_shape_of_the_pad_that_of_the_device() -> None:
    sensor = load_sensor("gelsight-mini")
    assert sensor.is_nominal
    assert sensor.shape_is_nominal
    rested = with_provenance(rest_calibration(sensor), "rest.mcap")
    assert not rested.is_nominal
    assert rested.shape_is_nominal
    assert not with_provenance(rest_calibration(replace(sensor, provenance={})), "rest.mcap").shape_is_nominal


def test_the_keys_of_the_provenance_are_described() -> None:
    page = Path(__file__).parents[4] / "docs" / "sensor-file.md"
    if not page.exists():
        pytest.skip("the pages come with the repository, not with the wheel")
    sensors = [load_sensor(name) for name in known_sensors()]
    sensors += [with_provenance(rest_calibration(sensor), "rest.mcap") for sensor in sensors]
    text = page.read_text(encoding="utf-8")
    keys = {key for sensor in sensors for key in sensor.provenance}
    assert not [key for key in keys if f"`{key}" not in text]
