"""Coverage, its moments and filled holes of a window agree with plain numpy and scipy."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_fill_holes

from manytouch.detection.measurement.general_dots import cover, coverage_moments, fill_holes
from manytouch.detection.measurement.records import BrightnessFit, Pixels

FIT = BrightnessFit(60.0, 0.4, -0.3, 90.0, 0.8, 0.5, 1.0, 1.0, 0.0, -1.0, 0.15)


def pixels_of(image: np.ndarray, weights: np.ndarray) -> Pixels:
    channels = len(weights)
    rows = image.reshape(image.shape[0], -1)
    return Pixels(rows, rows.ravel(), weights.astype(np.float32), image.shape[1], image.shape[0], channels)


@pytest.mark.parametrize("weights", [np.ones(1), np.array([0.2, 0.5, 0.3])])
def test_coverage_is_the_level_between_the_planes(weights: np.ndarray) -> None:
    shape = (30, 40) if len(weights) == 1 else (30, 40, 3)
    image = np.random.default_rng(3).integers(0, 256, shape).astype(np.uint8)
    coverage = np.empty((17, 21), dtype=np.float32)
    cover(pixels_of(image, weights), 15.3, 12.8, 5, 4, FIT, coverage)
    grey = image.astype(float) if len(weights) == 1 else image @ weights
    y, x = np.mgrid[4:21, 5:26]
    dx, dy = x - 15.3, y - 12.8
    below = FIT.background + FIT.background_x * dx + FIT.background_y * dy
    height = np.maximum(FIT.contrast + FIT.contrast_x * dx + FIT.contrast_y * dy, 0.5 * FIT.contrast)
    np.testing.assert_allclose(coverage, (grey[4:21, 5:26] - below) / height, atol=2e-5)


@pytest.mark.parametrize("low", [0.05, 0.15])
@pytest.mark.parametrize("seed", range(3))
def test_moments_are_sums_over_the_disc(seed: int, low: float) -> None:
    coverage = np.random.default_rng(seed).uniform(-0.2, 1.2, (23, 27)).astype(np.float32)
    x, y, reach2 = 13.4, 11.2, 90.0
    dy, dx = np.mgrid[:23, :27] - np.array([y, x])[:, None, None]
    weight = np.clip((coverage - low) / (1.0 - 2.0 * low), 0.0, 1.0) * (dx**2 + dy**2 <= reach2)
    edge = (weight > 0.0) & (weight < 1.0)
    parts = [weight, weight * dx, weight * dy]
    parts += [edge * part for part in (1.0, dx, dy, dx * dx, dx * dy, dy * dy)]
    found = coverage_moments(coverage, x, y, reach2, low)
    np.testing.assert_allclose(found, [part.sum() for part in parts], rtol=1e-4, atol=2e-2)


@pytest.mark.parametrize("high", [0.85, 0.95])
@pytest.mark.parametrize("seed", range(4))
def test_enclosed_pixels_are_filled(seed: int, high: float) -> None:
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:31, :31] - 15.0
    coverage = np.clip(11.0 - np.hypot(v, u) + rng.normal(0.0, 0.1, (31, 31)), 0.0, 1.0).astype(np.float32)
    hole = np.hypot(v - rng.uniform(-4, 4), u - rng.uniform(-4, 4)) < 3.0
    coverage[hole] = rng.uniform(0.0, 0.4, hole.sum())
    solid = binary_fill_holes(coverage >= 0.5)
    near_outside = binary_dilation(~solid, np.ones((3, 3)))
    inner = np.zeros_like(solid)
    inner[1:-1, 1:-1] = True
    changes = solid & inner & (coverage < high) & ((coverage < 0.5) | ~near_outside)
    expected = np.where(changes, 1.0, coverage)
    fill_holes(coverage, np.empty(coverage.size, dtype=np.int64), high)
    np.testing.assert_array_equal(coverage, expected.astype(np.float32))
