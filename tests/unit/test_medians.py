"""The median of a row of numbers."""

import numpy as np
import pytest

from manytouch.medians import median


@pytest.mark.parametrize("count", [1, 2, 3, 4, 201, 600])
def test_the_median_is_that_of_numpy(count: int) -> None:
    values = np.random.default_rng(count).normal(size=2 * count)[::2]
    before = values.copy()
    assert median(values) == np.median(values)
    np.testing.assert_array_equal(values, before)


def test_no_values_have_no_median() -> None:
    assert np.isnan(median(np.zeros(0)))
