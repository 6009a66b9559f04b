"""The weighted quantile by which motions are compared."""

import numpy as np
import pytest

from manytouch.estimation.perimeter.view_kernels import weighted_quantile


@pytest.mark.parametrize("seed", range(20))
def test_the_result_is_the_quantile_of_the_sorted_residuals(seed: int):
    random = np.random.default_rng(seed)
    residual = np.round(random.exponential(size=int(random.integers(1, 90))), 1)  # with ties
    weight = random.integers(0, 5, len(residual)).astype(np.float64)
    weight[0] = 1.0
    goal = random.uniform(0.05, 0.999) * weight.sum()
    order = np.argsort(residual, kind="stable")
    expected = residual[order][np.argmax(np.cumsum(weight[order]) >= goal)]
    assert weighted_quantile(residual.copy(), weight.copy(), goal) == expected
