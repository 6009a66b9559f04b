"""The weighted quantile by which motions are judged."""

import numpy as np
import pytest

from manytouch.estimation.perimeter.view_kernels import reach


@pytest.mark.parametrize("seed", range(20))
def test_the_reach_is_the_quantile_of_the_sorted_residuals(seed: int):
    chance = np.random.default_rng(seed)
    residual = np.round(chance.exponential(size=int(chance.integers(1, 90))), 1)  # with ties
    weight = chance.integers(0, 5, len(residual)).astype(np.float64)
    weight[0] = 1.0
    goal = chance.uniform(0.05, 0.999) * weight.sum()
    order = np.argsort(residual, kind="stable")
    expected = residual[order][np.argmax(np.cumsum(weight[order]) >= goal)]
    assert reach(residual.copy(), weight.copy(), goal) == expected
