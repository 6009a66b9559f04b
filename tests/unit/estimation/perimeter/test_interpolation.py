"""Displacements of unseen markers, interpolated from their neighbours."""

import numpy as np

from manytouch.estimation.perimeter.interpolation import MarkerInterpolation
from manytouch.estimation.perimeter.interpolation_kernels import interpolate_unseen
from manytouch.geometry.neighbours import nearest_neighbours

PITCH, ROWS, COLUMNS = 1.3, 11, 15
PLACE = PITCH * np.stack(np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)), axis=-1).reshape(-1, 2)
NEAR = nearest_neighbours(PLACE)
MIDDLE = (ROWS // 2) * COLUMNS + COLUMNS // 2
HOLE = np.abs(PLACE - PLACE[MIDDLE]).max(axis=1) < 2.5 * PITCH


def interpolate(displacement_mm: np.ndarray, is_seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    covariance_mm2 = np.tile(1e-4 * np.eye(2), (len(PLACE), 1, 1))
    covariance_mm2[~is_seen] = np.nan
    given_mm = np.where(is_seen[:, None], displacement_mm, np.nan)
    return interpolate_unseen(given_mm, covariance_mm2, is_seen, MarkerInterpolation().rule(NEAR, PITCH))


def test_a_hole_is_filled_from_its_rim_with_growing_deviation() -> None:
    displacement_mm = 0.02 * PLACE @ np.array([[1.0, 0.4], [-0.3, 1.0]])
    found_mm, covariance_mm2 = interpolate(displacement_mm, ~HOLE)
    np.testing.assert_array_equal(found_mm[~HOLE], displacement_mm[~HOLE])
    std_mm = np.sqrt(covariance_mm2[:, 0, 0])
    off_mm = np.abs(found_mm - displacement_mm).max(axis=1)
    assert off_mm[MIDDLE] < 1e-9  # as much on one side as on the other
    assert (off_mm[HOLE] < 3.0 * std_mm[HOLE]).all()
    assert std_mm[MIDDLE] > std_mm[MIDDLE - 2] > 0.02 * PITCH > std_mm[0]
    assert (np.linalg.eigvalsh(covariance_mm2) > 0.0).all()


def test_without_seen_markers_the_deviation_is_a_pitch() -> None:
    found_mm, covariance_mm2 = interpolate(np.ones_like(PLACE), np.zeros(len(PLACE), dtype=bool))
    assert (found_mm == 0.0).all()
    np.testing.assert_allclose(covariance_mm2, np.tile(PITCH**2 * np.eye(2), (len(PLACE), 1, 1)))


def test_one_hidden_marker_gets_the_weighted_mean_of_its_neighbours() -> None:
    displacement_mm = np.random.default_rng(3).normal(0.0, 0.1, PLACE.shape)
    is_seen = np.arange(len(PLACE)) != MIDDLE
    found_mm, _ = interpolate(displacement_mm, is_seen)
    weight = NEAR.distance[MIDDLE] ** -2.0
    expected_mm = weight @ displacement_mm[NEAR.index[MIDDLE]] / weight.sum()
    np.testing.assert_allclose(found_mm[MIDDLE], expected_mm, atol=1e-12)
