"""Compiled loops over the regions of peaks against plain numpy."""

import numpy as np
import pytest

from manytouch.estimation.load.peak_kernels import deepest_points, shapes_of_peaks
from manytouch.estimation.watershed import watershed

X, Y = np.linspace(-3.0, 5.0, 33), np.linspace(1.0, 4.0, 21)


def three_peaks(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A map with peaks, the peak of each point, and the heights of the peaks."""
    random = np.random.default_rng(seed)
    load = random.normal(0.0, 1e-3, (len(Y), len(X)))
    for x, y, height in ((-2.0, 2.0, 1.0), (1.2, 3.4, 0.8), (4.0, 1.6, 0.6)):
        load += height * np.exp(-((X - x) ** 2 + (Y[:, None] - y) ** 2) / 0.5)
    label, peak = watershed(load, 0.1, 0.5)
    return load, label, load.ravel()[peak]


@pytest.mark.parametrize("seed", range(3))
def test_centres_areas_and_regions(seed: int) -> None:
    load, label, height = three_peaks(seed)
    assert len(height) >= 3
    stays = np.arange(len(height)) != 1
    centre, area, region = shapes_of_peaks(load, label, height, stays, X, Y, 0.7)
    x, y = np.meshgrid(X, Y)
    for number, peak in enumerate(np.flatnonzero(stays)):
        share = np.where(label == peak, load / height[peak], 0.0)
        weight = np.where(share > 0.7, load, 0.0)
        expected = (weight * x).sum() / weight.sum(), (weight * y).sum() / weight.sum()
        np.testing.assert_allclose(centre[number], expected, rtol=1e-12)
        np.testing.assert_array_equal(region == number, share > 0.5)
        assert area[number] == pytest.approx((share > 0.5).sum() * 0.25 * 0.15)


def test_the_deepest_point_of_each_region() -> None:
    load, label, _ = three_peaks(4)
    depth = np.random.default_rng(4).normal(size=load.shape)
    depth[label == 0] = np.nan
    depth[np.unravel_index(np.flatnonzero(label == 1)[:5], label.shape)] = np.nan
    count = int(label.max()) + 1
    height = np.where(np.isfinite(depth), depth, -np.inf)
    for peak, (row, column) in enumerate(deepest_points(depth, label, count)):
        region = np.flatnonzero(label == peak)
        assert row * len(X) + column == region[np.argmax(height.ravel()[region])]
