"""Fits of plain dots from 64 samples agree with plain numpy."""

import numpy as np
import pytest

from manytouch.detection.measurement.background_fit_simd import fit_all, middle_quantile, use_between
from manytouch.detection.measurement.records import Samples
from manytouch.detection.measurement.sampling_pattern import FAR, LANES


def samples_of(seed: int, count: int) -> Samples:
    rng = np.random.default_rng(seed)
    dx, dy = rng.integers(-9, 10, (2, LANES)).astype(np.float32)
    value = (120.0 + 0.8 * dx + 0.3 * dy + rng.normal(0.0, 3.0, LANES)).astype(np.float32)
    return Samples(dx, dy, value, (np.arange(LANES) < count).astype(np.float32))


@pytest.mark.parametrize("count", [LANES, 20])
def test_the_plane_of_all_is_that_of_least_squares(count: int) -> None:
    samples = samples_of(count, count)
    matrix = np.column_stack([np.ones(count), samples.dx[:count], samples.dy[:count]]).astype(float)
    value = samples.value[:count].astype(float)
    expected, squares, _, _ = np.linalg.lstsq(matrix, value, rcond=None)
    plane = fit_all(samples)
    np.testing.assert_allclose(plane[:3], expected, rtol=1e-4, atol=1e-3)
    assert plane.variance == pytest.approx(float(squares[0]) / (count - 3), rel=1e-3)


def test_samples_are_used_by_their_distance_from_the_centre() -> None:
    samples = samples_of(1, LANES)
    samples.dx[50:] = FAR
    part, radii = (0.4, -0.3), (3.0, 7.5)
    distance = np.hypot(samples.dx - part[0], samples.dy - part[1])
    expected = (distance >= radii[0]) & (distance <= radii[1])
    assert use_between(samples, part, radii) == expected.sum() > 10
    np.testing.assert_array_equal(samples.used, expected)


@pytest.mark.parametrize("quantile", [0.4, 0.55])
@pytest.mark.parametrize("count", [LANES, 21])
@pytest.mark.parametrize("seed", range(3))
def test_the_quantile_is_near_the_sorted_one(seed: int, count: int, quantile: float) -> None:
    samples = samples_of(seed, count)
    ordered = np.sort(samples.value[:count])
    rank = min(count - 1, int(quantile * count))
    # eight halvings of a range of four deviations leave an interval of 1/64 deviation and its neighbours
    assert ordered[max(rank - 1, 0)] - 0.1 <= middle_quantile(samples, quantile, 8) <= ordered[rank + 1] + 0.1
