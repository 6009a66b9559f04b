"""Selected dots agree with plain numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manytouch.detection.measurement.records import AREA, COLUMNS, CONTRAST, CUT, CXX, CXY, CYY, EDGE, X, Y
from manytouch.detection.selection import (
    BIN_WIDTH,
    SelectedDots,
    SelectionLimits,
    find_single_dots,
    select_dots,
    typical_contrast,
)


def is_single(place: np.ndarray, radius: np.ndarray, weight: np.ndarray, share: float) -> np.ndarray:
    """Mask of the dots without a heavier one near them; of equal ones the first is kept."""
    distance = np.linalg.norm(place[:, None] - place[None], axis=2)
    near = distance < share * np.maximum(radius[:, None], radius[None])
    index = np.arange(len(place))
    is_first = (weight[:, None] == weight[None]) & (index[:, None] < index[None])
    return ~(near & ((weight[:, None] > weight[None]) | is_first)).any(axis=0)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), number=st.integers(0, 60))
def test_of_near_dots_the_heaviest_stays(seed: int, number: int) -> None:
    rng = np.random.default_rng(seed)
    place, radius = rng.uniform(0.0, 40.0, (number, 2)), rng.uniform(1.0, 6.0, number)
    weight = rng.integers(1, 5, number).astype(float)
    keep = find_single_dots(place, radius, weight, 0.8)
    np.testing.assert_array_equal(keep, is_single(place, radius, weight, 0.8))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), number=st.integers(1, 80), markers=st.integers(0, 100))
def test_the_typical_contrast_is_the_median_of_the_strongest(seed: int, number: int, markers: int) -> None:
    rng = np.random.default_rng(seed)
    contrast = rng.uniform(1.0, 250.0, number)
    strongest = np.sort(contrast)[::-1][: max(markers, 1)]
    given_contrast = np.append(contrast, [np.nan, -4.0])
    expected = strongest[(len(strongest) - 1) // 2]
    assert abs(typical_contrast(given_contrast, markers) - expected) <= 0.5 * BIN_WIDTH + 1e-9


def test_without_dots_there_is_no_typical_contrast() -> None:
    assert typical_contrast(np.array([np.nan, -1.0]), 5) == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_selected_dots_are_within_the_limits(seed: int) -> None:
    rng, number = np.random.default_rng(seed), 80
    rows, radius = np.empty((number, COLUMNS)), rng.uniform(3.0, 6.0, number)
    rows[:, [X, Y]] = rng.uniform(0.0, 60.0, (number, 2))
    rows[:, CONTRAST] = rng.uniform(1.0, 120.0, number)
    rows[:, AREA] = np.pi * radius**2 * rng.choice([0.03, 0.5, 1.0, 2.0, 4.0], number)
    rows[:, CUT] = rng.choice([0.0, 0.3, 0.7], number)
    rows[:, [CXX, CYY]] = radius[:, None] ** 2 * rng.uniform(0.0, 0.4, (number, 2))
    rows[:, [CXY, EDGE]] = rng.uniform(0.0, 1.0, (number, 2))
    rows[::9] = np.nan
    limits, corner = SelectionLimits(40, 0.3, 60.0), np.array([100.0, -50.0])
    with np.errstate(invalid="ignore"):
        keep = rows[:, CONTRAST] > 0.3 * typical_contrast(rows[:, CONTRAST], 40)
        keep &= rows[:, CONTRAST] * np.sqrt(rows[:, AREA]) > 60.0
        share = rows[:, AREA] / (np.pi * radius**2)
        keep &= (share > limits.least_area_ratio) & (share < limits.most_area_ratio)
        keep &= rows[:, CUT] < limits.most_cut_share
        keep &= rows[:, CXX] + rows[:, CYY] < limits.most_variance_ratio * radius**2
    kept = np.flatnonzero(keep)
    weight = rows[kept, AREA] * rows[kept, CONTRAST]
    kept = kept[is_single(rows[kept][:, [X, Y]], radius[kept], weight, limits.double_distance_ratio)]
    selected = SelectedDots(np.empty((number, 2)), np.empty((number, 2, 2)), *np.empty((3, number)))
    assert select_dots(rows, radius, limits, corner, selected) == len(kept) > 5
    np.testing.assert_array_equal(selected.centre[: len(kept)], rows[kept][:, [X, Y]] + corner)
    matrix = rows[kept][:, [CXX, CXY, CXY, CYY]].reshape(-1, 2, 2)
    np.testing.assert_array_equal(selected.covariance[: len(kept)], matrix)
    for values, column in ((selected.area, AREA), (selected.contrast, CONTRAST), (selected.edge, EDGE)):
        np.testing.assert_array_equal(values[: len(kept)], rows[kept, column])
