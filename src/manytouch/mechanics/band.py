"""Symmetric positive definite matrices with a narrow band: factor, solve, covariances."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.linalg import get_lapack_funcs


@dataclass(frozen=True, eq=False, kw_only=True)
class BandFactor:
    """L of H = L L^T.

    Attributes:
        lower: (n, width + 1): row p holds L[p, p], L[p + 1, p], ... of its column p.
    """

    lower: Float64[np.ndarray, "n band"]

    def solve(self, right: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """H^-1 times each row of `right`."""
        (solve,) = get_lapack_funcs(("pbtrs",), (self.lower,))
        solution, _ = solve(self.lower.T, np.asfortranarray(right.T), lower=1)
        return np.ascontiguousarray(solution.T)

    def whitened(self, right: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k n"]:
        """L^-1 times each row: the products of these rows are those of `right` with H^-1 between."""
        (solve,) = get_lapack_funcs(("tbtrs",), (self.lower,))
        solution, _ = solve(self.lower.T, np.asfortranarray(right.T), uplo="L")
        return np.ascontiguousarray(solution.T)


def factorised(band: Float64[np.ndarray, "n band"]) -> BandFactor | None:
    """The factor of a matrix whose row p holds H[p, p], H[p, p + 1], ...; overwrites it.

    None when the matrix is not positive definite.
    """
    (factorise,) = get_lapack_funcs(("pbtrf",), (band,))
    lower, info = factorise(band.T, lower=1, overwrite_ab=1)
    return BandFactor(lower=lower.T) if info == 0 else None
