"""The number of contacts in a force cluster, one or two, and their centres.

Moments of nodal forces up to the third are those of the load (see `force_clusters`), so they give the centres
of two narrow contacts that share a cluster. Along the longer axis of the cluster let V be the variance minus
that across the axis, and m3 the third central moment. Two points have

    x^2 - (m3 / V) x - V = 0,    shares  -x2 / (x1 - x2)  and  x1 / (x1 - x2)

(K. Pearson 1894, doi:10.1098/rsta.1894.0003, with equal small variances). Objects do not overlap, so two
parts at a distance d have a variance of at most d^2 / 16 each. Two contacts are accepted if two round patches
explain the markers better than one patch of any size and shape, and than a bar (`bars`), by F-tests on their
misfits; the error of the model is in all. The contact of a flat finger thus remains one. See
docs/derivations/inversion.md.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.estimation.mechanics.clusters.bars import MIN_F, MIN_INSIDE, f_of_two
from manytouch.estimation.mechanics.clusters.evidence import Evidence, EvidenceAt
from manytouch.estimation.mechanics.clusters.face_fits import fit_bar, fit_elliptic_face
from manytouch.estimation.mechanics.clusters.fitted_patches import PAIR_PARAMETERS, PairFit, PatchFit
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.force_nodes import ForceNodes, largest_around
from manytouch.geometry.spline.patch import Nodal, SplinePatch
from manytouch.values.arrays import Mask, Points2

_FACE_PARAMETERS = 7  # that are fitted of an elliptic face


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Parts:
    """Two parts of a cluster: centres (2, 2), shares of the force (2,), variance of each along an axis."""

    centre_mm: Points2
    share: np.ndarray
    variance_mm2: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ModelOrder:
    """Splits clusters that are two contacts, and fits the centres of contacts to the markers.

    Attributes:
        trim_share: nodes below this share of the cluster's highest force are left out of its moments.
        min_variance: least V of two contacts, over the squared length of an element.
        min_variance_force: least V of two contacts, over the squared length of an element, times the
            cluster's force in force units; it applies to weak clusters.
        min_share: least share of the force of the weaker part of two contacts, or end of a bar. Errors of the
            model at the clamp are like a weak second contact.
        min_f: least F of two patches against one, with the usual marker noise. It is multiplied by the ratio
            of the noise to the usual one, up to `max_noise`.
        max_noise: largest such factor.
        min_f_face: least F of an elliptic face against an even ellipse.
        min_rim: least second moment of such a face over that under even pressure.
        min_face: least minor half axis of an ellipse that may be a face, in elements.
        min_f_bar: least F of two patches against a bar.
        min_bar_stds: least force of a bar, in its standard deviations; a weaker bar is replaced by one patch.
            Next to a clamp, the place and the force of a bar cannot be determined independently.
        bar_from_clamp: least distance of both ends of a bar from the outline, in elements: a choice. A weak
            second patch next to the outline is an error of the model at the clamp.
        min_inside: least share of the force of a patch, of two, of a bar or a face that lies on the nodes of
            the evidence. Beyond these nodes no marker contradicts it.
        min_mean_misfit: lower limit of the misfit per degree of freedom in F.
        hysteresis: factor of all limits where there were two contacts in the previous frame.
        max_shift: largest distance from the centroid of the nodal forces to the fitted centre, in elements,
            in addition to half the root of the second moment.
        max_ratio: largest ratio of the fitted force to the sum of the nodal forces, and of that to it.
        min_ring: least radius of a ring of pressure, in elements.
        max_clusters: number of clusters, the strongest, that are examined.
        max_nodes: largest number of nodes of an evidence, the nearest to the centre of the cluster.
    """

    trim_share: float = 0.04
    min_variance: float = 0.25
    min_variance_force: float = 0.003
    min_share: float = 0.17
    min_f: float = 4.0
    max_noise: float = 3.0
    min_f_face: float = 10.0
    min_rim: float = 1.15
    min_face: float = 1.0
    min_f_bar: float = MIN_F
    min_bar_stds: float = 2.5
    bar_from_clamp: float = 1.0
    min_inside: float = MIN_INSIDE
    min_mean_misfit: float = 0.1
    hysteresis: float = 0.7
    max_shift: float = 1.0
    max_ratio: float = 2.0
    min_ring: float = 0.8
    max_clusters: int = 8
    max_nodes: int = 64

    def __call__(
        self,
        nodes: ForceNodes,
        force_mm2: Nodal,
        clusters: Clusters,
        previous_mm: Float64[np.ndarray, "k 2"],
        *,
        evidence_at: EvidenceAt,
        noise: float = 1.0,
    ) -> Clusters:
        """The clusters, the strongest first, with those that are two contacts split.

        Args:
            nodes: of the sheet.
            force_mm2: (n, 3) nodal forces over E.
            clusters: of these forces, the strongest first.
            previous_mm: (k, 2) centres of the contacts of the previous frame.
            evidence_at: gives the likelihood of the forces of some nodes.
            noise: ratio of the marker noise to the usual one.
        """
        result = clusters
        press_mm2 = np.maximum(-force_mm2[:, 2], 0.0)
        for number in range(min(len(clusters), self.max_clusters)):
            own = clusters.label == number
            is_counted = own & (press_mm2 > self.trim_share * press_mm2[own].max())
            limit = self.hysteresis if _count_within(clusters, number, previous_mm) >= 2 else 1.0
            parts = self._propose(nodes, press_mm2, is_counted, limit)
            is_around = largest_around(nodes, is_counted.astype(np.int64)) > 0
            near = is_around | _under(nodes, clusters, number)
            node = np.flatnonzero(near & (own | (clusters.label < 0)))
            evidence = evidence_at(_nearest(nodes, node, clusters.centre_mm[number], self.max_nodes))
            if evidence is None:
                continue
            one = evidence.fit_one(
                float(clusters.normal_mm2[number]), clusters.centre_mm[number], clusters.spread_mm2[number]
            )
            best: PatchFit | PairFit = one
            if parts is not None:
                total_mm2 = float(clusters.normal_mm2[number])
                best = self._best(
                    evidence, total_mm2, parts, one, limit=limit, noise=min(noise, self.max_noise)
                )
            if best is one:
                best = self._face_or(one, evidence, float(nodes.element_mm.max()))
            if isinstance(best, PairFit):
                result = _split(result, number, best, nodes, force_mm2)
                result = result.with_nodal(evidence.combinations.node, best.nodal_mm2)
            elif self._is_plausible(nodes, clusters, number, best):
                min_ring_mm = self.min_ring * float(nodes.element_mm.max())
                shapes = evidence.shape_probability(one, min_ring_mm=min_ring_mm)
                result = result.with_patch(number, best, shapes).with_nodal(
                    evidence.combinations.node, best.nodal_mm2
                )
        order = np.argsort(-result.normal_mm2, kind="stable")
        return result if (np.diff(order) > 0).all() else result.select(order)

    def _propose(
        self, nodes: ForceNodes, press_mm2: np.ndarray, is_counted: Mask, limit: float
    ) -> _Parts | None:
        """Two parts of a cluster whose moments can be those of two contacts; else None."""
        total_mm2 = press_mm2[is_counted].sum()
        share, place = press_mm2[is_counted] / total_mm2, nodes.place_mm[is_counted]
        centre = share @ place
        arm = place - centre
        inside = (share * arm.T) @ arm - np.diag(nodes.own_spread_mm2)
        size, axes = np.linalg.eigh(inside)
        variance_mm2, axis = max(float(size[0]), 0.0), axes[:, 1]
        excess_mm2 = float(size[1]) - variance_mm2
        weak = self.min_variance_force * nodes.force_unit_mm2 / float(total_mm2)
        least = limit * float(np.hypot(self.min_variance, weak))
        if excess_mm2 <= least * float((axis**2 * nodes.element_mm**2).sum()):
            return None
        skew_mm = float(share @ (arm @ axis) ** 3) / excess_mm2
        gap_mm = float(np.sqrt(skew_mm**2 + 4.0 * excess_mm2))
        ends_mm = np.array([0.5 * (skew_mm + gap_mm), 0.5 * (skew_mm - gap_mm)])
        parts = np.array([-ends_mm[1], ends_mm[0]]) / gap_mm
        return _Parts(centre_mm=centre + ends_mm[:, None] * axis, share=parts, variance_mm2=variance_mm2)

    def _best(
        self,
        evidence: Evidence,
        press_mm2: float,
        parts: _Parts,
        one: PatchFit,
        *,
        limit: float,
        noise: float,
    ) -> PatchFit | PairFit:
        """Two patches fitted to the markers, if they explain them clearly better than one and than a bar.

        Else the bar, if it explains them as well as the two and better than one, or the one patch.
        """
        start = np.clip(parts.share, self.min_share, 1.0 - self.min_share)
        pair = evidence.fit_two(start * press_mm2, parts.centre_mm, float(np.sqrt(parts.variance_mm2)) + 0.1)
        mean_misfit = evidence.mean_misfit(pair.misfit, PAIR_PARAMETERS, self.min_mean_misfit)
        share = pair.force_mm2 / pair.force_mm2.sum()
        gain = one.misfit - pair.misfit
        if gain <= limit * self.min_f * noise * mean_misfit or share.min() < limit * self.min_share:
            return one
        bar = fit_bar(evidence, pair)
        f = f_of_two(
            evidence,
            pair.misfit,
            bar,
            min_mean_misfit=self.min_mean_misfit,
            min_inside=self.min_inside,
        )
        if f <= limit * self.min_f_bar and bar.misfit < one.misfit:
            is_determined = bar.force_mm2 >= self.min_bar_stds * np.sqrt(bar.covariance[0, 0])
            return bar if is_determined and self._is_free(evidence.patch, pair.centre_mm) else one
        gap_mm = float(np.linalg.norm(pair.centre_mm[1] - pair.centre_mm[0]))
        is_pair = limit * pair.deviation_mm <= 0.25 * gap_mm and self._is_supported(
            float(pair.force_mm2.sum()), pair.nodal_mm2, press_mm2
        )
        return pair if is_pair and evidence.patch.covers(pair.centre_mm).all() else one

    def _is_free(self, patch: SplinePatch, end_mm: Points2) -> bool:
        """Whether both ends (2, 2) are far enough from the outline."""
        inside_mm = 0.5 * np.array(patch.size_mm) - np.abs(end_mm - np.array(patch.centre_mm))
        element_mm = np.array(patch.size_mm) / np.array(patch.elements)
        return bool((inside_mm >= self.bar_from_clamp * element_mm).all())

    def _face_or(self, one: PatchFit, evidence: Evidence, element_mm: float) -> PatchFit:
        """An elliptic face that presses most with its edge, if it explains the markers clearly better."""
        narrow_mm = 2.0 * float(np.sqrt(max(np.linalg.eigvalsh(one.spread_mm2)[0], 0.0)))
        if narrow_mm < self.min_face * element_mm or one.misfit < self.min_f_face * self.min_mean_misfit:
            return one
        face = fit_elliptic_face(evidence, one)
        mean_misfit = evidence.mean_misfit(face.misfit, _FACE_PARAMETERS, self.min_mean_misfit)
        arm_mm2 = float(np.square(face.outline_mm - face.centre_mm).sum(axis=1).mean())
        is_edge_loaded = 2.0 * float(np.trace(face.spread_mm2)) > self.min_rim * arm_mm2
        is_inside = bool(face.nodal_mm2.sum() >= self.min_inside * face.force_mm2)
        is_better = one.misfit - face.misfit > self.min_f_face * mean_misfit
        return face if is_inside and is_better and is_edge_loaded else one

    def _is_plausible(self, nodes: ForceNodes, clusters: Clusters, number: int, one: PatchFit) -> bool:
        """Whether a fitted patch is where the nodal forces are, and is supported by them."""
        shift_mm = np.abs(one.centre_mm - clusters.centre_mm[number])
        reach_mm = np.sqrt(np.diagonal(clusters.spread_mm2[number]))
        is_near = np.all(shift_mm <= self.max_shift * nodes.element_mm + 0.5 * reach_mm)
        press_mm2 = float(clusters.normal_mm2[number])
        return bool(is_near) and self._is_supported(one.force_mm2, one.nodal_mm2, press_mm2)

    def _is_supported(self, force_mm2: float, nodal_mm2: np.ndarray, press_mm2: float) -> bool:
        """Whether a fitted force is about that of the nodes, and enough of it is on those of the evidence."""
        is_alike = press_mm2 <= self.max_ratio * force_mm2 <= self.max_ratio**2 * press_mm2
        return bool(is_alike and nodal_mm2.sum() >= self.min_inside * force_mm2)


def _nearest(
    nodes: ForceNodes, node: Int64[np.ndarray, " k"], centre_mm: np.ndarray, most: int
) -> Int64[np.ndarray, " n"]:
    """The `most` of these nodes that are nearest to a place, in their order."""
    if len(node) <= most:
        return node
    away_mm = np.linalg.norm(nodes.place_mm[node] - centre_mm, axis=1)
    return np.sort(node[np.argpartition(away_mm, most)[:most]])


def _under(nodes: ForceNodes, clusters: Clusters, number: int) -> Mask:
    """(n,) nodes whose basis functions are not 0 at the centre of a cluster."""
    is_near = np.abs(nodes.place_mm - clusters.centre_mm[number]) / nodes.element_mm < 2.0
    return np.asarray(is_near[:, 0] & is_near[:, 1])


def _count_within(clusters: Clusters, number: int, place_mm: Float64[np.ndarray, "k 2"]) -> int:
    """Number of the places that are near a cluster, and nearer to its centre than to any other."""
    if len(place_mm) == 0:
        return 0
    away = np.linalg.norm(place_mm[:, None] - clusters.centre_mm, axis=2)
    reach = 3.0 * float(np.sqrt(np.trace(clusters.spread_mm2[number]) + 1e-12))
    return int(((away.argmin(axis=1) == number) & (away[:, number] < reach)).sum())


def _split(clusters: Clusters, number: int, pair: PairFit, nodes: ForceNodes, force_mm2: Nodal) -> Clusters:
    """The clusters with one of them in two parts; its nodes belong to the nearest part."""
    node = np.flatnonzero(clusters.label == number)
    away = np.linalg.norm(nodes.place_mm[node, None] - pair.centre_mm, axis=2)
    second = node[away[:, 1] < away[:, 0]]
    label = clusters.label.copy()
    label[second] = len(clusters)
    force, torque = np.empty((2, 3)), np.empty(2)
    for part, own in enumerate((np.setdiff1d(node, second), second)):
        force[part, :2] = force_mm2[own, :2].sum(axis=0)
        force[part, 2] = -pair.force_mm2[part]
        arm = nodes.place_mm[own] - pair.centre_mm[part]
        torque[part] = (arm[:, 0] * force_mm2[own, 1] - arm[:, 1] * force_mm2[own, 0]).sum()
    spread = np.tile(pair.deviation_mm**2 * np.eye(2), (2, 1, 1))
    covariance = np.full((2, 6, 6), np.nan)
    covariance[:, :3, :3] = pair.covariance

    def with_parts(old: np.ndarray, new: np.ndarray) -> Float64[np.ndarray, "..."]:
        joined = np.concatenate([old, new[1:]])
        joined[number] = new[0]
        return joined

    return Clusters(
        centre_mm=with_parts(clusters.centre_mm, pair.centre_mm),
        force_mm2=with_parts(clusters.force_mm2, force),
        torque_mm3=with_parts(clusters.torque_mm3, torque),
        spread_mm2=with_parts(clusters.spread_mm2, spread),
        covariance=with_parts(clusters.covariance, covariance),
        sheet_covariance=with_parts(clusters.sheet_covariance, np.zeros((2, 6, 6))),
        label=label,
        is_face=np.append(clusters.is_face, False),
        corner_points_mm=(*clusters.corner_points_mm, np.zeros((0, 2))),
        shape_probability=with_parts(clusters.shape_probability, np.full((2, 4), np.nan)),
        fitted_mm2=clusters.fitted_mm2,
        is_one_as_before=np.append(clusters.is_one_as_before, False),
    )
