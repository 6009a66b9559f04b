"""Cholesky in a band against numpy."""

import numpy as np
import pytest

from manytouch.mechanics.banded.band import BandFactor, band_rows, factorise, new_band
from manytouch.mechanics.solver.band_kernels import Band


def banded(unknowns: int, width: int, precision: type) -> tuple[np.ndarray, Band]:
    """A positive definite matrix, dense and as a band."""
    rng = np.random.default_rng(unknowns)
    root = np.triu(np.tril(rng.normal(size=(unknowns, unknowns)), width))
    matrix = root.T @ root + unknowns * np.eye(unknowns)
    matrix[np.abs(np.subtract.outer(np.arange(unknowns), np.arange(unknowns))) > width] = 0.0
    band = new_band(unknowns, width, precision)
    for p, row in enumerate(band_rows(band)):
        count = min(width + 1, unknowns - p)
        row[:count] = matrix[p, p : p + count]
    return matrix, band


def factor_of(unknowns: int, width: int, precision: type) -> tuple[np.ndarray, BandFactor]:
    matrix, band = banded(unknowns, width, precision)
    factor = factorise(band)
    assert factor is not None
    return matrix, factor


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize(("unknowns", "width"), [(200, 37), (131, 64), (40, 39), (45, 5)])
def test_a_band_is_solved_as_the_dense_matrix(unknowns: int, width: int, precision: type) -> None:
    matrix, factor = factor_of(unknowns, width, precision)
    right = np.random.default_rng(1).normal(size=(4, unknowns))
    expected = np.linalg.solve(matrix, right.T).T
    within = 200 * np.finfo(precision).eps * np.abs(expected).max()
    np.testing.assert_allclose(factor.solve(right), expected, atol=within)
    white = factor.whiten(right)
    np.testing.assert_allclose(white @ white.T, right @ expected.T, atol=within * unknowns)
    coloured = factor.colour(np.eye(unknowns))
    np.testing.assert_allclose(coloured.T @ coloured, np.linalg.inv(matrix), atol=within)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize(("unknowns", "width"), [(200, 37), (131, 64), (40, 39), (45, 5), (203, 8)])
@pytest.mark.parametrize("first", [0, 5, 19])
def test_many_right_hand_sides_are_whitened_as_by_lapack(
    unknowns: int, width: int, precision: type, first: int
) -> None:
    matrix, factor = factor_of(unknowns, width, precision)
    right = np.random.default_rng(2).normal(size=(41, unknowns))
    right[:, :first] = 0.0
    lower = np.linalg.cholesky(matrix)
    expected = np.linalg.solve(lower, right.T).T
    white = factor.whiten_many(right)
    np.testing.assert_allclose(white, expected, atol=200 * np.finfo(precision).eps * np.abs(expected).max())
    np.testing.assert_array_equal(white[:, :first], 0.0)
    few = np.concatenate([factor.whiten(right[start : start + 5]) for start in range(0, 41, 5)])
    np.testing.assert_allclose(few, white, atol=200 * np.finfo(precision).eps * np.abs(expected).max())


def test_a_row_is_whitened_as_it_would_be_without_the_others() -> None:
    _, factor = factor_of(200, 37, np.float32)
    right = np.random.default_rng(3).normal(size=(70, 200))
    white = factor.whiten_many(right)
    for chosen in ([3], [69, 3, 50], list(range(69, -1, -1))):
        np.testing.assert_array_equal(factor.whiten_many(right[chosen]), white[chosen])


def test_the_factor_is_made_in_the_memory_of_the_band() -> None:
    """A copy would take longer than the assembly."""
    _, band = banded(90, 40, np.float32)
    factor = factorise(band)
    assert factor is not None
    assert np.shares_memory(factor.lower, band.values)


def test_a_matrix_that_is_not_positive_definite_has_no_factor() -> None:
    _, band = banded(90, 40, np.float64)
    band_rows(band)[70, 0] = -1.0
    assert factorise(band) is None
