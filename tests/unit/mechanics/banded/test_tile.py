"""The product of a tile as SIMD instructions against its scalar twin and numpy."""

import numpy as np
import pytest
from numba import njit

from manytouch.mechanics.banded.tile import COLUMNS, ROWS, At, add_product, add_product_scalar

C_AT, A_AT, B_AT = At(3, 40), At(1, 9), At(2, 35)


@njit
def product(c: np.ndarray, a: np.ndarray, b: np.ndarray, count: int) -> None:
    add_product(c, C_AT, a, A_AT, b, B_AT, count)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 7])
def test_a_product_is_added_to_a_tile(precision: type, count: int) -> None:
    rng = np.random.default_rng(0)
    c, a, b = (
        rng.normal(size=size).astype(precision) for size in (8 * 40 + 3, 9 * count + 1, 35 * count + 2)
    )
    expected, scalar = c.copy(), c.copy()
    left, right = a[1:].reshape(count, 9)[:, :ROWS], b[2:].reshape(count, 35)[:, :COLUMNS]
    expected[3:].reshape(ROWS, 40)[:, :COLUMNS] += left.T @ right
    add_product_scalar(scalar, C_AT, a, A_AT, b, B_AT, count)
    product(c, a, b, count)
    within = 20 * np.finfo(precision).eps
    np.testing.assert_allclose(scalar, expected, atol=within)
    np.testing.assert_allclose(c, expected, atol=within)
