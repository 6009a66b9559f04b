"""One contact or two, and where? Moments propose, the dots decide.

Moments of nodal forces up to the third are those of the load (see `force_clusters`), so where two narrow
contacts would be that share a cluster is arithmetic. Along the longer axis of the cluster let V be the
variance that is more than across it, and m3 the third central moment. Two points have

    x^2 - (m3 / V) x - V = 0,    shares  -x2 / (x1 - x2)  and  x1 / (x1 - x2)

(K. Pearson 1894, doi:10.1098/rsta.1894.0003, with equal small variances). Things that press beside each
other do not overlap, so two parts at a distance d have a variance of at most d^2 / 16 each. Whether there
are two is then asked of the dots: two round patches must explain them better than one patch of any size and
shape does, by a ratio F of what each leaves over (the F-test of regression; what the model cannot explain is
in both). So a finger that lies flat stays one contact. See docs/derivations/inversion.md.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.estimation.mechanics.evidence import Evidence
from manytouch.estimation.mechanics.force_clusters import Clusters, ForceLattice, smoothed
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Mask, Points2

Weigh = Callable[[Int64[np.ndarray, " n"]], Evidence | None]
"""What the dots say of the forces of some nodes; None when they say nothing."""
_TWO = 7  # parameters of two patches; one has one less


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Parts:
    """Two parts of a cluster: places (2, 2), shares (2,), their own spread along each axis in mm^2."""

    centre_mm: Points2
    share: np.ndarray
    own_mm2: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ModelOrder:
    """Splits clusters that are two contacts, and puts contacts where the dots say.

    Attributes:
        trim: nodes below this share of the cluster's highest force do not count for moments, in which far
            ones weigh most.
        least_variance: V of two contacts is at least this part of an element squared,
        faint: and for weak clusters at least this part of the force unit over their force.
        least_share: of the force, that the weaker part has.
        better: F of two patches against one; usual noise is hardly seen beside what the model leaves out,
            where dots are noisier it is so many times more,
        noisy: but not more times than this.
        quiet: what is left over, mean square over its deviation, is at least this.
        held: all limits are eased by this factor where there were two contacts in the frame before.
        farthest: a contact is not put further than this from the centroid of its forces, in elements.
        enough: force units of a contact whose area is asked for,
        clear: and deviations that it has at least, or it is not told.
        most: of the strongest clusters are looked at,
        widest: if what the dots say of so many nodes, or fewer, is needed for it.
    """

    trim: float = 0.04
    least_variance: float = 0.25
    faint: float = 0.003
    least_share: float = 0.17
    better: float = 4.0
    noisy: float = 3.0
    quiet: float = 0.1
    held: float = 0.7
    farthest: float = 0.5
    enough: float = 0.08
    clear: float = 3.0
    most: int = 8
    widest: int = 100

    def __call__(
        self,
        lattice: ForceLattice,
        force_mm2: Nodal,
        clusters: Clusters,
        held_mm: Float64[np.ndarray, "k 2"],
        *,
        weigh: Weigh,
        noise: float = 1.0,
    ) -> Clusters:
        """The clusters, those that are two contacts as two; the strongest first.

        Args:
            lattice: of the nodes.
            force_mm2: nodal forces over E.
            clusters: found in them, the strongest first.
            held_mm: (k, 2) where contacts were in the frame before.
            weigh: tells what the dots say.
            noise: how much noisier than usual the dots are.
        """
        made = clusters
        press_mm2 = np.maximum(-force_mm2[:, 2], 0.0)
        for number in range(min(len(clusters), self.most)):
            own = clusters.label == number
            counts = own & (press_mm2 > self.trim * press_mm2[own].max())
            eased = self.held if _held_within(clusters, number, held_mm) >= 2 else 1.0
            parts = self._proposed(lattice, press_mm2, counts, eased)
            near = _around(lattice, counts) if parts is not None else _under(lattice, clusters, number)
            node = np.flatnonzero(near & (own | (clusters.label < 0)))
            told = weigh(node) if len(node) <= self.widest else None
            if told is None:
                continue
            if parts is not None:
                better = eased * self.better * min(noise, self.noisy)
                parts = self._accepted(told, clusters, number, parts, eased=eased, better=better)
            if parts is not None:
                made = _divided(made, number, parts, lattice, force_mm2)
            else:
                made = self._placed(made, number, lattice, told)
        order = np.argsort(-made.normal_mm2, kind="stable")
        return made.chosen(order)

    def _proposed(
        self, lattice: ForceLattice, press_mm2: np.ndarray, counts: Mask, eased: float
    ) -> _Parts | None:
        """Two parts of a cluster whose moments could be those of two contacts."""
        share, place = press_mm2[counts] / press_mm2[counts].sum(), lattice.place_mm[counts]
        centre = share @ place
        arm = place - centre
        inside = np.einsum("n,ni,nj->ij", share, arm, arm) - np.diag(lattice.element_mm**2 / 3.0)
        size, axes = np.linalg.eigh(inside)
        own_mm2, axis = max(float(size[0]), 0.0), axes[:, 1]
        excess_mm2 = float(size[1]) - own_mm2
        faint = self.faint * lattice.force_unit_mm2 / float(press_mm2[counts].sum())
        least = eased * float(np.hypot(self.least_variance, faint))
        if excess_mm2 <= least * float((axis**2 * lattice.element_mm**2).sum()):
            return None
        skew_mm = float(share @ (arm @ axis) ** 3) / excess_mm2
        gap_mm = float(np.sqrt(skew_mm**2 + 4.0 * excess_mm2))
        ends_mm = np.array([0.5 * (skew_mm + gap_mm), 0.5 * (skew_mm - gap_mm)])
        parts = np.array([-ends_mm[1], ends_mm[0]]) / gap_mm
        return _Parts(centre_mm=centre + ends_mm[:, None] * axis, share=parts, own_mm2=own_mm2)

    def _accepted(
        self, told: Evidence, clusters: Clusters, number: int, parts: _Parts, *, eased: float, better: float
    ) -> _Parts | None:
        """The parts as they explain the dots best, if they do so better than one patch."""
        press_mm2 = float(clusters.normal_mm2[number])
        one = told.one(press_mm2, clusters.centre_mm[number], clusters.spread_mm2[number])
        begin = np.clip(parts.share, self.least_share, 1.0 - self.least_share)
        two, force_mm2, centre_mm, own_mm = told.two(
            begin * press_mm2, parts.centre_mm, float(np.sqrt(parts.own_mm2)) + 0.1
        )
        left = max(two / max(len(told.aim) - _TWO, 1), self.quiet)
        share = force_mm2 / force_mm2.sum()
        gap_mm = float(np.linalg.norm(centre_mm[1] - centre_mm[0]))
        if one - two <= better * left or share.min() < eased * self.least_share:
            return None
        if eased * own_mm > 0.25 * gap_mm:
            return None
        return _Parts(centre_mm=centre_mm, share=share, own_mm2=own_mm**2)

    def _placed(self, clusters: Clusters, number: int, lattice: ForceLattice, told: Evidence) -> Clusters:
        """The clusters with one of them where a point force explains the dots best."""
        press_mm2 = float(clusters.normal_mm2[number])
        centre_mm, covariance_mm2 = told.point(press_mm2, clusters.centre_mm[number])
        shift_mm = centre_mm - clusters.centre_mm[number]
        if not np.all(np.abs(shift_mm) <= self.farthest * lattice.element_mm):
            return clusters
        area_mm2 = area_std_mm2 = np.nan
        if press_mm2 >= self.enough * lattice.force_unit_mm2:
            variance_mm2, std_mm2 = told.size(press_mm2, centre_mm)
            if variance_mm2 > self.clear * std_mm2:
                area_mm2, area_std_mm2 = 4.0 * np.pi * variance_mm2, 4.0 * np.pi * std_mm2
        return clusters.placed(
            number,
            centre_mm,
            covariance_mm2=covariance_mm2,
            patch_mm2=area_mm2,
            patch_std_mm2=area_std_mm2,
        )


def _around(lattice: ForceLattice, counts: Mask) -> Mask:
    """(n,) nodes that are among some or next to them."""
    return np.asarray(smoothed(counts.reshape(lattice.shape).astype(np.float64)).ravel() > 0.0)


def _under(lattice: ForceLattice, clusters: Clusters, number: int) -> Mask:
    """(n,) nodes whose functions are not 0 at the centre of a cluster."""
    away = np.abs(lattice.place_mm - clusters.centre_mm[number]) / lattice.element_mm
    return np.asarray((away < 2.0).all(axis=1))


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
        place_mm2=replaced(clusters.place_mm2, np.full((2, 2, 2), np.nan)),
        patch_mm2=replaced(clusters.patch_mm2, np.full(2, np.nan)),
        patch_std_mm2=replaced(clusters.patch_std_mm2, np.full(2, np.nan)),
        label=label,
    )
