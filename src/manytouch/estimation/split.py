"""One contact or two? What the moments of a cluster of nodal forces say.

Moments of nodal forces up to the third are those of the load (see `force_clusters`), so two narrow
contacts that share a cluster can be told by arithmetic alone. Along the longer axis of the cluster let V be
the variance that is more than across it, m3 and m4 the central moments of the same excess. Two points have

    x^2 - (m3 / V) x - V = 0,    shares  -x2 / (x1 - x2)  and  x1 / (x1 - x2),

and of all distributions only two points have m4 = V^2 + m3^2 / V (K. Pearson 1916,
doi:10.1098/rsta.1916.0009). What m4 is above that, over V^2, is 0.8 for an even bar and 2 for a Gaussian:
a finger that lies flat stays one contact.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.force_clusters import Clusters, ForceLattice
from manytouch.mechanics.patch import Nodal
from manytouch.values.arrays import Points2

_FOURTH = 0.30  # mean fourth moment of a cubic B-spline's samples, in elements^4


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Parts:
    """Two parts of a cluster: places (2, 2), shares (2,), their own spread along each axis in mm^2."""

    centre_mm: Points2
    share: np.ndarray
    own_mm2: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SplitByMoments:
    """Splits clusters that are two contacts.

    Attributes:
        trim: nodes below this share of the cluster's highest force do not count: far ones weigh most.
        least_variance: V of two contacts is at least this part of an element squared.
        flattest: how far m4 may be above that of two points, over V^2.
        least_share: of the force, that the weaker part has.
        held: all limits are eased by this factor where there were two contacts in the frame before.
    """

    trim: float = 0.04
    least_variance: float = 0.4
    flattest: float = 0.25
    least_share: float = 0.12
    held: float = 0.7

    def __call__(
        self, lattice: ForceLattice, force_mm2: Nodal, clusters: Clusters, held_mm: Float64[np.ndarray, "k 2"]
    ) -> Clusters:
        """The clusters, those that are two contacts as two; the strongest first.

        Args:
            lattice: of the nodes.
            force_mm2: nodal forces over E.
            clusters: found in them.
            held_mm: (k, 2) where contacts were in the frame before.
        """
        made = clusters
        for number in range(len(clusters)):
            node = np.flatnonzero(clusters.label == number)
            parts = self._parts(lattice, force_mm2, node, _held_within(clusters, number, held_mm))
            if parts is not None:
                made = _divided(made, number, parts, lattice, force_mm2)
        order = np.argsort(-made.normal_mm2, kind="stable")
        return made if made is clusters else made.chosen(order)

    def _parts(self, lattice: ForceLattice, force_mm2: Nodal, node: np.ndarray, held: int) -> _Parts | None:
        press = np.maximum(-force_mm2[node, 2], 0.0)
        press = np.where(press > self.trim * press.max(), press, 0.0)
        press /= press.sum()
        place = lattice.place_mm[node]
        centre = press @ place
        arm = place - centre
        inside = np.einsum("n,ni,nj->ij", press, arm, arm) - np.diag(lattice.element_mm**2 / 3.0)
        size, axes = np.linalg.eigh(inside)
        own_mm2, axis = max(float(size[0]), 0.0), axes[:, 1]
        element_mm2 = float((axis**2 * lattice.element_mm**2).sum())
        excess = float(size[1]) - own_mm2
        eased = self.held if held >= 2 else 1.0
        if excess <= eased * self.least_variance * element_mm2:
            return None
        along = arm @ axis
        third, fourth = float(press @ along**3), float(press @ along**4)
        fourth -= 2.0 * element_mm2 * size[1] + _FOURTH * element_mm2**2
        fourth -= 6.0 * excess * own_mm2 + 3.0 * own_mm2**2
        if fourth / excess**2 - third**2 / excess**3 - 1.0 > self.flattest / eased:
            return None
        skew = third / excess
        gap = float(np.sqrt(skew**2 + 4.0 * excess))
        ends = np.array([0.5 * (skew + gap), 0.5 * (skew - gap)])
        share = np.array([-ends[1], ends[0]]) / gap
        if share.min() < eased * self.least_share:
            return None
        return _Parts(centre_mm=centre + ends[:, None] * axis, share=share, own_mm2=own_mm2)


def _held_within(clusters: Clusters, number: int, held_mm: Float64[np.ndarray, "k 2"]) -> int:
    """How many of some places belong to a cluster: nearer to its centre than to any other's."""
    if len(held_mm) == 0:
        return 0
    away = np.linalg.norm(held_mm[:, None] - clusters.centre_mm, axis=2)
    reach = 3.0 * float(np.sqrt(np.trace(clusters.spread_mm2[number]) + 1e-12))
    return int(((away.argmin(axis=1) == number) & (away[:, number] < reach)).sum())


def _divided(
    clusters: Clusters, number: int, parts: _Parts, lattice: ForceLattice, force_mm2: Nodal
) -> Clusters:
    """The clusters with one of them in two parts; its nodes belong to the nearer part."""
    node = np.flatnonzero(clusters.label == number)
    away = np.linalg.norm(lattice.place_mm[node, None] - parts.centre_mm, axis=2)
    second = node[away[:, 1] < away[:, 0]]
    label = clusters.label.copy()
    label[second] = len(clusters)
    force, torque = np.empty((2, 3)), np.empty(2)
    for part, own in enumerate((np.setdiff1d(node, second), second)):
        force[part, :2] = force_mm2[own, :2].sum(axis=0)
        force[part, 2] = parts.share[part] * clusters.force_mm2[number, 2]
        arm = lattice.place_mm[own] - parts.centre_mm[part]
        torque[part] = (arm[:, 0] * force_mm2[own, 1] - arm[:, 1] * force_mm2[own, 0]).sum()
    spread = np.tile(parts.own_mm2 * np.eye(2), (2, 1, 1))

    def replaced(old: np.ndarray, new: np.ndarray) -> Float64[np.ndarray, "..."]:
        joined = np.concatenate([old, new[1:]])
        joined[number] = new[0]
        return joined

    return Clusters(
        centre_mm=replaced(clusters.centre_mm, parts.centre_mm),
        force_mm2=replaced(clusters.force_mm2, force),
        torque_mm3=replaced(clusters.torque_mm3, torque),
        spread_mm2=replaced(clusters.spread_mm2, spread),
        label=label,
    )
