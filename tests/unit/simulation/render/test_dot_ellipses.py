"""Dots on the bent sheet: signs, and the ellipse against a finely drawn outline."""

import numpy as np
import pytest

from manytouch.geometry.camera import project
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.render.dot_ellipses import (
    CORNERS,
    EQUAL_SECOND_MOMENT_SCALE,
    dot_ellipses,
    outlines,
    polygon_ellipses,
)

SENSOR = demo_sensor()


def bent(point_mm: np.ndarray, lever_mm: float = 1.5) -> np.ndarray:
    """Displacement of a face lever_mm below a middle surface with a dent of 3 mm at (4, -6)."""
    off_mm = point_mm[:, :2] - [4.0, -6.0]
    depth_mm = 3.0 * np.exp(-(off_mm**2).sum(axis=1) / 128.0)
    return np.column_stack([lever_mm * off_mm / 64.0 * depth_mm[:, None], -depth_mm])


def test_the_polygon_has_the_discs_moments() -> None:
    angle = 2 * np.pi * np.arange(CORNERS) / CORNERS
    shape = np.array([[6.0, 1.5], [-0.5, 3.0]])
    corners = (
        np.array([100.0, 50.0])
        + EQUAL_SECOND_MOMENT_SCALE * np.column_stack([np.cos(angle), np.sin(angle)]) @ shape.T
    )
    centre_px, shape_px = polygon_ellipses(corners[None])
    assert centre_px[0] == pytest.approx([100, 50])
    assert shape_px[0] @ shape_px[0].T == pytest.approx(shape @ shape.T)


def test_area_counts_not_the_corners() -> None:
    """A triangle of legs 6 and 3 with five corners on one leg: centroid a third, moments b^2 / 18."""
    corners = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [6, 0], [0, 3]], dtype=float)
    centre_px, shape_px = polygon_ellipses(corners[None] + [40, 7])
    assert centre_px[0] == pytest.approx([42, 8])
    assert shape_px[0] @ shape_px[0].T == pytest.approx(4 * np.array([[2, -0.5], [-0.5, 0.5]]))
    backwards, _ = polygon_ellipses(corners[None, ::-1] + [40, 7])
    assert backwards == pytest.approx(centre_px)


def test_ellipses_are_the_dots_area_in_the_image() -> None:
    """Against outlines of 720 corners."""
    rest_mm = np.array([[8.0, -8.0, 0.0], [4.0, 2.0, 0.0], [-10.0, -20.0, 0.0], [58.0, 38.0, 0.0]])
    corner_mm = outlines(rest_mm, np.ones(4))
    corner_mm = corner_mm + bent(corner_mm)
    centre_px, shape_px = dot_ellipses(SENSOR.camera, corner_mm)
    angle = 2 * np.pi * np.arange(720) / 720
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(720)])
    for place in range(4):
        outline_mm = rest_mm[place] + circle
        outline_mm += bent(outline_mm)
        centre, shape = polygon_ellipses(project(SENSOR.camera, outline_mm)[None])
        assert centre_px[place] == pytest.approx(centre[0], abs=0.003)
        assert np.linalg.det(shape_px[place]) == pytest.approx(np.linalg.det(shape[0]), rel=2e-3)
    naive_px = project(SENSOR.camera, rest_mm + bent(rest_mm))
    assert np.abs(naive_px - centre_px)[:3].max() > 0.02  # why the area counts


def test_a_polygon_without_area_or_of_unknown_corners_has_no_ellipse() -> None:
    corner_px = np.random.default_rng(0).uniform(0.0, 9.0, (3, 4, 2))
    corner_px[0, :, 1] = 5.0
    corner_px[1, 2] = np.nan
    corner_px[2] = [[0, 0], [2, 0], [2, 2], [0, 2]]
    centre_px, shape_px = polygon_ellipses(corner_px)
    np.testing.assert_array_equal(np.isnan(centre_px).any(axis=1), [True, True, False])
    np.testing.assert_array_equal(np.isnan(shape_px).any(axis=(1, 2)), [True, True, False])
