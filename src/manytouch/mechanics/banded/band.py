"""Symmetric positive definite band matrices: factor, solve, covariances, by LAPACK."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np
from jaxtyping import Float, Float64
from scipy.linalg import get_lapack_funcs

from manytouch.mechanics.banded.forward import LANES, substitute

_MANY = 3  # right-hand sides from which on `substitute` is faster than LAPACK

PADDING_ROWS = 16
"""Rows before and after the matrix, because tiles extend over both ends."""


class Band(NamedTuple):
    """The upper half of a symmetric band matrix.

    Attributes:
        values: flat; H[p, q], q >= p, is at front + p (width + 1) + q - p, so that rows of tiles are `width`
            apart. Tiles extend a little over both ends of the band; what they add there is 0.
        front: number of values before the matrix.
        width: half-band.
    """

    values: Float[np.ndarray, " k"]
    front: int
    width: int


@dataclass(frozen=True, eq=False, kw_only=True)
class BandFactor:
    """L of H = L L^T.

    Attributes:
        lower: (n, width + 1) row p is column p of L from the diagonal down.
    """

    lower: Float[np.ndarray, "n band"]

    def solve(self, right: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """H^-1 times each row of `right`."""
        solve = _lapack("pbtrs", self.lower.dtype)
        solution, _ = solve(self.lower.T, np.asfortranarray(right.T, dtype=self.lower.dtype), lower=1)
        return np.ascontiguousarray(solution.T, dtype=np.float64)

    def whiten(self, right: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """L^-1 times each row: scalar products of the results are right H^-1 right^T."""
        if len(right) >= _MANY:
            return self.whiten_many(right)
        solve = _lapack("tbtrs", self.lower.dtype)
        result, first = np.zeros_like(right), _first_not_zero(right)
        if first < right.shape[1]:
            part = np.asfortranarray(right[:, first:].T, dtype=self.lower.dtype)
            result[:, first:] = solve(self.lower[first:].T, part, uplo="L")[0].T
        return result

    def whiten_many(self, right: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """As `whiten`, faster for many rows; each is rounded as it would be without the others."""
        parts = [right[start : start + LANES] for start in range(0, len(right), LANES)]
        lanes = np.zeros((len(parts), right.shape[1], LANES), self.lower.dtype)
        for group, part in zip(lanes, parts, strict=True):
            group[:, : len(part)] = part.T
        if parts:
            substitute(self.lower, np.array([_first_not_zero(part) for part in parts]), lanes)
        result = np.empty_like(right)
        for group, start in zip(lanes, range(0, len(right), LANES), strict=True):
            result[start : start + LANES] = group[:, : len(right) - start].T
        return result

    def colour(self, normal: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """L^-T times each row: independent normal numbers get the covariance H^-1."""
        solve = _lapack("tbtrs", self.lower.dtype)
        right = np.asfortranarray(normal.T, dtype=self.lower.dtype)
        solution, _ = solve(self.lower.T, right, uplo="L", trans="T")
        return np.ascontiguousarray(solution.T, dtype=np.float64)


@cache
def _lapack(name: str, precision: np.dtype[Any]) -> Callable[..., Any]:
    """A function of LAPACK."""
    (found,) = get_lapack_funcs((name,), dtype=precision)
    return cast(Callable[..., Any], found)


def _first_not_zero(right: Float64[np.ndarray, "k n"]) -> int:
    """First column that is not 0 in all rows; the number of columns if there is none."""
    is_used = right != 0.0
    first = is_used.argmax(axis=1)
    return int(first[is_used[np.arange(len(right)), first]].min(initial=right.shape[1]))


def new_band(unknowns: int, width: int, precision: type[np.floating]) -> Band:
    """A band of zeros with room for the tiles that extend over its ends."""
    front = PADDING_ROWS * (width + 1)
    return Band(values=np.zeros(2 * front + unknowns * (width + 1), precision), front=front, width=width)


def band_rows(band: Band) -> Float[np.ndarray, "n band"]:
    """The matrix as a view: row p is H[p, p], H[p, p + 1], ..."""
    return band.values[band.front : -band.front].reshape(-1, band.width + 1)


def factorise(band: Band) -> BandFactor | None:
    """The Cholesky factor of a band, which it overwrites; None if the matrix is not positive definite."""
    rows = band_rows(band)
    (cholesky,) = get_lapack_funcs(("pbtrf",), (rows,))
    lower, info = cholesky(rows.T, lower=1, overwrite_ab=1)
    return BandFactor(lower=lower.T) if info == 0 else None
