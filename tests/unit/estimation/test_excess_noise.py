"""Noise of marker images that their detection does not know of."""

import numpy as np
import pytest

from manytouch.estimation.excess_noise import ExcessNoise, unexplained_variances
from manytouch.geometry.neighbours import nearest_neighbours

COLUMNS, ROWS = 14, 10
STD_PX = 0.01
PLACE = np.stack(np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)), axis=-1).reshape(-1, 2) * 30.0
COUNT = len(PLACE)
ALL = np.ones(COUNT, dtype=np.bool_)
NEIGHBOURS = nearest_neighbours(PLACE)
NOISE = ExcessNoise()


@pytest.mark.parametrize("std_px", [0.03, 0.1])
def test_residuals_that_differ_among_neighbours_by_more_than_expected_show_the_excess(std_px: float) -> None:
    random, excess_px2 = np.random.default_rng(3), 0.0
    for _ in range(5):
        residual_px = random.normal(0.0, np.hypot(std_px, STD_PX), PLACE.shape)
        assumed_px2 = np.full(COUNT, STD_PX**2 + excess_px2)
        excess_px2 = NOISE.after_fit(excess_px2, residual_px, assumed_px2, ALL, NEIGHBOURS)
    assert excess_px2**0.5 == pytest.approx(std_px, rel=0.15)
    calm_px2 = NOISE.after_fit(excess_px2, np.zeros(PLACE.shape), assumed_px2, ALL, NEIGHBOURS)
    assert calm_px2 == pytest.approx((1.0 - NOISE.share) * excess_px2, rel=0.1)
    untouched_px2 = NOISE.after_fit(
        excess_px2, np.zeros(PLACE.shape), assumed_px2, ALL, NEIGHBOURS, is_touched=False
    )
    assert untouched_px2 == pytest.approx((1.0 - NOISE.untouched_share) * excess_px2, rel=0.1)


def test_residuals_that_near_markers_have_in_common_or_that_few_have_show_none() -> None:
    random = np.random.default_rng(4)
    own_px = random.normal(0.0, 0.8 * STD_PX, PLACE.shape)
    smooth_px = 0.1 * np.sin(PLACE / 200.0)
    few_px = np.zeros(PLACE.shape)
    few_px[:6] = random.normal(0.0, 1.0, (6, 2))
    assumed_px2 = np.full(COUNT, STD_PX**2)
    for more_px in (0.0, smooth_px, few_px):
        assert NOISE.after_fit(0.0, own_px + more_px, assumed_px2, ALL, NEIGHBOURS) == 0.0
    unused = ALL.copy()
    unused[::3] = False
    wild_px = np.where(unused[:, None], own_px, np.nan_to_num(1e3 * own_px))
    assert NOISE.after_fit(0.0, wild_px, assumed_px2, unused, NEIGHBOURS) == 0.0


def test_a_frame_without_residuals_changes_nothing() -> None:
    unknown_px = np.full(PLACE.shape, np.nan)
    assert NOISE.after_fit(0.04, unknown_px, np.full(COUNT, STD_PX**2), ~ALL, NEIGHBOURS) == 0.04


def test_estimates_of_both_axes_follow_from_the_mean_of_the_neighbours() -> None:
    random = np.random.default_rng(6)
    residual_px = random.normal(0.0, [0.01, 0.05], PLACE.shape)
    variance_px2, is_used = random.uniform(1e-4, 2e-4, COUNT), random.random(COUNT) < 0.8
    more_px2 = np.empty(2 * COUNT)
    count = unexplained_variances(residual_px, variance_px2, is_used, NEIGHBOURS.index, more_px2)
    expected_px2 = []
    for marker in np.flatnonzero(is_used):
        near = [each for each in NEIGHBOURS.index[marker] if is_used[each]]
        mean_px = residual_px[near].mean(axis=0) if near else np.zeros(2)
        share = max(len(near), 1) / (max(len(near), 1) + 1.0)
        expected_px2.append((residual_px[marker] - mean_px) ** 2 * share / 0.4549 - variance_px2[marker])
    np.testing.assert_allclose(more_px2[:count], np.concatenate(expected_px2), rtol=1e-9, atol=1e-15)
