"""Forces on the nodes of an assumed sheet beyond its outermost markers.

Where such a sheet ends, and what presses it beyond the view, is not known. The forces there stand for both:
they may press, pull and shear. They are many and smooth, unlike those of a contact, so that each has the mean
square of those around it as its variance (M. E. Tipping 2001, "Sparse Bayesian learning", for a group). A
contact next to the outermost markers, which is few forces, is the simpler explanation of what it causes.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.inversion.force_nodes import ForceNodes
from manytouch.geometry.spline.patch import Nodal


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BeyondMarkers:
    """Parameters of the variance of these forces; chosen on 39 views of 16 simulated sheets (ADR 173).

    Attributes:
        least_std: least standard deviation of a force over E, in pitch times thickness.
        reach: a mean square is over the nodes that are at most so many away along both axes.
    """

    least_std: float = 1.0e-3
    reach: int = 4

    def weights(self, nodes: ForceNodes, force_mm2: Nodal) -> Float64[np.ndarray, "beyond 1"]:
        """Inverse variances of the force components at each node beyond the markers, per mm^4.

        Args:
            nodes: of the sheet.
            force_mm2: (n, 3) nodal forces over E.
        """
        is_beyond = nodes.is_beyond
        if not is_beyond.any():
            return np.zeros((0, 1))
        squares_mm4 = np.where(is_beyond, np.square(force_mm2).mean(axis=1), 0.0)
        total_mm4, count = (self._sums(nodes, each) for each in (squares_mm4, 1.0 * is_beyond))
        mean_mm4 = np.maximum(total_mm4, 0.0)[is_beyond] / count[is_beyond]
        return np.asarray(1.0 / (mean_mm4 + (self.least_std * nodes.force_unit_mm2) ** 2)[:, None])

    def _sums(self, nodes: ForceNodes, value: Float64[np.ndarray, " nodes"]) -> Float64[np.ndarray, " nodes"]:
        """(n,) sums over the nodes that are at most `reach` away along both axes."""
        width = 2 * self.reach + 1
        wide = np.pad(value.reshape(nodes.shape), ((self.reach + 1, self.reach),) * 2)
        total = wide.cumsum(axis=0).cumsum(axis=1)
        rows = total[width:] - total[:-width]
        return np.asarray((rows[:, width:] - rows[:, :-width]).ravel())
