"""Measurements at chosen points."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.geometry.sampling import sampling_at
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.viewer.measuring import PROFILE_POINTS, measure_at
from manytouch.sinks.viewer.update_encoder import viewer_grid
from manytouch.values import Layout, SheetSpline, Surface

POINT_MM = np.array([[-20.0, 8.0], [25.0, -6.0]])


@pytest.fixture
def layout() -> Layout:
    found = demo_sensor().layout
    assert found is not None
    return found


def surface_of(layout: Layout, depth_mm: np.ndarray, std_mm: float = 0.1) -> Surface:
    moved = np.zeros((len(depth_mm), 3))
    moved[:, 2] = -depth_mm
    covariance = np.tile(std_mm**2 * np.eye(3), (len(depth_mm), 1, 1))
    return Surface(
        position_mm=layout.rest_mm + moved, displacement_mm=moved, covariance_mm2=covariance, layout=layout
    )


def test_a_point_has_the_estimated_depth_and_deviation(layout: Layout) -> None:
    depth_mm = 3.0 * np.exp(-np.sum((layout.rest_mm[:, :2] - [-20.0, 8.0]) ** 2, axis=1) / 200.0)
    found = measure_at(layout, POINT_MM[:1])(surface_of(layout, depth_mm))
    (point,) = found["points"]
    own = sampling_at(layout, POINT_MM[:1])(depth_mm)[0]
    assert point["depth_mm"] == pytest.approx(own, abs=1e-3)
    assert 2.9 < point["depth_mm"] < 3.05
    assert 0.05 < point["std_mm"] <= 0.1
    assert "profile" not in found


@pytest.mark.parametrize("has_spline", [True, False])
def test_a_measured_point_has_the_depth_that_is_drawn(layout: Layout, has_spline: bool) -> None:
    patch = SplinePatch(size_mm=(120.0, 80.0), elements=(30, 20))
    coefficient_mm = np.zeros((patch.node_count, 3))
    coefficient_mm[np.argmin(np.hypot(*(patch.place_mm - (2.0, 2.0)).T)), 2] = -3.0
    spline = SheetSpline(
        size_mm=patch.size_mm,
        centre_mm=patch.centre_mm,
        elements=patch.elements,
        is_clamped=True,
        thickness_mm=3.0,
        poisson=0.45,
        coefficient_mm=coefficient_mm,
        force_over_E_mm2=np.zeros_like(coefficient_mm),
        young_MPa=None,
    )
    noise_mm = np.random.default_rng(3).normal(0.0, 0.1, len(layout.rest_mm))
    surface = replace(surface_of(layout, 1.0 + noise_mm), spline=spline if has_spline else None)
    grid = viewer_grid(layout)
    drawn_mm = grid.sampler.depth(surface).astype("<f4")
    for row, column in ((31, 52), (7, 90), (0, 0)):
        measured = measure_at(layout, np.array([[grid.x_mm[column], grid.y_mm[row]]]))(surface)
        assert measured["points"][0]["depth_mm"] == pytest.approx(drawn_mm[row, column], abs=1e-6)


def test_two_points_have_a_distance_in_space(layout: Layout) -> None:
    slope = 0.1
    depth_mm = 2.0 + slope * layout.rest_mm[:, 0]
    found = measure_at(layout, POINT_MM)(surface_of(layout, depth_mm))
    flat_mm = float(np.hypot(45.0, 14.0))
    assert found["rest_distance_mm"] == pytest.approx(flat_mm, abs=1e-3)
    assert found["distance_mm"] == pytest.approx(np.hypot(flat_mm, 4.5), abs=1e-3)
    assert found["difference_mm"] == pytest.approx(4.5, abs=1e-3)
    assert 0.05 < found["distance_std_mm"] < 0.15
    profile = found["profile"]
    assert len(profile["depth_mm"]) == len(profile["std_mm"]) == PROFILE_POINTS
    np.testing.assert_allclose(profile["depth_mm"], np.linspace(0.0, 4.5, PROFILE_POINTS), atol=1e-3)


def test_what_is_not_known_is_none(layout: Layout) -> None:
    nothing = np.full(len(layout.rest_mm), np.nan)
    found = measure_at(layout, POINT_MM)(surface_of(layout, nothing))
    assert [point["depth_mm"] for point in found["points"]] == [None, None]
    assert found["distance_mm"] is None
    outside = measure_at(layout, np.array([[900.0, 0.0]]))(surface_of(layout, np.ones(len(nothing))))
    assert outside["points"][0]["depth_mm"] is None


def test_a_point_chosen_twice_has_no_distance(layout: Layout) -> None:
    found = measure_at(layout, POINT_MM[[0, 0]])(surface_of(layout, np.ones(len(layout.rest_mm))))
    assert found["distance_mm"] == 0.0
