"""A factor of a normal matrix after the weights of a few forces have changed, from the factor before.

With H = L L^T, rows R whose weights change by D and V = R L^-T, the new matrix is

    H + R^T D R = L (1 + V^T D V) L^T,

a change of low rank (W. W. Hager 1989, doi:10.1137/1031049). In an orthonormal basis Q of the rows of V the
middle matrix is 1 + Q^T (E - 1) Q with a diagonal E, so that its symmetric root and its inverse are products
with Q.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.mechanics.banded.band import BandFactor

_RANK = 1e-10  # combinations of rows below this share of the largest one are dropped

Rows = Float64[np.ndarray, "k n"]


@dataclass(frozen=True, eq=False, kw_only=True)
class ReweightedFactor:
    """L M with M = 1 + Q^T (E^(1/2) - 1) Q; solutions and covariances as those of a `BandFactor`.

    Attributes:
        factor: L.
        axes: (r, n) Q.
        stretch: (r,) E, positive.
    """

    factor: BandFactor
    axes: Float64[np.ndarray, "r n"]
    stretch: Float64[np.ndarray, " r"]

    def solve(self, right: Rows) -> Rows:
        """Inverse of the matrix times each row of `right`."""
        return self.factor.colour(self._times(1.0 / self.stretch, self.factor.whiten(right)))

    def whiten(self, right: Rows) -> Rows:
        """M^-1 L^-1 times each row: scalar products of the results are those with the inverse matrix."""
        return self.turned(self.factor.whiten(right))

    def colour(self, normal: Rows) -> Rows:
        """L^-T M^-1 times each row: independent normal numbers get the inverse matrix as covariance."""
        return self.factor.colour(self.turned(normal))

    def turned(self, white: Rows) -> Rows:
        """M^-1 times each row: rows whitened by L become rows whitened by L M."""
        return self._times(self.stretch**-0.5, white)

    def products(self, white: Rows, first: int = 0) -> Float64[np.ndarray, "k k"]:
        """Scalar products, after `turned`, of rows that were whitened by L; they are 0 before `first`."""
        along = white @ self.axes[:, first:].T
        return np.asarray(white @ white.T + (along * (1.0 / self.stretch - 1.0)) @ along.T)

    def _times(self, sizes: Float64[np.ndarray, " r"], white: Rows) -> Rows:
        """1 + Q^T (diag(sizes) - 1) Q times each row."""
        return np.asarray(white + ((white @ self.axes.T) * (sizes - 1.0)) @ self.axes)


def reweighted_factor(
    factor: BandFactor, white: Rows, change: Float64[np.ndarray, " k"], *, least: float
) -> ReweightedFactor | None:
    """The factor after the weights of k rows have changed.

    Args:
        factor: L.
        white: (k, n) L^-1 times the rows.
        change: (k,) of their weights.
        least: None is returned if a variance grows by more than 1 / least: rounding of L grows as much.
    """
    scaled = np.sqrt(np.abs(change))[:, None] * white
    size, turn = np.linalg.eigh(scaled @ scaled.T)
    is_used = size > _RANK * size[-1]
    root, turn = np.sqrt(size[is_used]), turn[:, is_used]
    inside = root[:, None] * turn.T
    stretch, axes = np.linalg.eigh(np.eye(len(root)) + (inside * np.sign(change)) @ inside.T)
    if stretch[0] < least:
        return None
    return ReweightedFactor(
        factor=factor, axes=(axes.T / root) @ (turn.T @ scaled), stretch=np.asarray(stretch)
    )
