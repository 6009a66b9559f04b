"""Regions of known pressures: area, share of the force, holes."""

import numpy as np
import pytest

from manytouch.estimation.mechanics.regions.outlines import (
    POINT_STDS,
    SHARE,
    polygon_area,
    region_of,
    shape_points,
    within_rectangle,
)
from manytouch.values import ContactShape


def share_inside(point_mm: np.ndarray, rings: tuple[np.ndarray, ...], std_mm: float) -> float:
    """Share of the smoothed force within the outer ring and outside its holes, by random points."""
    from matplotlib.path import Path

    chance = np.random.default_rng(0)
    drawn = point_mm[chance.integers(0, len(point_mm), 40000)] + std_mm * chance.standard_normal((40000, 2))
    inside = Path(rings[0]).contains_points(drawn)
    for hole in rings[1:]:
        inside &= ~Path(hole).contains_points(drawn)
    return float(inside.mean())


def test_the_region_of_a_point_is_a_disc() -> None:
    area_mm2, rings = region_of(shape_points(ContactShape.POINT, np.zeros(2)), 2.0)
    assert area_mm2 == pytest.approx(np.pi * (2.0 * POINT_STDS) ** 2, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(rings[0], axis=1), 2.0 * POINT_STDS, rtol=0.02)


@pytest.mark.parametrize(
    ("shape", "half_mm", "holes"),
    [
        (ContactShape.POINT, (0.0, 0.0), 0),
        (ContactShape.LINE, (15.0, 0.0), 0),
        (ContactShape.PATCH, (8.0, 3.0), 0),
        (ContactShape.RING, (12.0, 12.0), 1),
        (ContactShape.RING, (2.0, 2.0), 0),
    ],
)
def test_a_region_carries_its_share_of_the_force(shape, half_mm, holes) -> None:
    point_mm = shape_points(shape, np.array(half_mm))
    area_mm2, rings = region_of(point_mm, 2.0)
    assert len(rings) == 1 + holes
    assert share_inside(point_mm, rings, 2.0) == pytest.approx(SHARE, abs=0.012)
    areas = [polygon_area(ring) for ring in rings]
    assert areas[0] > 0.0
    assert all(area < 0.0 for area in areas[1:])  # a hole runs the other way
    assert sum(areas) == pytest.approx(area_mm2)


@pytest.mark.parametrize("shape", [ContactShape.LINE, ContactShape.PATCH, ContactShape.RING])
def test_the_points_of_a_shape_have_the_moments_of_its_ellipse(shape) -> None:
    half_mm = np.array([6.0, 6.0]) if shape is ContactShape.RING else np.array([6.0, 2.5])
    point_mm = shape_points(shape, half_mm)
    moment = point_mm.T @ point_mm / len(point_mm)
    wanted = 0.25 * half_mm**2 * ([1.0, 0.0] if shape is ContactShape.LINE else [1.0, 1.0])
    np.testing.assert_allclose(np.diag(moment), wanted, rtol=0.02, atol=1e-9)


def test_a_wide_region_has_nearly_the_area_of_its_pressure() -> None:
    area_mm2, _ = region_of(shape_points(ContactShape.PATCH, np.array([30.0, 20.0])), 1.0)
    assert area_mm2 == pytest.approx(np.pi * 30.0 * 20.0, rel=0.06)


def test_a_region_ends_at_a_rectangle() -> None:
    diamond = np.array([[3.0, 0.0], [0.0, 3.0], [-3.0, 0.0], [0.0, -3.0]])
    low_mm, high_mm = np.array([-4.0, -4.0]), np.array([1.0, 4.0])
    inside = within_rectangle(diamond, low_mm, high_mm)
    assert polygon_area(inside) == pytest.approx(18.0 - 4.0)
    assert inside[:, 0].max() == pytest.approx(1.0)
    np.testing.assert_array_equal(within_rectangle(diamond, low_mm, np.array([4.0, 4.0])), diamond)
    assert len(within_rectangle(diamond, np.array([5.0, 5.0]), np.array([6.0, 6.0]))) == 0
