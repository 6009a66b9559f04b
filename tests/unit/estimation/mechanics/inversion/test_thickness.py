"""The thickness and the outline of a sheet of which only the markers are known."""

from dataclasses import replace

import numpy as np
import pytest

from bent_sheets import PITCH_MM, bent, grid_of, sensor_of
from manytouch.estimation import MechanicsEstimator
from manytouch.values import Sensor
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.assumed_sheet import assumed_sheet

ESTIMATE = MechanicsEstimator()


def markers_of(sensor: Sensor) -> Sensor:
    """The sensor without its sheet."""
    assert sensor.layout is not None
    return replace(sensor, sheet=None)


@pytest.mark.parametrize("wider_mm", [0.0, -2.0])
@pytest.mark.parametrize("thickness_pitch", [0.3, 1.5])
def test_a_press_shows_the_thickness(thickness_pitch: float, wider_mm: float) -> None:
    """The true outline is the assumed one, or 2 mm within it on each side."""
    known = sensor_of(thickness_mm=thickness_pitch * PITCH_MM, pretension_N_per_mm=0.0, young_MPa=1.0)
    assert known.layout is not None
    size_mm = read_only(assumed_sheet(known.layout).size_mm + 2.0 * wider_mm)
    known = replace(known, sheet=replace(known.sheet, size_mm=size_mm))
    true = ESTIMATE.start(known).model
    light = bent(true, (2.0, 1.0, 1e-4))
    press = 1e-4 / float(-true.dots.displacement_mm(light)[:, 2].min())
    flat = np.zeros((true.patch.node_count, 3))
    shapes = [bent(true, (2.0, 1.0, press * depth_mm)) for depth_mm in (2.0, 8.0)]
    state, shape = ESTIMATE.start(markers_of(known)), shapes[1]
    for seed, each in enumerate([flat] + 12 * [shapes[0]] + 12 * [shape]):
        state, surface, contacts = ESTIMATE.step(state, grid_of(true, each, seed=seed))
    assert surface.spline is not None
    spline = surface.spline
    assert spline.thickness_mm / PITCH_MM == pytest.approx(thickness_pitch, rel=0.25)
    off_mm = abs(spline.thickness_mm - thickness_pitch * PITCH_MM)
    assert off_mm < 1.96 * spline.thickness_std_mm < 0.5 * spline.thickness_mm
    depth_mm = float(-true.dots.displacement_mm(shape)[:, 2].min())
    (contact,) = contacts.touching
    assert contact.id == 0
    assert float(-surface.displacement_mm[:, 2].min()) == pytest.approx(depth_mm, rel=0.1)
    assert state.thickness.searches <= ESTIMATE.thickness.most_searches
