"""The surface in one call against its steps one after another."""

import numpy as np
import pytest

from manytouch.estimation.perimeter.interpolation_kernels import interpolate_unseen
from manytouch.estimation.perimeter.law_kernels import surface_at_markers
from manytouch.estimation.perimeter.marker_surface import MIN_MARKERS, MarkerSurface
from manytouch.estimation.perimeter.surface_inputs import InterpolationRule
from manytouch.estimation.perimeter.surface_kernels import surface_of_markers
from manytouch.estimation.perimeter.view_kernels import estimate_motion, median_std
from manytouch.geometry.camera import project
from manytouch.geometry.plane_kernels import displacements_in_plane
from manytouch.geometry.plane_table import PlaneNodes
from manytouch.simulation.demo_sensor import demo_sensor

SENSOR = demo_sensor(854)
assert SENSOR.layout is not None
REST_MM = SENSOR.layout.rest_mm
GIVEN = MarkerSurface().start(SENSOR).inputs


def images(seen_share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, covariances and which markers are seen, of a sheet that is pressed and moved."""
    random = np.random.default_rng(7)
    hollow = np.exp(-((REST_MM[:, :2] - [9.0, -4.0]) ** 2).sum(axis=1) / 60.0)
    moved_mm = REST_MM - [0.0, 0.0, 2.0] * hollow[:, None]
    pixel = project(SENSOR.camera, moved_mm) + random.normal([0.7, -0.4], 0.03, (len(REST_MM), 2))
    covariance = np.tile(0.03**2 * np.eye(2), (len(pixel), 1, 1))
    is_seen = random.random(len(pixel)) < seen_share
    pixel[~is_seen], covariance[~is_seen] = np.nan, np.nan
    return pixel, covariance, is_seen


@pytest.mark.parametrize("seen_share", [0.9, 1.0])
def test_the_surface_is_that_of_its_steps(seen_share: float) -> None:
    pixel, covariance_px2, is_seen = images(seen_share)
    position, displacement, covariance, in_plane, std = surface_of_markers(
        pixel, covariance_px2, is_seen, tuple(GIVEN)
    )
    rest_mm = GIVEN.rays[0]
    moved, spread = displacements_in_plane(
        pixel, covariance_px2, PlaneNodes(*GIVEN.nodes), rest_mm, GIVEN.plane_from_px
    )
    moved, spread = interpolate_unseen(moved, spread, is_seen, InterpolationRule(*GIVEN.interpolation))
    assert std == median_std(spread, is_seen)
    view = estimate_motion(rest_mm, moved, is_seen, std, GIVEN.search)
    expected, expected_mm2 = surface_at_markers(moved, view, GIVEN.rays, GIVEN.cells, spread, GIVEN.errors)
    np.testing.assert_allclose(in_plane, moved, atol=1e-12)
    np.testing.assert_allclose(displacement, expected, atol=1e-10)
    np.testing.assert_allclose(covariance, expected_mm2, atol=1e-10)
    np.testing.assert_array_equal(position, REST_MM + displacement)
    assert displacement[:, 2].min() < -1.0


def test_too_few_markers_make_no_surface() -> None:
    pixel, covariance_px2, is_seen = images(1.0)
    is_seen[MIN_MARKERS - 1 :] = False
    *arrays, std = surface_of_markers(pixel, covariance_px2, is_seen, tuple(GIVEN))
    assert [len(each) for each in arrays] == [0, 0, 0, 0]
    assert np.isnan(std)
