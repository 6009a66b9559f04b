"""The untouched pad behind its window: pose through the window, tilt by the glue, and outline."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from manytouch.calibration.rest.adapt_nominal import register_nominal
from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.rest.rest_calibration import RestCalibration, with_provenance
from manytouch.calibration.rest.rest_report import describe
from manytouch.cli import main
from manytouch.geometry.refraction import project_through_window
from manytouch.simulation.demo_sensor import pad_sensor
from manytouch.simulation.render.discs import DARK_DOTS
from manytouch.simulation.scene.deformation import flat
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Frame, Sensor
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.write import save_sensor

TILT = np.array([0.03, -0.02, 0.01])
SHIFT_MM = np.array([0.3, -0.2, 26.0])
SIZE_MM = np.array([18.4, 14.8])


def glued_pad() -> Sensor:
    """The simulated pad, smaller, with an uneven line of glue."""
    sensor = pad_sensor()
    assert sensor.sheet is not None
    return replace(
        sensor,
        camera=replace(sensor.camera, rotation_vector=TILT, translation_mm=SHIFT_MM),
        sheet=replace(sensor.sheet, size_mm=SIZE_MM),
    )


def frames_of(sensor: Sensor, *, sides: int = 4) -> list[Frame]:
    """Frames at rest that are dark beyond the contact face; with two sides, above and below it only."""
    scene = SolidScene(
        name="rest", time_s=np.array([0.0, 2.0]), states=(flat((18.4, 14.8)),) * 2, duration_s=2.0
    )
    look = replace(DARK_DOTS, read_noise=1.2)
    simulator = Simulator(sensor=sensor, scene=scene, look=look)
    wide_mm = 0.5 * SIZE_MM if sides == 4 else np.array([20.0, 0.5 * SIZE_MM[1]])
    corner_mm = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * wide_mm
    assert sensor.sheet is not None
    face = np.column_stack([corner_mm, np.full(4, sensor.sheet.marker_depth_mm)])
    corner_px = project_through_window(sensor.camera, sensor.sheet, face)
    inside = np.zeros((sensor.camera.height_px, sensor.camera.width_px), dtype=np.uint8)
    cv2.fillPoly(inside, [np.rint(16 * corner_px).astype(np.int32)], 255, lineType=cv2.LINE_AA, shift=4)
    share = inside / 255.0
    found = []
    for index in range(6):
        frame = simulator.frame(index)
        assert frame.image is not None
        image = share * frame.image + (1.0 - share) * 30.0
        found.append(replace(frame, image=np.rint(image).astype(np.uint8)))
    return found


def nominal() -> Sensor:
    """Straight, and with an outline that is known to half a millimetre."""
    sensor = pad_sensor()
    assert sensor.sheet is not None
    pose = {"rotation_vector": np.zeros(3), "translation_mm": np.array([0.0, 0.0, 25.4])}
    sheet = replace(sensor.sheet, size_mm=np.array([18.0, 15.5]), outline_std_mm=0.5)
    return replace(sensor, camera=replace(sensor.camera, **pose), sheet=sheet)


@pytest.fixture(scope="module")
def rested() -> RestCalibration:
    return calibrate_rest(nominal(), frames_of(glued_pad()))


def test_the_pose_with_the_tilt_by_the_glue_is_found_through_the_window(rested: RestCalibration) -> None:
    camera = rested.sensor.camera
    np.testing.assert_allclose(camera.rotation_vector, TILT, atol=2e-4)
    np.testing.assert_allclose(camera.translation_mm, SHIFT_MM, atol=0.02)
    assert rested.rms_px < 0.05


def test_the_outline_of_the_contact_face_is_found(rested: RestCalibration) -> None:
    sheet = rested.sensor.sheet
    assert sheet is not None
    np.testing.assert_allclose(sheet.size_mm, SIZE_MM, atol=0.12)
    assert sheet.outline_std_mm == pytest.approx(0.2)
    assert sheet.boundary == "bonded"
    assert sheet.young_MPa == pytest.approx(0.3)
    assert any("outline of the pad: visible on all sides" in line for line in describe(rested))
    assert not rested.warnings


def test_a_pair_of_sides_out_of_sight_stays_as_stated() -> None:
    found = calibrate_rest(nominal(), frames_of(glued_pad(), sides=2))
    sheet = found.sensor.sheet
    assert sheet is not None
    assert sheet.size_mm[0] == pytest.approx(18.0)
    assert sheet.size_mm[1] == pytest.approx(SIZE_MM[1], abs=0.12)
    assert sheet.outline_std_mm == pytest.approx(0.5)


def test_an_edge_far_from_the_stated_outline_is_not_that_of_the_pad() -> None:
    stated = nominal()
    assert stated.sheet is not None
    large = replace(stated.sheet, size_mm=np.array([25.0, 21.0]), outline_std_mm=0.3)
    found = calibrate_rest(replace(stated, sheet=large), frames_of(glued_pad()))
    assert found.sensor.sheet is not None
    np.testing.assert_allclose(found.sensor.sheet.size_mm, [25.0, 21.0])
    assert any("differs from [sheet]" in sentence for sentence in found.warnings)


def test_rows_that_a_nominal_file_lacks_are_placed_through_the_window() -> None:
    frames = frames_of(glued_pad())
    fewer = replace(nominal(), provenance={"nominal": True})
    layout = fewer.layout
    assert layout is not None
    assert layout.row_column is not None
    kept = layout.row_column[:, 0] < 6
    fewer = replace(
        fewer,
        layout=replace(
            layout,
            rest_mm=layout.rest_mm[kept],
            row_column=layout.row_column[kept],
            radius_mm=layout.radius_mm[kept],
            is_missing=layout.is_missing[kept],
        ),
    )
    adapted = register_nominal(fewer, frames)
    np.testing.assert_allclose(adapted.camera.translation_mm, SHIFT_MM, atol=0.1)
    found = calibrate_rest(fewer, frames)
    assert "nominal" not in with_provenance(found, "rest.mp4").provenance


def test_the_verb_takes_the_thickness_of_a_pad_and_keeps_the_rest(tmp_path: Path) -> None:
    images = tmp_path / "rest"
    images.mkdir()
    for frame in frames_of(glued_pad(), sides=2):
        cv2.imwrite(str(images / f"{frame.index}.png"), frame.image)
    save_sensor(nominal(), tmp_path / "nominal.toml")
    words = ["calibrate", "rest", str(images), "--sensor", str(tmp_path / "nominal.toml")]
    words += ["--sheet-mm", "18.2,15", "--thickness-mm", "3.9", "--out", str(tmp_path / "out.toml")]
    assert main(words) == 0
    sheet = load_sensor(tmp_path / "out.toml").sheet
    assert sheet is not None
    assert (sheet.boundary, sheet.thickness_mm, sheet.window_mm) == ("bonded", 3.9, 3.0)
    assert sheet.size_mm[0] == pytest.approx(18.2)
    assert sheet.size_mm[1] == pytest.approx(SIZE_MM[1], abs=0.15)
