"""Decides by the markers whether a pair of clusters is one bar.

A rigid face presses most with its ends or its corners, and two round patches describe that better than one
ellipse. A bar whose pressure rises towards its ends describes such a face as well as the two patches do. It
does not describe two balls, between which nothing presses. A face that presses with its ends only is the same
load as two balls, so that this rule finds two contacts; what decides then is in `rigid_faces`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from manytouch.estimation.mechanics.clusters.evidence import MIN_MEAN_MISFIT, Evidence, EvidenceAt
from manytouch.estimation.mechanics.clusters.face_fits import fit_bar
from manytouch.estimation.mechanics.clusters.fitted_patches import PAIR_PARAMETERS, PatchFit
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel

MIN_F = 8.0
"""F of two patches against a bar above which there are two contacts. It was fitted: balls with a radius of
2 mm, 6 to 16 mm apart on a sheet of 3 mm, have 9 and more; bars and blocks of the varied cases have -50 to 14
(ADR 84)."""
MIN_INSIDE = 0.8
"""Least share of the force of a fitted face that lies on the nodes of the evidence. Beyond these nodes no
marker contradicts it."""
_START_MM = 0.1  # added to the deviation of the pressure from which the fit of two patches starts


def f_of_two(
    evidence: Evidence,
    two_misfit: float,
    bar: PatchFit,
    *,
    min_mean_misfit: float = MIN_MEAN_MISFIT,
    min_inside: float = MIN_INSIDE,
) -> float:
    """F of two patches against a bar: the difference of the misfits over that per degree of freedom.

    It is infinite for a bar with less than `min_inside` of its force on the nodes of the evidence.
    """
    if bar.nodal_mm2.sum() < min_inside * bar.force_mm2:
        return np.inf
    mean_misfit = evidence.mean_misfit(two_misfit, PAIR_PARAMETERS, min_mean_misfit)
    return (bar.misfit - two_misfit) / mean_misfit


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BarRule:
    """Decides whether two clusters are one bar, by F of two round patches against a bar.

    Attributes:
        min_f: above this F they are two contacts.
        was_two: factor of `min_f` if they were two contacts in the previous frame.
        was_one: factor of `min_f` if they were one contact, with its centre at the centre of their forces,
            and are farther apart than `seen_apart_thickness` or have not more force than then.
        seen_apart_thickness: two contacts at this distance, in thicknesses, are seen as two when they begin.
            Balls with a radius of 2 mm, 8 mm apart on a sheet of 3 mm, can begin as one.
        near: factor of `min_f` if they were not two and are nearer than `near_thickness`: the sheet hides how
            the pressure of an object is distributed over a thickness, so that a bar with even pressure does
            not describe one that is pressed deep.
        near_thickness: least distance of two contacts that need not be clearer than others, in thicknesses.
        wide: least factor of `min_f` if both patches are wide and of about the same size, as balls are not.
        wide_gap: least radius of wide patches over their distance. The radius is two standard deviations of
            the pressure.
        wide_thickness: least radius of wide patches, in thicknesses; smaller ones all look alike.
        max_size_ratio: largest ratio of the second moments of two wide patches.
        unlike_size_ratio: above this ratio of the second moments, two patches of one size do not describe two
            bodies, and the misfit of the two ellipses that were fitted one by one counts if it is smaller.
        max_ends_f: largest F of two patches that may be the ends of one face. Ends of blocks and
            cylinders have an F of at most 1650, 4 to 14 thicknesses apart; that of balls there is up to 9000,
            but not where noise or the clamp hides what they do (ADR 164).
        max_nodes: largest number of nodes of an evidence.
        min_inside: see `MIN_INSIDE`.
    """

    min_f: float = MIN_F
    was_two: float = 0.25
    was_one: float = 3.0
    seen_apart_thickness: float = 2.9
    near: float = 2.5
    near_thickness: float = 2.0
    wide: float = 4.0
    wide_gap: float = 0.25
    wide_thickness: float = 0.8
    max_size_ratio: float = 4.0
    unlike_size_ratio: float = 30.0
    max_ends_f: float = 2000.0
    max_nodes: int = 96
    min_inside: float = MIN_INSIDE

    def __call__(
        self,
        model: InversionModel,
        clusters: Clusters,
        own: Int64[np.ndarray, "2"],
        evidence_at: EvidenceAt,
        *,
        was_two: bool,
        was_one: bool,
        is_unchanged: bool = False,
        may_be_ends: bool = False,
    ) -> bool | None:
        """Whether two clusters are one bar; None where the markers do not determine it.

        Args:
            model: of the sheet.
            clusters: of this frame.
            own: numbers of the two.
            evidence_at: gives the likelihood of the forces of some nodes.
            was_two: whether they were two contacts in the previous frame.
            was_one: whether they were one, with its centre at that of their forces.
            is_unchanged: whether their force is not larger than when the markers last showed one contact.
            may_be_ends: whether two patches are not determined as long as they may be the ends of one face.
        """
        evidence = evidence_at(self._nodes(model, clusters, own))
        if evidence is None:
            return None
        round_mm2 = 0.5 * np.trace(clusters.spread_mm2[own], axis1=1, axis2=2)
        deviation_mm = float(np.sqrt(round_mm2.mean())) + _START_MM
        pair = evidence.fit_two(clusters.normal_mm2[own], clusters.centre_mm[own], deviation_mm)
        gap_mm = float(np.linalg.norm(pair.centre_mm[1] - pair.centre_mm[0]))
        limit = self.was_two if was_two else 1.0
        if was_one and (is_unchanged or gap_mm >= self.seen_apart_thickness * model.thickness_mm):
            limit = self.was_one
        if not was_two and gap_mm < self.near_thickness * model.thickness_mm:
            limit = max(limit, self.near)
        is_alike = bool(round_mm2.max() <= self.max_size_ratio * round_mm2.min())
        least_mm = max(self.wide_gap * gap_mm, self.wide_thickness * model.thickness_mm)
        if is_alike and 2.0 * pair.deviation_mm > least_mm:
            limit = max(limit, self.wide)
        two_misfit = pair.misfit
        if round_mm2.max() > self.unlike_size_ratio * round_mm2.min():
            # the two ellipses that were fitted one by one
            apart = evidence.misfit(np.nan_to_num(clusters.fitted_mm2[evidence.combinations.node]))
            two_misfit = min(two_misfit, apart)
        f = f_of_two(evidence, two_misfit, fit_bar(evidence, pair), min_inside=self.min_inside)
        is_bar = f <= limit * self.min_f
        is_clear = self.max_ends_f < f < np.inf
        return None if may_be_ends and not is_bar and not is_clear else is_bar

    def _nodes(
        self, model: InversionModel, clusters: Clusters, own: Int64[np.ndarray, "2"]
    ) -> Int64[np.ndarray, " n"]:
        """Nodes of two clusters and between them, the nearest to the line between their centres."""
        nodes, (start, end) = model.nodes, clusters.centre_mm[own]
        off = nodes.place_mm - start
        share = np.clip(off @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
        away_mm = np.linalg.norm(off - share[:, None] * (end - start), axis=1)
        is_own = np.isin(clusters.label, own)
        is_near = (away_mm <= 2.0 * nodes.element_mm.max()) & (clusters.label < 0)
        node = np.flatnonzero(is_own | is_near)
        if len(node) <= self.max_nodes:
            return node
        return np.sort(node[np.argpartition(away_mm[node], self.max_nodes)[: self.max_nodes]])
