"""Watershed: peaks and regions against a plain implementation, and their invariances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manytouch.estimation.watershed import watershed


def plain_watershed(height: np.ndarray, floor: float, merge: float) -> tuple[np.ndarray, list[int]]:
    """The same by sets of points."""
    rows, columns = height.shape
    flat = height.ravel()
    region: dict[int, int] = {}
    peaks: list[int] = []
    for i in sorted(np.flatnonzero(flat > floor).tolist(), key=lambda place: -flat[place]):
        row, column = divmod(i, columns)
        near = [
            a * columns + b
            for a in range(max(row - 1, 0), min(row + 2, rows))
            for b in range(max(column - 1, 0), min(column + 2, columns))
            if a * columns + b in region
        ]
        for one in sorted({region[place] for place in near}, key=peaks.index)[1:]:
            first = min((region[place] for place in near), key=peaks.index)
            if flat[i] > merge * flat[one]:
                region = {place: first if peak == one else peak for place, peak in region.items()}
        if near:
            region[i] = region[max(near, key=lambda place: flat[place])]
        else:
            region[i] = i
            peaks.append(i)
    kept = [peak for peak in peaks if peak in set(region.values())]
    label = np.full(rows * columns, -1)
    for place, peak in region.items():
        label[place] = kept.index(peak)
    return label.reshape(height.shape), kept


def smooth_map(seed: int, shape: tuple[int, int] = (13, 17)) -> np.ndarray:
    random = np.random.default_rng(seed)
    y, x = np.mgrid[: shape[0], : shape[1]]
    bumps = [
        random.uniform(0.3, 1.0)
        * np.exp(-((x - random.uniform(0, 17)) ** 2 + (y - random.uniform(0, 13)) ** 2) / 6.0)
        for _ in range(7)
    ]
    return np.sum(bumps, axis=0) + random.normal(0.0, 1e-3, shape)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), merge=st.sampled_from([0.0, 0.5, 0.75, 0.95]))
def test_labels_and_peaks_are_those_of_the_plain_implementation(seed: int, merge: float) -> None:
    height = smooth_map(seed)
    label, peak = watershed(height, 0.1, merge)
    expected, peaks = plain_watershed(height, 0.1, merge)
    np.testing.assert_array_equal(label, expected)
    assert peak.tolist() == peaks


@pytest.mark.parametrize("flip", [np.flipud, np.fliplr])
def test_a_mirrored_map_has_mirrored_regions(flip) -> None:
    height = smooth_map(3)
    label, _ = watershed(height, 0.1, 0.75)
    mirrored, _ = watershed(np.ascontiguousarray(flip(height)), 0.1, 0.75)
    np.testing.assert_array_equal(mirrored, flip(label))


def test_points_that_are_not_above_the_floor_belong_to_no_region() -> None:
    height = smooth_map(5)
    height[2, 3] = np.nan
    label, _ = watershed(height, 0.2, 0.75)
    np.testing.assert_array_equal(label >= 0, height > 0.2)
