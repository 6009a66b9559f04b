"""The tile product, and Cholesky in a band, against numpy."""

import numpy as np
import pytest
from numba import njit

from manytouch.mechanics.solver.band import BandFactor, empty_band, factorise
from manytouch.mechanics.solver.tile import add_product, add_product_16


@njit
def wide(c: np.ndarray, a: np.ndarray, b: np.ndarray, count: int) -> None:
    add_product(c, 3, 40, a, 1, 9, b, 2, 35, count)


@njit
def narrow(c: np.ndarray, a: np.ndarray, b: np.ndarray, count: int) -> None:
    add_product_16(c, 3, 40, a, 1, 9, b, 2, 35, count)


@pytest.mark.parametrize(("product", "columns"), [(wide, 32), (narrow, 16)])
@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 7])
def test_a_tile_gets_a_product(product, columns: int, precision: type, count: int) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(0)
    c, a, b = (
        rng.normal(size=size).astype(precision) for size in (8 * 40 + 3, 9 * count + 1, 35 * count + 2)
    )
    expected = c.copy()
    left, right = a[1:].reshape(count, 9)[:, :8], b[2:].reshape(count, 35)[:, :columns]
    expected[3:].reshape(8, 40)[:, :columns] += left.T @ right
    product(c, a, b, count)
    np.testing.assert_allclose(c, expected, atol=20 * np.finfo(precision).eps)


def banded(unknowns: int, width: int, precision: type) -> tuple[np.ndarray, np.ndarray, int]:
    """A positive definite matrix, the same as a flat band, and where that begins."""
    rng = np.random.default_rng(unknowns)
    root = np.triu(np.tril(rng.normal(size=(unknowns, unknowns)), width))
    matrix = root.T @ root + unknowns * np.eye(unknowns)
    matrix[np.abs(np.subtract.outer(np.arange(unknowns), np.arange(unknowns))) > width] = 0.0
    flat, front = empty_band(unknowns, width, precision)
    band = flat[front:-front].reshape(unknowns, width + 1)
    for p in range(unknowns):
        count = min(width + 1, unknowns - p)
        band[p, :count] = matrix[p, p : p + count]
    return matrix, flat, front


def factor_of(unknowns: int, width: int, precision: type) -> tuple[np.ndarray, BandFactor]:
    matrix, flat, front = banded(unknowns, width, precision)
    factor = factorise(flat, front=front, unknowns=unknowns, width=width)
    assert factor is not None
    return matrix, factor


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize(("unknowns", "width"), [(200, 37), (131, 64), (40, 39), (45, 33)])
def test_a_band_is_solved_as_the_dense_matrix(unknowns: int, width: int, precision: type) -> None:
    matrix, factor = factor_of(unknowns, width, precision)
    right = np.random.default_rng(1).normal(size=(4, unknowns))
    expected = np.linalg.solve(matrix, right.T).T
    within = 200 * np.finfo(precision).eps * np.abs(expected).max()
    np.testing.assert_allclose(factor.solve(right), expected, atol=within)
    white = factor.whiten(right)
    np.testing.assert_allclose(white @ white.T, right @ expected.T, atol=within * unknowns)


def test_a_matrix_that_is_not_positive_definite_has_no_factor() -> None:
    _, flat, front = banded(90, 40, np.float64)
    flat[front + 70 * 41] = -1.0
    assert factorise(flat, front=front, unknowns=90, width=40) is None
