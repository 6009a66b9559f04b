"""The compiled search for the motion of the view against plain numpy."""

import numpy as np
import pytest

from manytouch.estimation.perimeter.surface_inputs import MotionSearch
from manytouch.estimation.perimeter.view_kernels import (
    border_weights,
    estimate_motion,
    median_std,
    propose_motion,
    weighted_quantile,
)


def plain_quantile(residual: np.ndarray, weight: np.ndarray, goal: float) -> float:
    order = np.argsort(residual, kind="stable")
    return float(residual[order][np.argmax(np.cumsum(weight[order]) >= goal)])


def residuals(rest: np.ndarray, displacement: np.ndarray, motion: np.ndarray) -> np.ndarray:
    turn = motion[2] * np.column_stack([-rest[:, 1], rest[:, 0]])
    return ((displacement - motion[:2] - turn) ** 2).sum(axis=1)


def plain_proposal(
    rest: np.ndarray, displacement: np.ndarray, is_seen: np.ndarray, search: MotionSearch
) -> np.ndarray:
    candidates = []
    for a, b in search.pairs:
        span, change = rest[b] - rest[a], displacement[b] - displacement[a]
        if is_seen[a] and is_seen[b] and span.any():
            angle = (change[1] * span[0] - change[0] * span[1]) / (span @ span)
            middle = 0.5 * (rest[a] + rest[b])
            shift = 0.5 * (displacement[a] + displacement[b]) - angle * np.array([-middle[1], middle[0]])
            candidates.append([*shift, angle])
    seen = np.flatnonzero(is_seen)
    voter = seen[:: max(1, len(seen) // search.voters)]
    candidates.append([*np.median(displacement[voter], axis=0), 0.0])
    weight = search.weight[voter]
    scores = [
        plain_quantile(
            residuals(rest[voter], displacement[voter], np.array(each)), weight, search.share * weight.sum()
        )
        for each in candidates
    ]
    return np.array(candidates[int(np.argmin(scores))])


def plain_refinement(
    scene: tuple[np.ndarray, np.ndarray, np.ndarray, MotionSearch], std: float, motion: np.ndarray
) -> np.ndarray:
    rest, displacement, is_seen, search = scene
    rest, displacement, weight = rest[is_seen], displacement[is_seen], search.weight[is_seen]
    step = max(1, len(rest) // search.voters)
    design = np.zeros((len(rest), 2, 3))
    design[:, :, :2] = np.eye(2)
    design[:, 0, 2], design[:, 1, 2] = -rest[:, 1], rest[:, 0]
    for _ in range(search.rounds):
        square = residuals(rest, displacement, motion)
        goal = search.share * weight[::step].sum()
        gate = 3.0 * max(np.sqrt(plain_quantile(square[::step], weight[::step], goal)), std)
        root = np.sqrt(weight) * np.maximum(1.0 - square / gate**2, 0.0)
        left = (root[:, None, None] * design).reshape(-1, 3)
        motion = np.linalg.lstsq(left, (root[:, None] * displacement).ravel(), rcond=None)[0]
    return motion


def make_scene(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, MotionSearch]:
    random = np.random.default_rng(seed)
    rest = random.uniform(-30.0, 30.0, (int(random.integers(30, 200)), 2))
    displacement = [0.8, -0.3] + 0.02 * np.column_stack([-rest[:, 1], rest[:, 0]])
    displacement = displacement + random.normal(0.0, 0.02, rest.shape)
    displacement += np.exp(-((rest - [5.0, -3.0]) ** 2).sum(axis=1) / 60.0)[:, None] * [1.0, -2.0]
    is_seen = random.random(len(rest)) > 0.1
    search = MotionSearch(
        random.integers(len(rest), size=(20, 2)), border_weights(rest, 2.0), share=0.35, voters=60, rounds=4
    )
    return rest, displacement, is_seen, search


@pytest.mark.parametrize("seed", range(20))
def test_the_result_is_the_quantile_of_the_sorted_residuals(seed: int) -> None:
    random = np.random.default_rng(seed)
    residual = np.round(random.exponential(size=int(random.integers(1, 90))), 1)  # with ties
    weight = random.integers(0, 5, len(residual)).astype(np.float64)
    weight[0] = 1.0
    goal = random.uniform(0.05, 0.999) * weight.sum()
    assert weighted_quantile(residual.copy(), weight.copy(), goal) == plain_quantile(residual, weight, goal)


@pytest.mark.parametrize("seed", range(5))
def test_the_motion_is_that_of_plain_least_squares(seed: int) -> None:
    scene = make_scene(seed)
    rest, displacement, is_seen, search = scene
    proposal = plain_proposal(rest, displacement, is_seen, search)
    np.testing.assert_allclose(propose_motion(rest, displacement, is_seen, search), proposal, atol=1e-9)
    expected = plain_refinement(scene, 0.01, proposal)
    np.testing.assert_allclose(
        estimate_motion(rest, displacement, is_seen, 0.01, search), expected, atol=1e-9
    )


def test_weights_rise_towards_the_border() -> None:
    rest = np.random.default_rng(3).uniform(-5.0, 7.0, (50, 2))
    low, high = rest.min(axis=0), rest.max(axis=0)
    radius = np.abs(2.0 * (rest - low) / (high - low) - 1.0).max(axis=1)
    np.testing.assert_allclose(border_weights(rest, 3.0), 1.0 + 2.0 * radius**2)


def test_the_median_deviation_is_that_of_the_seen_markers() -> None:
    random = np.random.default_rng(4)
    covariance = random.uniform(0.1, 1.0, (60, 1, 1)) * np.eye(2)
    is_seen = random.random(60) > 0.3
    expected = np.sqrt(np.median(covariance[is_seen, 0, 0]))
    assert median_std(covariance, is_seen) == pytest.approx(expected)
