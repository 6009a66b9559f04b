"""Places and units of the nodes of a sheet, for what is computed from their forces."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.values.arrays import Mask


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ForceNodes:
    """The nodes of a sheet (`geometry.spline.patch`), as force clusters need them.

    Attributes:
        shape: (slow, fast) of the nodes.
        place_mm: (n, 2) Greville points of the nodes.
        element_mm: (2,) size of the elements.
        inner_mm: (2,) half the size of the part in which contacts are found.
        force_unit_mm2: pitch times thickness; thresholds of nodal forces over E are given in this unit.
        least_seen_px: root of the sum of squares of the motions of all marker images under the least normal
            force of a contact.
        seen_mm2_per_px: normal force over E, on a square of one pitch in the middle of the sheet at rest, by
            which the marker images move by 1 px: the root of the sum of squares over all of them.
        is_beyond: (n,) nodes of an assumed sheet beyond its markers. Their forces stand for whatever presses
            or holds the sheet there.
        compliance_per_mm: (n,) deflection at each node by a normal force over E of 1 mm^2 there, of the sheet
            at rest; 0 at the outline.
        stiffening: relative growth of `seen_mm2_per_px` over the mean square of the slopes of the sheet.
        own_spread_mm2: (2,) second moment along x and y of the nodal forces of a point force.
    """

    shape: tuple[int, int]
    place_mm: Float64[np.ndarray, "nodes 2"]
    element_mm: Float64[np.ndarray, "2"]
    inner_mm: Float64[np.ndarray, "2"]
    force_unit_mm2: float
    least_seen_px: float
    seen_mm2_per_px: float
    is_beyond: Mask
    compliance_per_mm: Float64[np.ndarray, " nodes"]
    stiffening: float
    own_spread_mm2: Float64[np.ndarray, "2"]

    @property
    def least_force_mm2(self) -> float:
        """Least normal force of a cluster over E."""
        return self.least_seen_px * self.seen_mm2_per_px

    def inside_mm(self, place_mm: Float64[np.ndarray, "k 2"]) -> Float64[np.ndarray, " k"]:
        """Distance of places from the nearest limit of `inner_mm`; negative beyond it."""
        return np.asarray((self.inner_mm - np.abs(place_mm)).min(axis=1))

    def force_noise_mm2(self, slope: Float64[np.ndarray, "nodes 2"], std_px: float) -> float:
        """Standard deviation of a normal force over E in the middle, if it is the only one that is not known.

        Args:
            slope: (nodes, 2) of the deflection along x and y.
            std_px: standard deviation of the marker images along an axis.
        """
        growth = 1.0 + self.stiffening * float(np.vdot(slope, slope)) / len(slope)
        return self.seen_mm2_per_px * std_px * growth


def smooth(value: Float64[np.ndarray, "slow fast"]) -> Float64[np.ndarray, "slow fast"]:
    """Binomial means over 3 x 3 nodes; values beyond the border are 0."""
    wide = np.zeros((value.shape[0] + 2, value.shape[1] + 2))
    wide[1:-1, 1:-1] = value
    rows = 0.25 * wide[:-2] + 0.5 * wide[1:-1] + 0.25 * wide[2:]
    return np.asarray(0.25 * rows[:, :-2] + 0.5 * rows[:, 1:-1] + 0.25 * rows[:, 2:])


def sum_around(nodes: ForceNodes, value: Float64[np.ndarray, " nodes"]) -> Float64[np.ndarray, " nodes"]:
    """Sums over 3 x 3 nodes; values beyond the border are 0."""
    wide = np.zeros((nodes.shape[0] + 2, nodes.shape[1] + 2))
    wide[1:-1, 1:-1] = value.reshape(nodes.shape)
    rows = wide[:-2] + wide[1:-1] + wide[2:]
    return np.asarray((rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]).ravel())


def largest_around(nodes: ForceNodes, number: Int64[np.ndarray, " nodes"]) -> Int64[np.ndarray, " nodes"]:
    """The largest of these numbers, which are -1 or more, among 3 x 3 nodes."""
    wide = np.full((nodes.shape[0] + 2, nodes.shape[1] + 2), -1)
    wide[1:-1, 1:-1] = number.reshape(nodes.shape)
    rows = np.maximum(np.maximum(wide[:-2], wide[1:-1]), wide[2:])
    return np.asarray(np.maximum(np.maximum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:]).ravel())
