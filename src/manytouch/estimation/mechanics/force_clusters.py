"""Contacts as clusters of nodal forces of a B-spline sheet.

Cubic B-splines reproduce polynomials: with a load q, nodal forces f_j = int q B_j and Greville points X_j,
sum f_j = int q, sum f_j X_j = int q x, and away from the outline sum f_j X_j^2 = int q (x^2 + h^2/3), with h
the length of an element (C. de Boor, "A Practical Guide to Splines", 2001, chapter IX). Force, centre and
spread of a cluster are therefore those of its load and do not depend on the lattice.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ForceLattice:
    """The nodes of a sheet, as force clusters need them.

    Attributes:
        shape: (slow, fast) of the nodes.
        place_mm: (n, 2) Greville points of the nodes.
        element_mm: (2,) size of the elements.
        inner_mm: (2,) half the size of the part in which contacts are found.
        force_unit_mm2: pitch times thickness; thresholds of forces over E are given in this unit.
    """

    shape: tuple[int, int]
    place_mm: Float64[np.ndarray, "nodes 2"]
    element_mm: Float64[np.ndarray, "2"]
    inner_mm: Float64[np.ndarray, "2"]
    force_unit_mm2: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Clusters:
    """Groups of nodal forces, the strongest first; forces are those of objects on the sheet, over E.

    Attributes:
        centre_mm: (c, 2) centroid of the normal force in undeformed coordinates, sheet frame.
        force_mm2: (c, 3) along x, y, z; a press has z < 0.
        torque_mm3: (c,) about the normal through the centre.
        spread_mm2: (c, 2, 2) second moment of the normal force about the centre.
        centre_covariance_mm2: (c, 2, 2) of a centre that was fitted to the markers; NaN where the centre is
            the centroid of the nodal forces.
        contact_area_mm2, contact_area_std_mm2: (c,) area of the contact and its standard deviation, fitted to
            the markers; NaN where the markers do not determine it.
        label: (n,) cluster of each node, or -1.
    """

    centre_mm: Points2
    force_mm2: Float64[np.ndarray, "c 3"]
    torque_mm3: Float64[np.ndarray, " c"]
    spread_mm2: Float64[np.ndarray, "c 2 2"]
    centre_covariance_mm2: Float64[np.ndarray, "c 2 2"]
    contact_area_mm2: Float64[np.ndarray, " c"]
    contact_area_std_mm2: Float64[np.ndarray, " c"]
    label: Int64[np.ndarray, " nodes"]

    def __len__(self) -> int:
        return len(self.centre_mm)

    @property
    def normal_mm2(self) -> Scalars:
        """(c,) normal force over E, positive in compression."""
        return np.asarray(-self.force_mm2[:, 2])

    @property
    def moment_area_mm2(self) -> Scalars:
        """(c,) area of the ellipse under uniform pressure with the same second moment as the nodal forces."""
        spread = np.linalg.det(self.spread_mm2)
        return np.asarray(4.0 * np.pi * np.sqrt(np.maximum(spread, 0.0)))

    def with_centre(
        self,
        number: int,
        centre_mm: Float64[np.ndarray, "2"],
        *,
        covariance_mm2: Float64[np.ndarray, "2 2"],
        contact_area_mm2: float,
        contact_area_std_mm2: float,
    ) -> "Clusters":
        """The clusters with another centre, torque about it, and contact area of one of them."""
        arm_mm = centre_mm - self.centre_mm[number]
        turned = arm_mm[0] * self.force_mm2[number, 1] - arm_mm[1] * self.force_mm2[number, 0]

        def changed(old: np.ndarray, new: np.ndarray | float) -> Float64[np.ndarray, "..."]:
            copy = old.copy()
            copy[number] = new
            return copy

        return replace(
            self,
            centre_mm=changed(self.centre_mm, centre_mm),
            torque_mm3=changed(self.torque_mm3, self.torque_mm3[number] - turned),
            centre_covariance_mm2=changed(self.centre_covariance_mm2, covariance_mm2),
            contact_area_mm2=changed(self.contact_area_mm2, contact_area_mm2),
            contact_area_std_mm2=changed(self.contact_area_std_mm2, contact_area_std_mm2),
        )

    def select(self, order: np.ndarray) -> "Clusters":
        """The clusters with these numbers, in this order."""
        number = np.full(len(self) + 1, -1, dtype=np.int64)
        number[order] = np.arange(len(order))
        return Clusters(
            centre_mm=self.centre_mm[order],
            force_mm2=self.force_mm2[order],
            torque_mm3=self.torque_mm3[order],
            spread_mm2=self.spread_mm2[order],
            centre_covariance_mm2=self.centre_covariance_mm2[order],
            contact_area_mm2=self.contact_area_mm2[order],
            contact_area_std_mm2=self.contact_area_std_mm2[order],
            label=number[self.label],
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ForceClusters:
    """Clusters as watersheds of the smoothed normal forces; thresholds of forces are in force units.

    Attributes:
        merge_share: two clusters are one if the saddle between them is above this share of the lower peak.
        floor_share: nodes below this share of the highest smoothed force belong to no cluster.
        floor: nodes below this smoothed force belong to no cluster.
        min_force: least normal force of a cluster.
        min_share: least normal force of a cluster over that of the strongest one.
    """

    merge_share: float = 0.75
    floor_share: float = 0.002
    floor: float = 2e-6
    min_force: float = 1.25e-3
    min_share: float = 0.04

    def __call__(self, lattice: ForceLattice, force_mm2: Nodal) -> Clusters:
        """The clusters of nodal forces (n, 3) over E, sheet frame."""
        from manytouch.estimation.watershed import watershed

        press_mm2 = smooth(np.maximum(-force_mm2[:, 2], 0.0).reshape(lattice.shape))
        floor_mm2 = max(self.floor_share * float(press_mm2.max()), self.floor * lattice.force_unit_mm2)
        label, _ = watershed(press_mm2, floor_mm2, self.merge_share)
        clusters = cluster_moments(lattice, force_mm2, label.ravel())
        strongest_mm2 = float(clusters.normal_mm2.max(initial=0.0))
        least_mm2 = max(self.min_force * lattice.force_unit_mm2, self.min_share * strongest_mm2)
        is_inner = np.all(np.abs(clusters.centre_mm) <= lattice.inner_mm, axis=1)
        order = np.argsort(-clusters.normal_mm2, kind="stable")
        return clusters.select(order[(is_inner & (clusters.normal_mm2 >= least_mm2))[order]])


def smooth(value: Float64[np.ndarray, "slow fast"]) -> Float64[np.ndarray, "slow fast"]:
    """Binomial means over 3 x 3 nodes; values beyond the border are 0."""
    wide = np.pad(value, 1)
    rows = 0.25 * wide[:-2] + 0.5 * wide[1:-1] + 0.25 * wide[2:]
    return np.asarray(0.25 * rows[:, :-2] + 0.5 * rows[:, 1:-1] + 0.25 * rows[:, 2:])


def cluster_moments(lattice: ForceLattice, force_mm2: Nodal, label: Int64[np.ndarray, " nodes"]) -> Clusters:
    """Clusters of labelled nodes (n,), label -1 for none; tensile normal forces count as 0."""
    count = int(label.max(initial=-1)) + 1
    node = np.flatnonzero(label >= 0)
    at, place, force = label[node], lattice.place_mm[node], force_mm2[node]
    press = np.maximum(-force[:, 2], 0.0)

    def summed(value: np.ndarray) -> np.ndarray:
        return np.bincount(at, value, minlength=count).astype(np.float64)

    total = np.maximum(summed(press), np.finfo(np.float64).tiny)
    centre = np.column_stack([summed(press * place[:, axis]) for axis in range(2)]) / total[:, None]
    arm = place - centre[at]
    spread = np.empty((count, 2, 2))
    for axis in range(2):
        spread[:, axis, axis] = summed(press * arm[:, axis] ** 2) / total - lattice.element_mm[axis] ** 2 / 3
    spread[:, 0, 1] = spread[:, 1, 0] = summed(press * arm[:, 0] * arm[:, 1]) / total
    # The spread of forces on three nodes can be less than that of any load.
    narrow = np.minimum(np.linalg.eigvalsh(spread)[:, 0], 0.0) if count else np.zeros(0)
    spread -= narrow[:, None, None] * np.eye(2)
    return Clusters(
        centre_mm=centre,
        force_mm2=np.column_stack([summed(force[:, 0]), summed(force[:, 1]), -total]),
        torque_mm3=summed(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]),
        spread_mm2=spread,
        centre_covariance_mm2=np.full((count, 2, 2), np.nan),
        contact_area_mm2=np.full(count, np.nan),
        contact_area_std_mm2=np.full(count, np.nan),
        label=label,
    )
