"""Equation 1: the gap between markers."""

import math

import pytest

from manytouch.design.spacing import gap_mm, largest_height_mm, largest_radius_mm, smallest_pitch_mm


def gap_by_rotation(d: float, r: float, h: float, slope: float, turn: float) -> float:
    """Equation 1 by rotating two markers instead of by its formula."""

    def rotate(x: float, angle: float, corner: tuple[float, float]) -> float:
        return x + corner[0] * math.cos(angle) - corner[1] * math.sin(angle)

    return rotate(d * math.cos(slope + turn), slope + turn, (-r, h)) - rotate(0.0, slope, (r, h))


@pytest.mark.parametrize("slope", [-0.3, 0.0, 0.2])
@pytest.mark.parametrize("turn", [-0.15, 0.0, 0.25])
def test_equation_1_is_the_gap_between_two_rotated_markers(slope, turn):
    found = gap_mm(pitch_mm=4.0, radius_mm=1.1, height_mm=1.7, slope_rad=slope, turn_rad=turn)
    assert found == pytest.approx(gap_by_rotation(4.0, 1.1, 1.7, slope, turn))


def test_equation_1_of_a_flat_sheet_is_the_pitch_without_two_radii():
    assert gap_mm(pitch_mm=4.0, radius_mm=1.0, height_mm=3.0, slope_rad=0.0, turn_rad=0.0) == pytest.approx(
        2.0
    )


def test_equation_1_is_solved_for_pitch_radius_and_height():
    shape = {"slope_rad": 0.1, "turn_rad": 0.2}
    pitch = smallest_pitch_mm(gap_mm=0.5, radius_mm=1.0, height_mm=2.0, **shape)
    assert gap_mm(pitch_mm=pitch, radius_mm=1.0, height_mm=2.0, **shape) == pytest.approx(0.5)
    radius = largest_radius_mm(pitch_mm=4.0, gap_mm=0.5, height_mm=2.0, **shape)
    assert gap_mm(pitch_mm=4.0, radius_mm=radius, height_mm=2.0, **shape) == pytest.approx(0.5)
    height = largest_height_mm(pitch_mm=4.0, radius_mm=1.0, gap_mm=0.5, **shape)
    assert gap_mm(pitch_mm=4.0, radius_mm=1.0, height_mm=height, **shape) == pytest.approx(0.5)
    assert (
        largest_height_mm(pitch_mm=4.0, radius_mm=1.0, gap_mm=0.5, slope_rad=0.2, turn_rad=-0.2) == math.inf
    )
