"""A shallow press between markers that are several thicknesses of a taut sheet apart."""

from pathlib import Path

import numpy as np
import pytest

from manytouch import load_sensor, open_source
from manytouch.session.prepare import prepare

THICKNESS_MM = 2.0
SENSOR = """schema = 1
name = "coarse"
[camera]
width_px = 640
height_px = 640
fx_px = 691.2
fy_px = 691.2
cx_px = 319.5
cy_px = 319.5
[camera.pose]
translation_mm = [0.0, 0.0, {distance_mm}]
[sheet]
size_mm = [{size_mm}, {size_mm}]
thickness_mm = {thickness_mm}
young_MPa = 0.5
poisson = 0.45
pretension_N_per_mm = 0.1
[markers]
rows = 7
columns = 7
pitch_mm = {pitch_mm}
radius_mm = 1.5
polarity = "light"
"""
SCENE = """schema = 1
name = "press"
seconds = 1.0
fps = 20.0
sensor = "sensor.toml"
mechanics = "shell"
[light]
read_noise = 1.5
[[bodies]]
shape = {{ kind = "sphere", radius_mm = 3.0 }}
[[bodies.motions]]
kind = "press"
at_mm = [{at_mm}, {at_mm}]
depth_mm = 0.6
start_s = 0.5
end_s = 1.4
ramp_s = 0.3
"""


@pytest.mark.parametrize("pitch_thickness", [3.0, 3.5])
def test_a_press_between_markers_has_its_place_depth_and_force(
    pitch_thickness: float, tmp_path: Path
) -> None:
    pitch_mm = pitch_thickness * THICKNESS_MM
    (tmp_path / "sensor.toml").write_text(
        SENSOR.format(
            distance_mm=9.6 * pitch_mm, size_mm=8.0 * pitch_mm, thickness_mm=THICKNESS_MM, pitch_mm=pitch_mm
        )
    )
    (tmp_path / "scene.toml").write_text(SCENE.format(at_mm=0.5 * pitch_mm))
    source = open_source(f"sim:{tmp_path / 'scene.toml'}")
    *_, last = prepare(source, sensor=load_sensor(str(tmp_path / "sensor.toml"))).readings()
    (found,) = last.contacts.touching
    (true,) = source.truth(last.frame.index).contacts.touching
    assert np.linalg.norm(found.centre_mm - true.centre_mm) < 0.1 * pitch_mm
    assert found.depth_mm == pytest.approx(true.depth_mm, rel=0.15)
    assert found.force_N[2] == pytest.approx(true.force_N[2], rel=0.05)
