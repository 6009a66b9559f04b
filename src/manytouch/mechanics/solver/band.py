"""Symmetric positive definite matrices with a narrow band: factor, solve, covariances."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64
from scipy.linalg import get_lapack_funcs

from manytouch.mechanics.solver import band_kernels

PADDING_ROWS = 16


@dataclass(frozen=True, eq=False, kw_only=True)
class BandFactor:
    """L of H = L L^T.

    Attributes:
        lower: (n, width + 1): row p holds L[p, p], L[p + 1, p], ... of its column p.
    """

    lower: Float[np.ndarray, "n band"]

    def solve(self, right: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """H^-1 times each row of `right`."""
        (solve,) = get_lapack_funcs(("pbtrs",), (self.lower,))
        solution, _ = solve(self.lower.T, np.asfortranarray(right.T, dtype=self.lower.dtype), lower=1)
        return np.ascontiguousarray(solution.T, dtype=np.float64)

    def whiten(self, right: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """L^-1 times each row: the products of these rows are those of `right` with H^-1 between."""
        (solve,) = get_lapack_funcs(("tbtrs",), (self.lower,))
        solution, _ = solve(self.lower.T, np.asfortranarray(right.T, dtype=self.lower.dtype), uplo="L")
        return np.ascontiguousarray(solution.T, dtype=np.float64)

    def colour(self, normal: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """L^-T times each row: rows of independent normal numbers get the covariance H^-1."""
        (solve,) = get_lapack_funcs(("tbtrs",), (self.lower,))
        right = np.asfortranarray(normal.T, dtype=self.lower.dtype)
        solution, _ = solve(self.lower.T, right, uplo="L", trans="T")
        return np.ascontiguousarray(solution.T, dtype=np.float64)


def factorise(flat: Float[np.ndarray, " k"], *, front: int, unknowns: int, width: int) -> BandFactor | None:
    """The factor of a flat band (see `band_kernels`), which it overwrites.

    None when the matrix is not positive definite.
    """
    if not band_kernels.factorise(flat, front, unknowns, width):
        return None
    stored = flat[front : front + unknowns * (width + 1)]
    return BandFactor(lower=stored.reshape(unknowns, width + 1))


def empty_band(
    unknowns: int, width: int, precision: type[np.floating]
) -> tuple[Float[np.ndarray, " k"], int]:
    """Room for a flat band, and where in it the matrix begins: tiles reach over both ends."""
    front = PADDING_ROWS * (width + 1)
    return np.zeros(2 * front + unknowns * (width + 1), precision), front
