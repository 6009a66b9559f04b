"""Clusters of forces that are one rigid object, which presses with its corners or its edge only.

Under a flat face the sheet is nowhere above the straight line between two places that press;
between two objects on a taut sheet it is. On a slack sheet, whose hollow joins distant contacts, this does
not decide. Two clusters are therefore joined where a bar explains the markers as well as two patches do
(`bars`). A face that presses with its ends only is the same load as two balls: two clusters that are not near
each other, or three that are not in a row, are joined if they began together and are about as deep and as
strong. Four or more are joined if their depths are on one plane, unless two of them were contacts before.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from manytouch.estimation.mechanics.clusters.bars import BarRule
from manytouch.estimation.mechanics.clusters.evidence import EvidenceAt
from manytouch.estimation.mechanics.clusters.face_fits import CORNERS
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters, EarlierClusters
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.markers.images import Face
from manytouch.values.arrays import Points2, Scalars

_PLACES = np.linspace(0.0, 1.0, 17)
_PLANE = 4  # clusters from which on their depths are not on one plane by chance
_ROW = 0.1  # width of a row of clusters over its length


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RigidFaces:
    """Parameters of the joining.

    Attributes:
        max_plane_thickness: neighbours among clusters on a plane or in a row are at most so far apart, in
            thicknesses.
        max_pair_thickness: two clusters of one face are at most so far apart, in thicknesses.
        resolved_thickness: at this distance two contacts are not seen as one when they begin, in thicknesses;
            on nearer ones only the markers decide, where they can.
        kept_thickness: the same for two that continue one contact, which stays one from here on if they are
            about as deep and as strong: chosen between balls 3.0 thicknesses apart, which can begin as one,
            and blocks and cylinders that come to press with ends 3.4 to 4.0 apart.
        min_pair_elements: other clusters that are nearer to each other are joined only if they continue one
            contact, in elements.
        same_centre_pitch: clusters continue a contact of the previous frame if the centre of their forces is
            within this distance of its centre, in pitches.
        unchanged_thickness: least distance of two clusters for `max_growth`, in thicknesses. Two balls 2.0
            thicknesses apart can be one contact while their force grows; ends of cylinders are 2.5 and more.
        max_growth: two clusters that continue one contact stay one as long as their force is at most this
            factor of that with which the markers last showed one, unless these clearly show two.
        released: at this share of that force they stay one whatever the markers show. Both were chosen on
            cylinders and blocks that are held and released (ADR 124).
        rise_mm, rise_share: the sheet between two places of one face may be this much less deep than the line
            between them, in mm and over their depth; the error of the shape.
        pair_rise_share: like `rise_share`, of a pair that the markers may show to be one bar.
        min_force_ratio: least ratio of the forces of two or three clusters.
        max_depth_ratio: largest difference of their depths, over the deeper one.
        plane_share: largest distance of the depths of four clusters or more from a plane, over their depth.
        reach_pitch: a contact of the previous frame within this distance is the same, in pitches.
        edge_share: part of the half extent of the pressure at an end that lies within the face, whose edge
            presses most; fitted to punches on 3-D solids.
        max_edge_mm: largest part of that half extent that lies within the face.
        bars: decides by the markers whether a pair is one bar.
    """

    max_plane_thickness: float = 12.0
    max_pair_thickness: float = 20.0
    resolved_thickness: float = 4.0
    kept_thickness: float = 3.2
    min_pair_elements: float = 4.5
    same_centre_pitch: float = 0.4
    unchanged_thickness: float = 2.3
    max_growth: float = 1.1
    released: float = 0.8
    rise_mm: float = 0.004
    rise_share: float = 0.015
    pair_rise_share: float = 0.04
    min_force_ratio: float = 0.3
    max_depth_ratio: float = 0.06
    plane_share: float = 0.06
    reach_pitch: float = 1.5
    edge_share: float = 0.5
    max_edge_mm: float = 2.0
    bars: BarRule = field(default_factory=BarRule)

    def __call__(
        self,
        model: InversionModel,
        coefficient_mm: Nodal,
        clusters: Clusters,
        evidence_at: EvidenceAt,
        previous_mm: Float64[np.ndarray, "p 2"],
        *,
        earlier: EarlierClusters,
    ) -> Clusters:
        """The clusters with those of one face joined, the strongest first.

        Args:
            model: of the sheet.
            coefficient_mm: (nodes, 3) shape of the sheet.
            clusters: of this frame.
            evidence_at: gives the likelihood of the forces of some nodes.
            previous_mm: (k, 2) centres of the contacts of the previous frame.
            earlier: clusters of the previous frame.
        """
        count = len(clusters)
        if count < 2:
            return clusters
        depth_mm, is_flat, is_about_flat = self._flat_pairs(model, coefficient_mm, clusters.centre_mm)
        before = _nearest_within(clusters.centre_mm, previous_mm, self.reach_pitch * model.pitch_mm)
        was_apart = (before[:, None] >= 0) & (before >= 0) & (before[:, None] != before)
        joined, is_done = clusters, np.zeros(count, dtype=np.bool_)
        for group in _components(is_flat):
            for own in self._without_weak(clusters, group, _PLANE - 1):
                if not was_apart[np.ix_(own, own)].any() and self._is_plane(clusters, depth_mm, own):
                    face = self._with_enclosed(model, clusters, own, group)
                    joined, is_done[face] = self._join(joined, clusters, face), True
                    break
        are_alike = is_about_flat & self._are_alike(clusters, depth_mm)
        for is_one, least in ((are_alike, 3), (is_about_flat, 2)):
            for group in _components(is_one & ~is_done & ~is_done[:, None], least):
                for own in self._without_weak(clusters, group, least):
                    was_two = bool(was_apart[np.ix_(own, own)].any())
                    if self._is_one(
                        model, clusters, depth_mm, own, previous_mm, evidence_at=evidence_at, was_two=was_two
                    ):
                        face = self._with_enclosed(model, clusters, own, group)
                        joined, is_done[face] = self._join(joined, clusters, face), True
                        break
        is_left = is_about_flat & ~was_apart & ~is_done & ~is_done[:, None]
        for own in self._unchanged(model, clusters, is_left, earlier, evidence_at=evidence_at):
            if not is_done[own].any():
                face = self._with_enclosed(model, clusters, own, np.flatnonzero(~is_done))
                joined, is_done[face] = self._join(joined, clusters, face, as_before=True), True
        kept = np.flatnonzero(joined.force_mm2[:, 2] != 0.0)
        order = kept[np.argsort(-joined.normal_mm2[kept], kind="stable")]
        return joined.select(order)

    def _flat_pairs(
        self, model: InversionModel, coefficient_mm: Nodal, centre_mm: Points2
    ) -> tuple[Scalars, np.ndarray, np.ndarray]:
        """Depth (c,) at the centres; (c, c) pairs with the sheet as deep as the line between, or about so."""
        first, second = np.triu_indices(len(centre_mm), 1)
        along = centre_mm[first, None] + _PLACES[:, None] * (centre_mm[second] - centre_mm[first])[:, None]
        face = Face(shell=model.shell, point_mm=np.ascontiguousarray(along.reshape(-1, 2)))
        found_mm = -face.displacement(coefficient_mm)[:, 2].reshape(len(first), len(_PLACES))
        line_mm = found_mm[:, :1] + _PLACES * (found_mm[:, -1:] - found_mm[:, :1])
        rise_mm = (line_mm - found_mm).max(axis=1)
        deepest_mm = np.maximum(found_mm[:, 0], found_mm[:, -1])
        away_mm = np.linalg.norm(centre_mm[second] - centre_mm[first], axis=1)
        pairs = np.zeros((2, len(centre_mm), len(centre_mm)), dtype=np.bool_)
        limits = (self.rise_share, self.max_plane_thickness), (self.pair_rise_share, self.max_pair_thickness)
        for found, (share, thicknesses) in zip(pairs, limits, strict=True):
            is_flat = rise_mm <= self.rise_mm + share * deepest_mm
            is_flat &= away_mm <= thicknesses * model.thickness_mm
            found[first, second] = found[second, first] = is_flat
        depth_mm = np.empty(len(centre_mm))
        depth_mm[first], depth_mm[second] = found_mm[:, 0], found_mm[:, -1]
        return depth_mm, pairs[0], pairs[1]

    def _unchanged(
        self,
        model: InversionModel,
        clusters: Clusters,
        is_pair: np.ndarray,
        earlier: EarlierClusters,
        *,
        evidence_at: EvidenceAt,
    ) -> Iterator[Int64[np.ndarray, "2"]]:
        """Near pairs that stay one: without more force than when the markers showed one, nothing is new."""
        for pair in np.argwhere(np.triu(is_pair, 1)):
            own = pair[np.argsort(-clusters.normal_mm2[pair], kind="stable")]
            force_mm2, place_mm = clusters.normal_mm2[own], clusters.centre_mm[own]
            gap = float(np.linalg.norm(place_mm[1] - place_mm[0])) / model.thickness_mm
            is_near = self.unchanged_thickness <= gap < self.resolved_thickness
            is_even = force_mm2[1] >= self.min_force_ratio * force_mm2[0]
            centre_mm = force_mm2 @ place_mm / force_mm2.sum()
            before = earlier.nearest(centre_mm, self.same_centre_pitch * model.pitch_mm)
            one_mm2 = 0.0 if before is None else float(earlier.one_mm2[before])
            if not (is_near and is_even and force_mm2.sum() <= self.max_growth * one_mm2):
                continue
            is_released = force_mm2.sum() <= self.released * one_mm2
            decide = {"was_two": False, "was_one": True, "is_unchanged": True}
            if is_released or self.bars(model, clusters, own, evidence_at, **decide) is not False:
                yield own

    def _are_alike(self, clusters: Clusters, depth_mm: Scalars) -> np.ndarray:
        """(c, c) pairs that are about as deep and as strong."""
        force_mm2 = clusters.normal_mm2
        ratio = np.minimum.outer(force_mm2, force_mm2) / np.maximum.outer(force_mm2, force_mm2)
        off_mm = np.abs(np.subtract.outer(depth_mm, depth_mm))
        limit_mm = self.max_depth_ratio * np.maximum.outer(depth_mm, depth_mm) + self.rise_mm
        return np.asarray((ratio >= self.min_force_ratio) & (off_mm <= limit_mm))

    def _is_plane(self, clusters: Clusters, depth_mm: Scalars, own: Int64[np.ndarray, " k"]) -> bool:
        """Do four clusters or more, or three in a row, lie on one plane?"""
        place, depth = clusters.centre_mm[own], depth_mm[own]
        if len(own) < _PLANE - 1:
            return False
        arm = place - place.mean(axis=0)
        extent = np.linalg.svd(arm, compute_uv=False)
        is_row = extent[1] <= _ROW * extent[0]
        if len(own) < _PLANE and not is_row:
            return False
        off = depth - depth.mean()
        off -= arm @ np.linalg.lstsq(arm, off, rcond=_ROW if is_row else None)[0]
        return bool(np.abs(off).max() <= self.plane_share * depth.max() + 2.0 * self.rise_mm)

    def _is_one(
        self,
        model: InversionModel,
        clusters: Clusters,
        depth_mm: Scalars,
        own: Int64[np.ndarray, " k"],
        previous_mm: Float64[np.ndarray, "p 2"],
        *,
        evidence_at: EvidenceAt,
        was_two: bool,
    ) -> bool:
        """Are two clusters, or three, one face? The markers decide on near pairs, and can do so on others."""
        was_one = not was_two and self._continues_one(model, clusters, own, previous_mm)
        if len(own) == 2:
            is_bar = self.bars(model, clusters, own, evidence_at, was_two=was_two, was_one=was_one)
            gap_mm = float(np.linalg.norm(clusters.centre_mm[own[1]] - clusters.centre_mm[own[0]]))
            least = self.kept_thickness if was_one else self.resolved_thickness
            if is_bar or (is_bar is False and gap_mm < least * model.thickness_mm):
                return bool(is_bar)
        return not was_two and self._is_pair(model, clusters, depth_mm, own, was_one=was_one)

    def _continues_one(
        self,
        model: InversionModel,
        clusters: Clusters,
        own: Int64[np.ndarray, " k"],
        previous_mm: Float64[np.ndarray, "p 2"],
    ) -> bool:
        """Was there a contact at the centre of their forces?"""
        force = clusters.normal_mm2[own]
        away_mm = np.linalg.norm(previous_mm - force @ clusters.centre_mm[own] / force.sum(), axis=1)
        return bool((away_mm < self.same_centre_pitch * model.pitch_mm).any())

    def _is_pair(
        self,
        model: InversionModel,
        clusters: Clusters,
        depth_mm: Scalars,
        own: Int64[np.ndarray, " k"],
        *,
        was_one: bool,
    ) -> bool:
        """Are two clusters, or three, about as deep and as strong, and clearly apart or of one contact?"""
        depth, force = depth_mm[own], clusters.normal_mm2[own]
        extent_mm = float(np.linalg.norm(np.ptp(clusters.centre_mm[own], axis=0)))
        return bool(
            len(own) < _PLANE
            and (was_one or extent_mm >= self.min_pair_elements * float(model.nodes.element_mm.max()))
            and force.min() >= self.min_force_ratio * force.max()
            and depth.max() - depth.min() <= self.max_depth_ratio * depth.max() + self.rise_mm
        )

    def _without_weak(
        self, clusters: Clusters, own: Int64[np.ndarray, " k"], least: int
    ) -> Iterator[Int64[np.ndarray, " _"]]:
        """The group, then without its weakest cluster, and so on while that is much weaker than the others.

        Errors of the sensor file cause weak forces near a face, or between its ends.
        """
        own = own[np.argsort(-clusters.normal_mm2[own], kind="stable")]
        force = clusters.normal_mm2[own]
        for count in range(len(own), least - 1, -1):
            yield own[:count]
            if force[count - 1] >= self.min_force_ratio * force[0]:
                return

    def _with_enclosed(
        self,
        model: InversionModel,
        clusters: Clusters,
        own: Int64[np.ndarray, " k"],
        group: Int64[np.ndarray, " g"],
    ) -> Int64[np.ndarray, " _"]:
        """The clusters of a face with those of the group within the ellipse of its pressure."""
        share = clusters.normal_mm2[own] / clusters.normal_mm2[own].sum()
        centre_mm, spread = _joint_moments(clusters, own, share)
        arm_mm = clusters.centre_mm[group] - centre_mm
        spread += np.diag(model.nodes.own_spread_mm2)
        within = np.einsum("ki,ki->k", arm_mm, np.linalg.solve(spread, arm_mm.T).T) <= 4.0
        return np.union1d(own, group[within])

    def _join(
        self,
        result: Clusters,
        clusters: Clusters,
        own: Int64[np.ndarray, " k"],
        *,
        as_before: bool = False,
    ) -> Clusters:
        """`result` with clusters joined to the first of them; the others get no force."""
        share = clusters.normal_mm2[own] / clusters.normal_mm2[own].sum()
        centre_mm, spread = _joint_moments(clusters, own, share)
        arm = clusters.centre_mm[own] - centre_mm
        force_mm2 = clusters.force_mm2[own].sum(axis=0)
        turned = arm[:, 0] * clusters.force_mm2[own, 1] - arm[:, 1] * clusters.force_mm2[own, 0]
        covariance = _joint_covariance(clusters.covariance[own], share)
        first, others = own[0], own[1:]

        def changed(old: np.ndarray, new: np.ndarray | float) -> np.ndarray:
            copy = old.copy()
            copy[first] = new
            return copy

        force = changed(result.force_mm2, force_mm2)
        force[others] = 0.0
        label = result.label.copy()
        label[np.isin(label, others)] = first
        return replace(
            result,
            centre_mm=changed(result.centre_mm, centre_mm),
            force_mm2=force,
            torque_mm3=changed(result.torque_mm3, float((clusters.torque_mm3[own] + turned).sum())),
            spread_mm2=changed(result.spread_mm2, spread),
            covariance=changed(result.covariance, covariance),
            label=label,
            is_face=changed(result.is_face, True),
            corner_points_mm=(
                *result.corner_points_mm[:first],
                _rectangle(centre_mm, spread) if len(own) == 2 else self._corner_points(clusters, own),
                *result.corner_points_mm[first + 1 :],
            ),
            is_one_as_before=changed(result.is_one_as_before, as_before),
        )

    def _corner_points(self, clusters: Clusters, own: Int64[np.ndarray, " k"]) -> Float64[np.ndarray, "_ 2"]:
        """Points around each place where a face presses.

        The pressure is highest at the edge, so that only a part of its extent lies within the face.
        """
        size, axes = np.linalg.eigh(clusters.spread_mm2[own])
        half_mm = self.edge_share * 2.0 * np.sqrt(np.maximum(size, 0.0))
        arm_mm = axes.transpose(0, 2, 1) * np.minimum(half_mm, self.max_edge_mm)[:, :, None]
        around_mm = clusters.centre_mm[own][:, None] + np.concatenate([arm_mm, -arm_mm], axis=1)
        return np.asarray(around_mm.reshape(-1, 2))


def _joint_moments(
    clusters: Clusters, own: Int64[np.ndarray, " k"], share: Scalars
) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2 2"]]:
    """Centre and second moments of the pressure of several clusters with these shares of the force."""
    centre_mm = share @ clusters.centre_mm[own]
    arm = clusters.centre_mm[own] - centre_mm
    spread = np.einsum("k,kij->ij", share, clusters.spread_mm2[own] + arm[:, :, None] * arm[:, None, :])
    return centre_mm, spread


def _rectangle(
    centre_mm: Float64[np.ndarray, "2"], spread_mm2: Float64[np.ndarray, "2 2"]
) -> Float64[np.ndarray, "4 2"]:
    """Corners of the rectangular face under a pressure with these second moments.

    Two places do not show the width of a face. A side has the length of 2 roots of the second moment if only
    the corners press, and of 2 sqrt(3) roots if the pressure is even; this is the geometric mean.
    """
    size, axes = np.linalg.eigh(spread_mm2)
    half_mm = 3.0**0.25 * np.sqrt(np.maximum(size, 0.0))
    return np.asarray(centre_mm + (CORNERS * half_mm) @ axes.T)


def _components(is_joined: np.ndarray, least: int = 2) -> list[Int64[np.ndarray, " k"]]:
    """Connected groups of so many clusters or more."""
    if not is_joined.any():
        return []
    groups, label = connected_components(csr_array(is_joined), directed=False)
    found = [np.flatnonzero(label == group) for group in range(groups)]
    return [own for own in found if len(own) >= least]


def _nearest_within(
    centre_mm: Points2, place_mm: Float64[np.ndarray, "p 2"], reach_mm: float
) -> Int64[np.ndarray, " c"]:
    """(c,) number of the place nearest to each centre, or -1 if it is too far."""
    if len(place_mm) == 0:
        return np.full(len(centre_mm), -1, dtype=np.int64)
    away_mm = np.linalg.norm(centre_mm[:, None] - place_mm, axis=2)
    nearest = away_mm.argmin(axis=1)
    return np.where(away_mm.min(axis=1) <= reach_mm, nearest, -1).astype(np.int64)


def _joint_covariance(each: Float64[np.ndarray, "k 6 6"], share: Scalars) -> Float64[np.ndarray, "6 6"]:
    """Covariance of the sum of forces, and of the means of the other estimates, with independent errors."""
    if np.isnan(each).any():
        return np.full((6, 6), np.nan)
    total = np.zeros((6, 6))
    scale = np.ones((len(share), 6))
    scale[:, 1:] = share[:, None]
    for part, covariance in zip(scale, each, strict=True):
        total += part[:, None] * covariance * part
    return total
