"""Finds the clusters of forces under one rigid object, which presses with its corners or its edge only.

Between two places where a rigid flat face presses, the sheet is nowhere less deep than the straight line
between them. Between two objects on a taut sheet it is less deep. On a slack sheet, where the hollow of one
contact reaches another one, it need not be, so that this condition is necessary but not sufficient. In
addition, clusters that fulfil it are joined ("as strong" is by the depth that a force would cause alone, as a
sheet gives way less near a clamp)

- if there are four or more, their depths are on one plane, and the sheet is flat between each and two others,
  unless two of them have been contacts for some time;
- if there are three in a row whose depths are on one line, unless two of them were contacts in the previous
  frame;
- if there are two, and a bar explains the markers as well as two patches do (`bars`);
- if there are two, about as deep and as strong, and long across the line between them, as edges are;
- if there are two that are not near each other, or three that are not in a row, and they began together and
  are about as deep and as strong: a face that presses with its ends only is nearly the same load as two
  balls. Two are not one if the markers clearly show balls;
- if there are two that the markers showed as one contact before, and their force has not grown since, for
  which two of these limits are wider;
- if two among others were one contact in the previous frame, and would be one if they were alone.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float64, Int64

from manytouch.estimation.mechanics.clusters.bars import BarRule
from manytouch.estimation.mechanics.clusters.evidence import EvidenceAt
from manytouch.estimation.mechanics.clusters.force_clusters import (
    Clusters,
    EarlierClusters,
    PreviousContacts,
    nearest_within,
)
from manytouch.estimation.mechanics.clusters.joined_clusters import (
    connected_groups,
    depths_and_rises,
    is_between,
    is_in_none,
    join_clusters,
    moments_of_pair,
    off_plane,
    with_enclosed,
    without_weak,
)
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Scalars

_PLANE = 4  # least number of clusters whose depths are not on one plane by chance

Pairs = Bool[np.ndarray, "c c"]
Numbers = Int64[np.ndarray, " k"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Frame:
    """The clusters of a frame, and what decides which of them are under one face.

    Attributes:
        model: of the sheet.
        clusters: before any are joined.
        depth_mm: (c,) depth of the sheet at their centres.
        rise_mm: (c, c) by how much the sheet between two of them is less deep than the line.
        alone_mm: (c,) depths that their forces would cause one by one on the sheet at rest.
        age_s: (c,) for how long there has been a contact at their centres; 0 where there was none.
        was_apart: (c, c) pairs that were two contacts in the previous frame.
        was_long_apart: (c, c) those of them that have been for more than `RigidFaces.undecided_s`.
        previous, earlier: contacts and clusters of the previous frame.
        evidence_at: gives the likelihood of the forces of some nodes.
    """

    model: InversionModel
    clusters: Clusters
    depth_mm: Scalars
    rise_mm: Float64[np.ndarray, "c c"]
    alone_mm: Scalars
    age_s: Scalars
    was_apart: Pairs
    was_long_apart: Pairs
    previous: PreviousContacts
    earlier: EarlierClusters
    evidence_at: EvidenceAt


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RigidFaces:
    """Joins the clusters under one rigid face.

    Distances that end in `_thickness` are in thicknesses of the sheet.

    Attributes:
        max_plane_thickness: largest distance of neighbours among clusters on a plane or in a row.
        max_pair_thickness: largest distance of two clusters of one face.
        resolved_thickness: two contacts at this distance are seen as two when they begin. On nearer ones only
            the markers decide, where they can.
        kept_thickness: the same for two clusters that continue one contact. Chosen between balls 3.0
            thicknesses apart, which can begin as one, and blocks and cylinders that come to press with ends
            3.4 to 4.0 apart.
        min_pair_elements: least distance of two or three clusters that began together, in elements; nearer
            ones are joined only if they continue one contact.
        undecided_s: four clusters or more may be one face as long as no two of them were contacts, one for
            longer than this: its corners need not be seen at once. Compared were 0, 3, 5 and 8 frames of
            1/15 s. Two or three clusters began together if these times differ by no more.
        same_centre_pitch: clusters continue a contact of the previous frame if the centre of their forces is
            within this distance of its centre, in pitches.
        max_jump: two clusters among others of which one is about as deep, or far apart with a contact between
            them, continue that contact if their force is at most this factor of its force. A fainter one may
            have been seen as one only because it was faint.
        min_between: least distance of that contact from either of them, over their distance.
        unchanged_thickness: least distance of two clusters for `max_growth`. Two balls 2.0 thicknesses apart
            can be one contact while their force grows; ends of cylinders are 2.5 and more apart.
        max_growth: two clusters that continue one contact stay one as long as their force is at most this
            factor of that with which the markers last showed one, unless they are near each other and the
            markers clearly show two.
        released: below this share of that force they stay one whatever the markers show. Both factors were
            chosen on cylinders and blocks that are held and released (ADR 124).
        rise_mm, rise_share: by how much the sheet under one face may be less deep than the line between two
            places, in mm and over the larger depth: the error of the shape.
        pair_rise_share: like `rise_share`, for a pair that the markers may show to be one bar.
        kept_rise_share: the same if they were one contact and their force has not grown. Chosen on one bar.
        edge_thickness, edge_ratio: two clusters are edges of one face if the pressure of both has at least
            this standard deviation across the line between them, in thicknesses (shorter edges look like
            balls), and this one over that along it. Fingertips have a ratio of at most 1.6.
        min_alone_ratio: least ratio of the depths that the forces of clusters of one face would cause alone.
        min_kept_alone_ratio: the same if they were one contact and their force has not grown: another object
            may relieve one end. Chosen on three rods, sheets of 2 to 3.8 mm (ADR 174).
        max_depth_ratio, max_kept_depth_ratio: largest difference of the depths of two or three clusters, over
            the deepest one; the latter if they continue one contact, as a body may tilt.
        plane_share: largest distance of the depths of four clusters or more from a plane, over their depth.
        reach_pitch: a cluster is the contact of the previous frame that is nearest to it, if that is within
            this distance, in pitches.
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
    undecided_s: float = 0.23
    same_centre_pitch: float = 0.4
    max_jump: float = 2.0
    min_between: float = 0.15
    unchanged_thickness: float = 2.3
    max_growth: float = 1.1
    released: float = 0.8
    rise_mm: float = 0.004
    rise_share: float = 0.015
    pair_rise_share: float = 0.04
    kept_rise_share: float = 0.08
    edge_thickness: float = 0.75
    edge_ratio: float = 2.0
    min_alone_ratio: float = 0.3
    min_kept_alone_ratio: float = 0.1
    max_depth_ratio: float = 0.06
    max_kept_depth_ratio: float = 0.12
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
        previous: PreviousContacts,
        *,
        earlier: EarlierClusters,
    ) -> Clusters:
        """The clusters with those of one face joined, the strongest first.

        Args:
            model: of the sheet.
            coefficient_mm: (nodes, 3) shape of the sheet.
            clusters: of this frame.
            evidence_at: gives the likelihood of the forces of some nodes.
            previous, earlier: contacts and clusters of the previous frame.
        """
        if len(clusters) < 2:
            return clusters
        frame = self._frame(model, coefficient_mm, clusters, evidence_at, previous, earlier=earlier)
        is_flat = self._are_flat(frame, self.rise_share, self.max_plane_thickness)
        is_about_flat = self._are_flat(frame, self.pair_rise_share, self.max_pair_thickness)
        is_kept_flat = self._are_flat(frame, self.kept_rise_share, self.max_pair_thickness)
        for pair in np.argwhere(np.triu(is_kept_flat & ~is_about_flat & ~frame.was_apart)):
            is_about_flat[pair, pair[::-1]] = self._growth(frame, pair) <= self.max_growth
        faces = self._planes(frame, is_flat)
        for is_one, least in ((is_about_flat & self._are_alike(frame), 3), (is_about_flat, 2)):
            is_left = is_in_none(faces, len(clusters))
            faces += self._pairs_and_triples(frame, is_one & is_left & is_left[:, None], least)
        kept_faces = self._unchanged_faces(frame, is_about_flat & ~frame.was_apart, faces)
        joined, edge = clusters, (self.edge_share, self.max_edge_mm)
        for number, own in enumerate(faces + kept_faces):
            joined = join_clusters(joined, clusters, own, edge, is_one_as_before=number >= len(faces))
        kept = np.flatnonzero(joined.force_mm2[:, 2] != 0.0)
        return joined.select(kept[np.argsort(-joined.normal_mm2[kept], kind="stable")])

    def _frame(
        self,
        model: InversionModel,
        coefficient_mm: Nodal,
        clusters: Clusters,
        evidence_at: EvidenceAt,
        previous: PreviousContacts,
        *,
        earlier: EarlierClusters,
    ) -> _Frame:
        depth_mm, rise_mm = depths_and_rises(model.shell, coefficient_mm, clusters.centre_mm)
        near, same = (
            nearest_within(clusters.centre_mm, previous.centre_mm, reach_pitch * model.pitch_mm)
            for reach_pitch in (self.reach_pitch, self.same_centre_pitch)
        )
        was_apart = (near[:, None] >= 0) & (near >= 0) & (near[:, None] != near)
        age_s = np.append(previous.age_s, 0.0)
        longer_s = np.maximum.outer(age_s[near], age_s[near])
        return _Frame(
            model=model,
            clusters=clusters,
            depth_mm=depth_mm,
            rise_mm=rise_mm,
            alone_mm=clusters.normal_mm2 * model.compliance_per_mm(clusters.centre_mm),
            age_s=age_s[same],
            was_apart=was_apart,
            was_long_apart=was_apart & (longer_s > self.undecided_s),
            previous=previous,
            earlier=earlier,
            evidence_at=evidence_at,
        )

    def _planes(self, frame: _Frame, is_flat: Pairs) -> list[Numbers]:
        """Faces of four clusters or more, or of three in a row, whose depths are on one plane."""
        faces = []
        for group in connected_groups(is_flat):
            for own in without_weak(frame.alone_mm, group, _PLANE - 1, self.min_alone_ratio):
                apart = frame.was_apart if len(own) < _PLANE else frame.was_long_apart
                if not apart[np.ix_(own, own)].any() and self._is_plane(frame, own, is_flat):
                    faces.append(with_enclosed(frame.clusters, frame.model.nodes, own, group))
                    break
        return faces

    def _pairs_and_triples(self, frame: _Frame, is_one: Pairs, least: int) -> list[Numbers]:
        """Faces of `least` clusters or more among groups of pairs that may be of one face."""
        faces = []
        for group in connected_groups(is_one, least):
            for own in without_weak(frame.alone_mm, group, least, self.min_alone_ratio):
                if self._is_one(frame, own):
                    faces.append(with_enclosed(frame.clusters, frame.model.nodes, own, group))
                    break
            else:
                faces += self._kept_pairs(frame, is_one, group) if least == 2 and len(group) > 2 else []
        return faces

    def _kept_pairs(self, frame: _Frame, is_one: Pairs, group: Int64[np.ndarray, " g"]) -> list[Numbers]:
        """Faces of the pairs of a group that were one contact in the previous frame, the nearest first."""
        first, second = group[np.stack(np.triu_indices(len(group), 1))]
        pairs = np.column_stack([first, second])[(is_one & ~frame.was_apart)[first, second]]
        away_mm = np.linalg.norm(np.diff(frame.clusters.centre_mm[pairs], axis=1)[:, 0], axis=1)
        faces: list[Numbers] = []
        is_level = self._are_level(frame)
        for pair in pairs[np.argsort(away_mm, kind="stable")]:
            own = pair[np.argsort(-frame.clusters.normal_mm2[pair], kind="stable")]
            left = group[is_in_none(faces, len(frame.clusters))[group]]
            is_left = np.isin(own, left).all()
            max_jump = self.max_jump if is_level[np.ix_(own, np.setdiff1d(group, own))].any() else np.inf
            if is_left and self._continues_one(frame, own, max_jump) and self._is_one(frame, own):
                faces.append(with_enclosed(frame.clusters, frame.model.nodes, own, left))
        return faces

    def _unchanged_faces(self, frame: _Frame, is_pair: Pairs, others: list[Numbers]) -> list[Numbers]:
        """Faces of the pairs that stay one contact, of the clusters that are in none of the others."""
        faces: list[Numbers] = []
        is_left = is_in_none(others, len(frame.clusters))
        for pair in np.argwhere(np.triu(is_pair, 1)):
            own = pair[np.argsort(-frame.clusters.normal_mm2[pair], kind="stable")]
            if is_left[own].all() and self._is_unchanged(frame, own):
                faces.append(with_enclosed(frame.clusters, frame.model.nodes, own, np.flatnonzero(is_left)))
                is_left[faces[-1]] = False
        return faces

    def _are_flat(self, frame: _Frame, share: float, max_thickness: float) -> Pairs:
        """(c, c) pairs within a distance, between which the sheet is about as deep as the line."""
        centre_mm = frame.clusters.centre_mm
        most_mm = self.rise_mm + share * np.maximum.outer(frame.depth_mm, frame.depth_mm)
        away_mm = np.linalg.norm(centre_mm[:, None] - centre_mm, axis=2)
        return np.asarray((away_mm <= max_thickness * frame.model.thickness_mm) & (frame.rise_mm <= most_mm))

    def _is_unchanged(self, frame: _Frame, own: Int64[np.ndarray, "2"]) -> bool:
        """Whether a near pair has no more force than when it was seen as one contact; see `max_growth`."""
        gap_mm = float(np.linalg.norm(np.diff(frame.clusters.centre_mm[own], axis=0)))
        is_near = self.unchanged_thickness <= gap_mm / frame.model.thickness_mm < self.resolved_thickness
        is_even = frame.alone_mm[own].min() >= self.min_alone_ratio * frame.alone_mm[own].max()
        growth = self._growth(frame, own)
        if not (is_near and is_even and growth <= self.max_growth):
            return False
        is_released = growth <= self.released
        return is_released or self._is_bar(frame, own, was_one=True, is_unchanged=True) is not False

    def _growth(self, frame: _Frame, own: Numbers) -> float:
        """`EarlierClusters.growth` of clusters."""
        force_mm2, place_mm = frame.clusters.normal_mm2[own], frame.clusters.centre_mm[own]
        reach_mm = self.same_centre_pitch * frame.model.pitch_mm
        return frame.earlier.growth(force_mm2, place_mm, reach_mm)

    def _are_alike(self, frame: _Frame) -> Pairs:
        """(c, c) pairs that are about as deep and as strong."""
        alone_mm = frame.alone_mm
        ratio = np.minimum.outer(alone_mm, alone_mm) / np.maximum.outer(alone_mm, alone_mm)
        return np.asarray((ratio >= self.min_alone_ratio) & self._are_level(frame))

    def _are_level(self, frame: _Frame) -> Pairs:
        """(c, c) pairs that are about as deep."""
        off_mm = np.abs(np.subtract.outer(frame.depth_mm, frame.depth_mm))
        limit_mm = self.max_depth_ratio * np.maximum.outer(frame.depth_mm, frame.depth_mm) + self.rise_mm
        return np.asarray(off_mm <= limit_mm)

    def _is_plane(self, frame: _Frame, own: Numbers, is_flat: Pairs) -> bool:
        """Whether there are four clusters or more, or three in a row, with depths on one plane.

        Of four or more that are not in a row, each is flat with two others, next to a corner or on a rim.
        """
        if len(own) < _PLANE - 1:
            return False
        depth_mm = frame.depth_mm[own]
        is_row, off_mm = off_plane(frame.clusters.centre_mm[own], depth_mm)
        is_closed = len(own) >= _PLANE and int(is_flat[np.ix_(own, own)].sum(axis=1).min()) >= 2
        most_mm = self.plane_share * float(depth_mm.max()) + 2.0 * self.rise_mm
        return (is_row or is_closed) and off_mm <= most_mm

    def _is_one(self, frame: _Frame, own: Numbers) -> bool:
        """Whether two or three clusters are one face.

        The markers decide on near pairs; on distant pairs they can only show that they are one bar.
        """
        was_two = bool(frame.was_apart[np.ix_(own, own)].any())
        was_one = not was_two and self._continues_one(frame, own)
        is_as_before = was_one and self._growth(frame, own) <= self.max_growth
        if len(own) == 2:
            if not was_two and self._are_edges(frame, own):
                return True
            gap_mm = float(np.linalg.norm(np.diff(frame.clusters.centre_mm[own], axis=0)))
            least = self.kept_thickness if was_one else self.resolved_thickness
            is_far = gap_mm >= least * frame.model.thickness_mm
            is_bar = self._is_bar(frame, own, was_two=was_two, was_one=was_one, may_be_ends=is_far)
            if is_bar or (is_bar is not None and not (is_far and is_as_before)):
                return is_bar
        return not was_two and self._began_as_one(frame, own, was_one=was_one, is_as_before=is_as_before)

    def _are_edges(self, frame: _Frame, own: Int64[np.ndarray, "2"]) -> bool:
        """Whether two clusters are alike, and long across the line between."""
        along_mm2, across_mm2 = moments_of_pair(frame.clusters, own)
        least_mm2 = (self.edge_thickness * frame.model.thickness_mm) ** 2
        is_long = across_mm2 >= np.maximum(least_mm2, self.edge_ratio**2 * along_mm2)
        return bool(is_long.all() and self._are_alike(frame)[own[0], own[1]])

    def _is_bar(self, frame: _Frame, own: Numbers, *, was_two: bool = False, **given: bool) -> bool | None:
        """Whether the markers show a pair to be one bar, see `BarRule`; None where they do not decide."""
        return self.bars(frame.model, frame.clusters, own, frame.evidence_at, was_two=was_two, **given)

    def _continues_one(self, frame: _Frame, own: Numbers, max_jump: float = np.inf) -> bool:
        """Whether there was a contact at the centre of the forces of clusters, or between two distant ones.

        Contacts that are nearest to other clusters are not examined, nor those whose force has grown by more
        than a factor; of contacts between two clusters it is `self.max_jump`.
        """
        clusters, previous = frame.clusters, frame.previous
        force, place_mm = clusters.normal_mm2[own], clusters.centre_mm[own]
        if len(previous.centre_mm) == 0:
            return False
        away_mm = np.linalg.norm(previous.centre_mm[:, None] - clusters.centre_mm, axis=2)
        is_own = np.isin(away_mm.argmin(axis=1), own)
        reach_mm = self.same_centre_pitch * frame.model.pitch_mm
        off_mm = np.linalg.norm(previous.centre_mm - force @ place_mm / force.sum(), axis=1)
        is_same = (off_mm < reach_mm) & (force.sum() / max_jump <= previous.normal_mm2)
        gap_mm = float(np.linalg.norm(place_mm[-1] - place_mm[0]))
        if len(own) == 2 and gap_mm >= self.resolved_thickness * frame.model.thickness_mm:
            is_passed = is_between(previous.centre_mm, place_mm, reach_mm, self.min_between)
            is_same |= is_passed & (force.sum() / self.max_jump <= previous.normal_mm2)
        return bool((is_same & is_own).any())

    def _began_as_one(self, frame: _Frame, own: Numbers, *, was_one: bool, is_as_before: bool) -> bool:
        """Whether two or three clusters are alike, and were one contact or began together, far apart."""
        depth_mm, alone_mm = frame.depth_mm[own], frame.alone_mm[own]
        off_share = self.max_kept_depth_ratio if was_one else self.max_depth_ratio
        min_ratio = self.min_kept_alone_ratio if is_as_before else self.min_alone_ratio
        extent_mm = float(np.linalg.norm(np.ptp(frame.clusters.centre_mm[own], axis=0)))
        return bool(
            len(own) < _PLANE
            and (was_one or np.ptp(frame.age_s[own]) <= self.undecided_s)
            and (was_one or extent_mm >= self.min_pair_elements * float(frame.model.nodes.element_mm.max()))
            and alone_mm.min() >= min_ratio * alone_mm.max()
            and np.ptp(depth_mm) <= off_share * depth_mm.max() + self.rise_mm
        )
