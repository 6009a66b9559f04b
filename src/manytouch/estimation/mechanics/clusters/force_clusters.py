"""Contacts as clusters of nodal forces of a B-spline sheet.

Cubic B-splines reproduce polynomials: with a load q, nodal forces f_j = int q B_j and Greville points X_j,
sum f_j = int q, sum f_j X_j = int q x, and away from the outline sum f_j X_j^2 = int q (x^2 + h^2/3 - 2 a),
with h the length of an element (C. de Boor, "A Practical Guide to Splines", 2001, chapter IX) and a the
`shear_mm2` of the sheet, whose deflection is that of B_j - a lap B_j. Force, centre and spread of a cluster
are therefore those of its load and do not depend on the nodes.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.ndimage import maximum_position

from manytouch.estimation.mechanics.clusters.fitted_patches import PatchFit
from manytouch.estimation.mechanics.inversion.force_nodes import ForceNodes, smooth
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Points2, Scalars, read_only

_NEVER_MERGED = 1.0  # a saddle is never above its peaks
_STEADY = 0.4
"""Share of the nodal forces that may change between two frames of which the second is steady. It was chosen
between a cylinder at the end of its ramp (.22) and the second frame of a sudden press (.6); see ADR 124."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Clusters:
    """Groups of nodal forces, the strongest first; forces are those of objects on the sheet, over E.

    Attributes:
        centre_mm: (c, 2) centroid of the normal force in undeformed coordinates, sheet frame.
        force_mm2: (c, 3) along x, y, z; a press has z < 0.
        torque_mm3: (c,) about the normal through the centre.
        spread_mm2: (c, 2, 2) second moment of the normal force about the centre.
        covariance: (c, 6, 6) of normal force, x, y, and the moments xx, xy, yy of a patch that was fitted to
            the markers, by the noise; NaN where these are those of the nodal forces.
        sheet_covariance: (c, 6, 6) the same by the parameters of the sheet that are not exactly known; see
            `with_sheet_error`.
        label: (n,) cluster of each node, or -1.
        is_face: (c,) clusters under a rigid face: bars, and those that several ones were joined to.
        corner_points_mm: for each cluster under a rigid face, (k, 2) points around the places where it
            presses, or the outline of the fitted face (`PatchFit.outline_mm`); else (0, 2).
        shape_probability: (c, 4) of the shapes of the pressure in the order of `ContactShape`; NaN where no
            patch was fitted.
        fitted_mm2: (n,) normal forces of the fitted patches on the nodes that they were fitted to, positive
            in compression; NaN elsewhere.
        is_one_as_before: (c,) clusters that are one only because they were one in the previous frame.
    """

    centre_mm: Points2
    force_mm2: Float64[np.ndarray, "c 3"]
    torque_mm3: Float64[np.ndarray, " c"]
    spread_mm2: Float64[np.ndarray, "c 2 2"]
    covariance: Float64[np.ndarray, "c 6 6"]
    sheet_covariance: Float64[np.ndarray, "c 6 6"]
    label: Int64[np.ndarray, " nodes"]
    is_face: Bool[np.ndarray, " c"]
    corner_points_mm: tuple[Float64[np.ndarray, "_ 2"], ...]
    shape_probability: Float64[np.ndarray, "c 4"]
    fitted_mm2: Float64[np.ndarray, " nodes"]
    is_one_as_before: Bool[np.ndarray, " c"]

    @staticmethod
    def of_forces(
        centre_mm: Points2,
        force_mm2: Float64[np.ndarray, "c 3"],
        torque_mm3: Scalars,
        spread_mm2: Float64[np.ndarray, "c 2 2"],
        label: Int64[np.ndarray, " nodes"],
    ) -> "Clusters":
        """Clusters with these forces and moments, to which no patch was fitted yet."""
        count = len(centre_mm)
        return Clusters(
            centre_mm=centre_mm,
            force_mm2=force_mm2,
            torque_mm3=torque_mm3,
            spread_mm2=spread_mm2,
            covariance=np.full((count, 6, 6), np.nan),
            sheet_covariance=np.zeros((count, 6, 6)),
            label=label,
            is_face=np.zeros(count, dtype=np.bool_),
            corner_points_mm=tuple(np.zeros((0, 2)) for _ in range(count)),
            shape_probability=np.full((count, 4), np.nan),
            fitted_mm2=np.full(len(label), np.nan),
            is_one_as_before=np.zeros(count, dtype=np.bool_),
        )

    def __len__(self) -> int:
        return len(self.centre_mm)

    @property
    def is_pressed(self) -> Bool[np.ndarray, " nodes"]:
        """(n,) nodes of clusters, and those that patches were fitted to."""
        return np.asarray((self.label >= 0) | np.isfinite(self.fitted_mm2))

    @property
    def normal_mm2(self) -> Scalars:
        """(c,) normal force over E, positive in compression."""
        return np.asarray(-self.force_mm2[:, 2])

    @property
    def area_mm2(self) -> Scalars:
        """(c,) area of the ellipse under uniform pressure with the same second moment."""
        spread = np.linalg.det(self.spread_mm2)
        return np.asarray(4.0 * np.pi * np.sqrt(np.maximum(spread, 0.0)))

    @property
    def area_std_mm2(self) -> Scalars:
        """(c,) standard deviation of `area_mm2` by that of the mean of both principal moments."""
        trace = self.covariance[:, 3, 3] + self.covariance[:, 5, 5] + 2.0 * self.covariance[:, 3, 5]
        return np.asarray(2.0 * np.pi * np.sqrt(np.maximum(trace, 0.0)))

    def with_patch(
        self, number: int, patch: PatchFit, shape_probability: Float64[np.ndarray, "4"]
    ) -> "Clusters":
        """The clusters with one of them as a patch, or as a bar, and its torque about the new centre."""
        arm_mm = patch.centre_mm - self.centre_mm[number]
        turned = arm_mm[0] * self.force_mm2[number, 1] - arm_mm[1] * self.force_mm2[number, 0]

        def changed(old: np.ndarray, new: np.ndarray | float) -> Float64[np.ndarray, "..."]:
            copy = old.copy()
            copy[number] = new
            return copy

        return replace(
            self,
            centre_mm=changed(self.centre_mm, patch.centre_mm),
            force_mm2=changed(self.force_mm2, np.array([*self.force_mm2[number, :2], -patch.force_mm2])),
            torque_mm3=changed(self.torque_mm3, self.torque_mm3[number] - turned),
            spread_mm2=changed(self.spread_mm2, patch.spread_mm2),
            covariance=changed(self.covariance, patch.covariance),
            shape_probability=changed(self.shape_probability, shape_probability),
            is_face=changed(self.is_face, len(patch.outline_mm) > 0),
            corner_points_mm=(
                *self.corner_points_mm[:number],
                patch.outline_mm,
                *self.corner_points_mm[number + 1 :],
            ),
        )

    def with_sheet_error(self, nodes: ForceNodes, columns_mm2: Float64[np.ndarray, "p nodes"]) -> "Clusters":
        """The clusters with `sheet_covariance`: what the parameters do to force, centroid and moments.

        Args:
            nodes: of the sheet.
            columns_mm2: change of the nodal normal forces over E (z component) for one standard deviation of
                each parameter.
        """
        covariance = np.zeros((len(self), 6, 6))
        for number, force_mm2 in enumerate(self.normal_mm2):
            node = np.flatnonzero(self.label == number)
            x, y = (nodes.place_mm[node] - self.centre_mm[number]).T
            nodal_mm2 = self.spread_mm2[number] + np.diag(nodes.own_spread_mm2)
            xx, xy, yy = x * x - nodal_mm2[0, 0], x * y - nodal_mm2[0, 1], y * y - nodal_mm2[1, 1]
            moments = np.column_stack([np.full(len(node), force_mm2), x, y, xx, xy, yy]) / force_mm2
            changes = columns_mm2[:, node] @ moments
            covariance[number] = changes.T @ changes
        return replace(self, sheet_covariance=covariance)

    def with_force_std(self, std_mm2: Scalars) -> "Clusters":
        """The clusters with a deviation (c,) of their normal force in addition to that by the parameters."""
        sheet_covariance = self.sheet_covariance.copy()
        sheet_covariance[:, 0, 0] += std_mm2**2
        return replace(self, sheet_covariance=sheet_covariance)

    def with_nodal(self, node: Int64[np.ndarray, " n"], press_mm2: Float64[np.ndarray, " n"]) -> "Clusters":
        """The clusters with the normal forces of a fitted patch on nodes; those of several patches add."""
        fitted_mm2 = self.fitted_mm2.copy()
        fitted_mm2[node] = np.nan_to_num(fitted_mm2[node]) + press_mm2
        return replace(self, fitted_mm2=fitted_mm2)

    def select(self, order: np.ndarray) -> "Clusters":
        """The clusters with these numbers, in this order."""
        number = np.full(len(self) + 1, -1, dtype=np.int64)
        number[order] = np.arange(len(order))
        return Clusters(
            centre_mm=self.centre_mm[order],
            force_mm2=self.force_mm2[order],
            torque_mm3=self.torque_mm3[order],
            spread_mm2=self.spread_mm2[order],
            covariance=self.covariance[order],
            sheet_covariance=self.sheet_covariance[order],
            label=number[self.label],
            is_face=self.is_face[order],
            corner_points_mm=tuple(self.corner_points_mm[number] for number in order),
            shape_probability=self.shape_probability[order],
            fitted_mm2=self.fitted_mm2,
            is_one_as_before=self.is_one_as_before[order],
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PreviousContacts:
    """The contacts of the previous frame.

    Attributes:
        centre_mm: (p, 2).
        normal_mm2: (p,) normal force over E, positive in compression.
        age_s: (p,) for how long there has been each of them in this frame.
    """

    centre_mm: Float64[np.ndarray, "p 2"]
    normal_mm2: Float64[np.ndarray, " p"]
    age_s: Float64[np.ndarray, " p"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EarlierClusters:
    """Clusters of the previous frame, contacts or not.

    Attributes:
        centre_mm: (k, 2).
        one_mm2: (k,) normal force over E of each in the last steady frame in which the markers showed it as
            one contact; 0 before the first one.
        nodal_mm2: (n,) normal forces over E of the nodes; (0,) before the first frame.
    """

    centre_mm: Float64[np.ndarray, "k 2"]
    one_mm2: Float64[np.ndarray, " k"]
    nodal_mm2: Float64[np.ndarray, " n"]

    @staticmethod
    def none() -> "EarlierClusters":
        """No clusters, as before the first frame."""
        nothing = read_only(np.zeros(0))
        return EarlierClusters(centre_mm=read_only(np.zeros((0, 2))), one_mm2=nothing, nodal_mm2=nothing)

    def followed_by(
        self, clusters: Clusters, nodal_mm2: Float64[np.ndarray, " n"], reach_mm: float
    ) -> "EarlierClusters":
        """The clusters of the next frame; those within a distance of the same centre are the same.

        A frame is steady if its nodal forces are about those of the frame before; the first frames of a
        press are not, and their shape may not have converged.
        """
        before = [self.nearest(centre_mm, reach_mm) for centre_mm in clusters.centre_mm]
        one_mm2 = np.array([0.0 if at is None else self.one_mm2[at] for at in before], dtype=np.float64)
        if len(self.nodal_mm2) > 0:
            change_mm2 = float(np.abs(nodal_mm2 - self.nodal_mm2).sum())
            if change_mm2 <= _STEADY * float(np.abs(nodal_mm2).sum()):
                one_mm2 = np.where(clusters.is_one_as_before, one_mm2, clusters.normal_mm2)
        return EarlierClusters(
            centre_mm=read_only(clusters.centre_mm.copy()),
            one_mm2=read_only(one_mm2),
            nodal_mm2=read_only(nodal_mm2.copy()),
        )

    def nearest(self, place_mm: Float64[np.ndarray, "2"], reach_mm: float) -> int | None:
        """The cluster nearest to a place, if there is one within a distance."""
        away_mm = np.linalg.norm(self.centre_mm - place_mm, axis=1)
        return int(away_mm.argmin()) if away_mm.min(initial=np.inf) <= reach_mm else None

    def growth(self, force_mm2: Scalars, place_mm: Points2, reach_mm: float) -> float:
        """Force of clusters over that with which the markers last showed one contact there; else infinite.

        Args:
            force_mm2: (k,) their normal forces over E.
            place_mm: (k, 2) their centres.
            reach_mm: largest distance of the centre of their forces from that contact.
        """
        total_mm2 = float(force_mm2.sum())
        before = self.nearest(force_mm2 @ place_mm / total_mm2, reach_mm)
        one_mm2 = 0.0 if before is None else float(self.one_mm2[before])
        return total_mm2 / one_mm2 if one_mm2 > 0.0 else np.inf


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ForceClusters:
    """Clusters as watersheds of the smoothed normal forces; thresholds of forces are in force units.

    Attributes:
        merge_share: two clusters are one if the saddle between them is above this share of the lower peak,
            unless nodes without force lie between them: a strong contact fills a gap of two nodes when its
            forces are smoothed.
        floor_share: nodes below this share of the highest smoothed force belong to no cluster.
        floor: nodes below this smoothed force belong to no cluster.
        min_share: least normal force of a cluster over that of the strongest one, which may be beyond the
            markers. With 0.04, presses of 2 to 4 % were left out whose forces were within 5 %; 0.01 adds no
            false contact (ADR 158).
        min_share_if_assumed: the same on an assumed sheet, which causes forces in proportion to that one.
    """

    merge_share: float = 0.75
    floor_share: float = 0.002
    floor: float = 2e-6
    min_share: float = 0.01
    min_share_if_assumed: float = 0.04

    def __call__(
        self, nodes: ForceNodes, force_mm2: Nodal, *, beyond_mm2: float = 0.0, is_assumed: bool = False
    ) -> Clusters:
        """The clusters of nodal forces.

        Args:
            nodes: of the sheet.
            force_mm2: (n, 3) forces over E, sheet frame; 0 where no contact is found.
            beyond_mm2: sum of the normal forces over E beyond the markers; positive if they press.
            is_assumed: whether the sheet is assumed.
        """
        nodal_mm2 = np.maximum(-force_mm2[:, 2], 0.0).reshape(nodes.shape)
        clusters = cluster_moments(nodes, force_mm2, self._labels(nodes, nodal_mm2))
        strongest_mm2 = float(clusters.normal_mm2.max(initial=max(beyond_mm2, 0.0)))
        share = self.min_share_if_assumed if is_assumed else self.min_share
        least_mm2 = max(nodes.least_force_mm2, share * strongest_mm2)
        is_inner = nodes.inside_mm(clusters.centre_mm) >= 0.0
        order = np.argsort(-clusters.normal_mm2, kind="stable")
        return clusters.select(order[(is_inner & (clusters.normal_mm2 >= least_mm2))[order]])

    def _labels(
        self, nodes: ForceNodes, nodal_mm2: Float64[np.ndarray, "rows columns"]
    ) -> Int64[np.ndarray, " nodes"]:
        """(nodes,) cluster of each node, from the forces of the nodes, or -1."""
        from manytouch.estimation.watershed import watershed

        press_mm2 = smooth(nodal_mm2)
        floor_mm2 = max(self.floor_share * float(press_mm2.max()), self.floor * nodes.force_unit_mm2)
        merged, _ = watershed(press_mm2, floor_mm2, self.merge_share)
        each, peaks = watershed(press_mm2, floor_mm2, _NEVER_MERGED)
        if len(peaks) <= merged.max() + 1:
            return np.asarray(merged.ravel())
        loaded, _ = watershed((nodal_mm2 > floor_mm2).astype(np.float64), 0.5, 0.0)
        own = maximum_position(nodal_mm2, each, np.arange(len(peaks)))
        island = loaded[tuple(np.transpose(own))]
        is_any = each >= 0
        pairs = np.column_stack([merged[is_any], island[each[is_any]]])
        label = np.full(nodal_mm2.shape, -1, dtype=np.int64)
        label[is_any] = np.unique(pairs, axis=0, return_inverse=True)[1].ravel()
        return label.ravel()


def cluster_moments(nodes: ForceNodes, force_mm2: Nodal, label: Int64[np.ndarray, " nodes"]) -> Clusters:
    """Clusters of labelled nodes (n,), label -1 for none; tensile normal forces count as 0."""
    count = int(label.max(initial=-1)) + 1
    node = np.flatnonzero(label >= 0)
    at, place, force = label[node], nodes.place_mm[node], force_mm2[node]
    press = np.maximum(-force[:, 2], 0.0)

    def summed(value: np.ndarray) -> np.ndarray:
        return np.bincount(at, value, minlength=count).astype(np.float64)

    total = np.maximum(summed(press), np.finfo(np.float64).tiny)
    centre = np.column_stack([summed(press * place[:, axis]) for axis in range(2)]) / total[:, None]
    arm = place - centre[at]
    spread = np.empty((count, 2, 2))
    for axis in range(2):
        spread[:, axis, axis] = summed(press * arm[:, axis] ** 2) / total - nodes.own_spread_mm2[axis]
    spread[:, 0, 1] = spread[:, 1, 0] = summed(press * arm[:, 0] * arm[:, 1]) / total
    # The spread of forces on three nodes can be less than that of any load.
    narrow = np.minimum(np.linalg.eigvalsh(spread)[:, 0], 0.0) if count else np.zeros(0)
    spread -= narrow[:, None, None] * np.eye(2)
    return Clusters.of_forces(
        centre_mm=centre,
        force_mm2=np.column_stack([summed(force[:, 0]), summed(force[:, 1]), -total]),
        torque_mm3=summed(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]),
        spread_mm2=spread,
        label=label,
    )


def nearest_within(
    centre_mm: Points2, place_mm: Float64[np.ndarray, "p 2"], reach_mm: float
) -> Int64[np.ndarray, " c"]:
    """(c,) number of the place nearest to each centre, or -1 if it is too far."""
    if len(place_mm) == 0:
        return np.full(len(centre_mm), -1, dtype=np.int64)
    away_mm = np.linalg.norm(centre_mm[:, None] - place_mm, axis=2)
    nearest = away_mm.argmin(axis=1)
    return np.where(away_mm.min(axis=1) <= reach_mm, nearest, -1).astype(np.int64)
