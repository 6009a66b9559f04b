"""The chosen dimensions, their reasons, and conflicts of requirements."""

import re

import numpy as np
import pytest

from manytouch.cli import main
from manytouch.design.choose import design_sensor
from manytouch.design.dimensions import MIN_MARKER_GAP_PX, MIN_RIM_MM, rim_mm
from manytouch.design.requirements import CameraSpecification, DesignError, Printer, Requirements
from manytouch.values.sensor_file.read import load_sensor


@pytest.fixture(scope="module")
def default():
    return design_sensor(Requirements())


def test_a_design_satisfies_its_requirements(default):
    requirements, sensor = default.requirements, default.sensor
    rim = rim_mm(requirements, sensor.sheet.thickness_mm)
    assert sensor.sheet.size_mm.tolist() == [100.0 + 2 * rim, 60.0 + 2 * rim]
    assert default.depth_under_largest_force_mm <= requirements.deepest_mm
    assert sensor.sheet.young_std_MPa == pytest.approx(0.3 * sensor.sheet.young_MPa, abs=1e-3)
    assert sensor.layout.pitch_mm[0] <= requirements.separation_mm / 2
    assert [sensor.camera.cx_px, sensor.camera.cy_px] == [(2560 - 1) / 2, (1440 - 1) / 2]
    half_px = sensor.camera.fx_px * sensor.sheet.size_mm / 2 / sensor.camera.translation_mm[2]
    assert np.all(half_px <= [sensor.camera.width_px / 2, sensor.camera.height_px / 2])
    grid_mm = sensor.layout.rest_mm[:, :2].reshape(*sensor.layout.shape, 2)
    assert np.diff(grid_mm, axis=1)[..., 0] == pytest.approx(sensor.layout.pitch_mm[0])
    assert np.diff(grid_mm, axis=0)[..., 1] == pytest.approx(sensor.layout.pitch_mm[1])
    assert grid_mm.mean(axis=(0, 1)) == pytest.approx([0.0, 0.0], abs=1e-9)
    reach = np.abs(sensor.layout.rest_mm[:, :2]).max(axis=0) + sensor.layout.radius_mm[0]
    assert np.all(reach < sensor.sheet.size_mm / 2)
    gap = default.curve.smallest_gap_mm(pitch_mm=4.0, radius_mm=1.0, height_mm=0.0, depth_mm=10.0)
    assert MIN_MARKER_GAP_PX * default.mm_per_px < gap < 2.0


def test_a_thick_sheet_has_a_wider_rim():
    assert rim_mm(Requirements(separation_mm=8.0), 2.0) == MIN_RIM_MM
    assert rim_mm(Requirements(separation_mm=8.0), 3.0) == 12.0
    assert rim_mm(Requirements(separation_mm=10.0), 4.0) == 15.5
    thick = design_sensor(Requirements(area_mm=(40.0, 25.0), thickness_mm=4.0, force_N=(0.5, 4.0)))
    assert thick.sensor.sheet.size_mm.tolist() == [68.0, 53.0]
    (why,) = (reason.why for reason in thick.reasons if reason.about == "clamped outline")
    assert "a rim of 14 mm: 2 thicknesses" in why


def test_the_reason_for_the_gap_states_its_limits(default):
    (why,) = (reason.why for reason in default.reasons if reason.about == "gap between markers")
    numbers = re.search(r"every ([\d.]+) mm, or with a radius of ([\d.]+) mm, or (\d+) mm high", why)
    pitch, radius, height = (float(text) for text in numbers.groups())
    least = MIN_MARKER_GAP_PX * default.mm_per_px
    for sizes, free in (
        ({"pitch_mm": pitch, "radius_mm": 1.0, "height_mm": 0.0}, 0.06),
        ({"pitch_mm": 4.0, "radius_mm": radius, "height_mm": 0.0}, 0.12),
        ({"pitch_mm": 4.0, "radius_mm": 1.0, "height_mm": height}, 0.1),
    ):
        assert default.curve.smallest_gap_mm(depth_mm=10.0, **sizes) == pytest.approx(least, abs=free)


def test_smaller_forces_give_a_softer_sheet(default):
    gentle = design_sensor(Requirements(force_N=(0.01, 0.2), deepest_mm=5.0))
    assert gentle.material.young_MPa < default.material.young_MPa
    assert 2.0 < gentle.depth_under_largest_force_mm <= 5.0


def test_markers_on_pins_must_not_touch_when_pressed(default):
    slope, turn = np.transpose(default.curve.pairs_rad(4.0, 10.0))
    assert 0.1 < np.abs(slope).max() < 0.6
    assert turn.max() > 0
    assert slope[0] + turn[0] == pytest.approx(slope[10], abs=1e-12)
    with pytest.raises(DesignError, match=r"make them at most .* mm high"):
        design_sensor(Requirements(marker_height_mm=60.0, thickness_mm=default.curve.thickness_mm))


@pytest.mark.parametrize(
    ("requirements", "sentence"),
    [
        ({"separation_mm": 1.0}, "use a larger separation, a smaller area, or a camera with more pixels"),
        (
            {"force_N": (1.0, 5000.0)},
            "no sheet supports 5000 N on 1 cm² within 10 mm: the stiffest, TPU, Shore A 95, 4 mm",
        ),
        ({"force_N": (5.0, 1.0)}, "the force range 5 to 1 N is empty"),
        ({"area_mm": (-1.0, 2.0), "deepest_mm": 0.0}, "area_mm\\[0\\] = -1.0, deepest_mm = 0.0"),
        ({"camera": CameraSpecification(hfov_deg=150.0, least_focus_mm=5.0)}, "comes too close to a camera"),
        ({"camera": CameraSpecification(hfov_deg=175.0)}, "too large for a pinhole model"),
        ({"printer": Printer(nozzle_mm=3.0)}, "the printer prints"),
        ({"area_mm": (5000.0, 5000.0)}, "at most 1 m² and 5 m along a side are designed; reduce the area"),
        ({"area_mm": (9000.0, 20.0)}, "at most 1 m² and 5 m along a side are designed"),
        ({"thickness_mm": 1e6}, "at most 1 m² and 5 m along a side are designed"),
        ({"area_mm": (300.0, 300.0), "separation_mm": 1.0}, "markers: at most 100000 are allowed"),
        ({"separation_mm": 1e-9}, "markers: at most 100000 are allowed"),
        ({"material": "wood"}, "the material 'wood' is not known; choose one of 'silicone, Shore A 20', "),
    ],
)
def test_a_conflict_of_requirements_is_named(requirements, sentence):
    with pytest.raises(DesignError, match=sentence):
        design_sensor(Requirements(**{"area_mm": (40.0, 25.0), **requirements}))


def test_the_verb_writes_a_sensor_that_loads(tmp_path, capsys):
    words = ["design", "--out", str(tmp_path), "--parts", "none", "--explain", "--thickness-mm", "3"]
    words += ["--area-mm", "40,25"]
    assert main(words) == 0
    sensor = load_sensor(tmp_path / "sensor.toml")
    assert sensor.sheet.thickness_mm == 3.0
    output = capsys.readouterr().out
    assert "equation 4, as d > F" in output
    assert "| clamped outline |" in (tmp_path / "design.md").read_text()
    assert main([*words, "--separation-mm", "0.5"]) == 1
    assert "use a larger separation" in capsys.readouterr().err
