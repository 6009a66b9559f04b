"""Which force clusters start, continue or end a contact."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.inversion.sheet_parameters import ParameterResponse
from manytouch.geometry.spline.patch import Nodal
from manytouch.values import Contact
from manytouch.values.arrays import Mask, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactRules:
    """Thresholds of contacts; force thresholds are multiples of the least force of a cluster.

    Attributes:
        start_force: least normal force of a new contact where there was a cluster in the previous frame.
        sudden_force: least normal force of a new contact elsewhere.
        decided_force: least normal force of a contact from which on it is kept in later frames whether an
            object is one contact or two. Of lighter contacts the markers show that too little.
        clamp_factor: factor of these least forces within `clamp_thickness` thicknesses of the edge of the
            part in which contacts are found. A camera that moves a little displaces all markers alike; the
            fit explains this by small forces near the clamp.
        clamp_thickness: distance from the edge, in thicknesses, within which `clamp_factor` applies.
        wait_thickness: distance from that edge, in thicknesses, within which a contact does not start before
            the response to the parameters of the sheet is that of the present load. Fitted on sheets of 1.5
            to 6 mm (ADR 99).
        max_friction: largest ratio of shear to normal force of a new contact.
        shear_stds: number of its standard deviations by noise by which the shear may exceed that.
        least_stds: clusters with a smaller normal force, in standard deviations, are not examined.
        start_stds, last_stds: least normal force of a new contact and of one that continues, in standard
            deviations.
        outline_stds: least normal force of a contact on a known sheet over its change by one standard
            deviation of the outline, other than in proportion to the strongest force. A clamp that is not
            where the sensor file has it, or that bends the sheet otherwise than its shell, causes forces next
            to it. The strongest force of a frame is not tested: it causes most of the deformation. Other true
            contacts of the varied cases have 4 and more with drawn sensor files, 5 and more with true ones,
            their whole change counted.
        body_force_stds: least normal force of a contact over its standard deviation by the body force, if one
            is estimated; of the strongest contact too. Chosen on the turned sheets of ADR 176.
        sure_stds: least normal force of a contact that is not the strongest, in standard deviations by noise
            and by what the parameters of the sheet change other than in proportion to the strongest force. On
            a sheet that is assumed, only a new contact needs it: unlike parameters scale the forces of
            contacts of different depth by different factors, and none of these is 0.
        same_contact_pitch: a cluster continues a contact if it is within this distance, in pitches.
        kept_share: a contact that is not found may last while the normal forces within its half axis or a
            pitch are at least this share of its last one, and those within a pitch the least force. What is
            left when a strong press ends at once is a smaller share, but more than the least force.
        noise_share: nodal forces below this share of what noise adds to `GaussNewton.negligible_force` belong
            to no cluster.
    """

    start_force: float = 1.5
    sudden_force: float = 4.0
    decided_force: float = 10.0
    clamp_factor: float = 3.0
    clamp_thickness: float = 2.0
    wait_thickness: float = 1.0
    max_friction: float = 1.5
    shear_stds: float = 2.0
    least_stds: float = 1.0
    start_stds: float = 4.0
    last_stds: float = 2.5
    outline_stds: float = 4.0
    body_force_stds: float = 2.5
    sure_stds: float = 2.0
    same_contact_pitch: float = 1.0
    kept_share: float = 0.03
    noise_share: float = 0.3

    def may_start(
        self, model: InversionModel, clusters: Clusters, fit: Fit, is_new: Mask, *, is_response_due: bool
    ) -> Mask:
        """(c,) whether each cluster is strong enough to start a contact.

        Args:
            model: of the sheet.
            clusters: of this frame.
            fit: of this frame.
            is_new: (c,) whether there was no cluster here in the previous frame.
            is_response_due: whether the response to the parameters of the sheet is that of an earlier load.
        """
        nodes = model.nodes
        needed_mm2 = nodes.least_force_mm2 * np.where(is_new, self.sudden_force, self.start_force)
        inside_mm = nodes.inside_mm(clusters.centre_mm)
        is_near_clamp = inside_mm < self.clamp_thickness * model.thickness_mm
        shear_mm2 = np.linalg.norm(clusters.force_mm2[:, :2], axis=1)
        is_strong = clusters.normal_mm2 >= np.where(is_near_clamp, self.clamp_factor * needed_mm2, needed_mm2)
        is_strong &= ~(is_response_due & (inside_mm < self.wait_thickness * model.thickness_mm))
        excess_mm2 = shear_mm2 - self.max_friction * clusters.normal_mm2
        for number in np.flatnonzero(is_strong & (excess_mm2 > 0.0)):
            share = (clusters.label == number)[None].astype(np.float64)
            std_mm2 = np.hypot(*(fit.posterior.force_std(share, axis)[0] for axis in range(2)))
            excess_mm2[number] -= self.shear_stds * std_mm2
        return np.asarray(is_strong & (excess_mm2 <= 0.0))

    def may_last(self, model: InversionModel, force_mm2: Nodal, contact: Contact, noise: float) -> bool:
        """Whether a contact that a frame does not show as one may still be there.

        Args:
            model: of the sheet.
            force_mm2: (nodes, 3) nodal forces over E of the frame.
            contact: as an earlier frame showed it.
            noise: ratio of the marker noise to the usual one.
        """
        away_mm = np.linalg.norm(model.nodes.place_mm - contact.centre_mm, axis=1)
        reaches_mm = np.array([model.pitch_mm, np.fmax(model.pitch_mm, contact.half_major_mm)])
        near_mm2, under_mm2 = (away_mm < reaches_mm[:, None]) @ np.maximum(-force_mm2[:, 2], 0.0)
        kept_mm2 = self.kept_share * np.nan_to_num(contact.normal_force_over_E_mm2)
        return bool(near_mm2 >= noise * model.nodes.least_force_mm2 and under_mm2 >= kept_mm2)

    def certain(
        self,
        model: InversionModel,
        clusters: Clusters,
        fit: Fit,
        response: ParameterResponse | None,
        touching_mm: Float64[np.ndarray, "k 2"],
    ) -> tuple[Clusters, Scalars]:
        """Clusters that neither noise nor wrong parameters of the sheet explain, with the error by these.

        Args:
            model: of the sheet.
            clusters: of this frame.
            fit: of this frame.
            response: of the forces to the parameters of the sheet, if it is known.
            touching_mm: (k, 2) centres of the contacts of the previous frame.

        Returns:
            the clusters, and their normal forces (c,) in standard deviations by noise.
        """
        clusters, stds = significant(clusters, fit, self.last_stds)
        if response is None:
            return clusters, stds
        ratio = response.force_ratio(fit, clusters.label, len(clusters))
        growth = np.append(np.maximum(ratio, 1.0), 1.0)[clusters.label]
        clusters = clusters.with_sheet_error(model.nodes, growth * response.force_change_mm2[:, :, 2])
        is_strongest = clusters.normal_mm2 >= clusters.normal_mm2.max(initial=0.0)
        is_certain = clusters.normal_mm2 >= self.sure_stds * _relative_std_mm2(clusters, stds, fit, response)
        if model.is_assumed:
            is_certain |= ~is_far_from(clusters, touching_mm, self.same_contact_pitch * model.pitch_mm)
        else:
            by_outline_mm2 = _change_by_outline_mm2(clusters, fit, response)
            is_certain &= clusters.normal_mm2 >= self.outline_stds * by_outline_mm2
        is_chosen = is_certain | is_strongest
        body_force = fit.shape.body_force
        if body_force is not None and response.has_body_force:
            changes_mm2 = _sums_mm2(clusters, *(body_force.deviations_g @ response.by_acceleration_mm2))
            is_chosen &= clusters.normal_mm2 >= self.body_force_stds * np.linalg.norm(changes_mm2, axis=0)
        chosen = np.flatnonzero(is_chosen)
        return clusters.select(chosen), stds[chosen]


def _relative_std_mm2(clusters: Clusters, stds: Scalars, fit: Fit, response: ParameterResponse) -> Scalars:
    """(c,) deviation of each normal force by noise and by the parameters of the sheet.

    `stds` (c,) are the forces in standard deviations by noise.
    """
    change_mm2 = _relative_changes_mm2(clusters, fit, response, response.force_change_mm2[:, :, 2])
    return np.asarray(np.sqrt((clusters.normal_mm2 / stds) ** 2 + (change_mm2**2).sum(axis=0)))


def _change_by_outline_mm2(clusters: Clusters, fit: Fit, response: ParameterResponse) -> Scalars:
    """(c,) size of the change of each normal force by one standard deviation of the outline."""
    (change_mm2,) = _relative_changes_mm2(clusters, fit, response, response.by_outline_mm2[None])
    return np.asarray(np.abs(change_mm2))


def _relative_changes_mm2(
    clusters: Clusters, fit: Fit, response: ParameterResponse, nodal_mm2: Float64[np.ndarray, "k nodes"]
) -> Float64[np.ndarray, "k c"]:
    """(k, c) changes of the normal forces, other than in proportion to the strongest force.

    What a parameter changes in proportion to all forces, as the modulus of a thick sheet does, causes no
    contact. `nodal_mm2` (k, nodes) are changes of nodal forces in the response.
    """
    change_mm2 = _sums_mm2(clusters, *nodal_mm2) * _share_left(clusters, fit, response)
    if len(clusters) == 0:
        return np.asarray(change_mm2)
    strongest = int(clusters.normal_mm2.argmax())
    share = clusters.normal_mm2 / clusters.normal_mm2[strongest]
    return np.asarray(change_mm2 - share * change_mm2[:, [strongest]])


def _share_left(clusters: Clusters, fit: Fit, response: ParameterResponse) -> Scalars:
    """(c,) factors of the changes in a response, which may be that of an earlier frame.

    Where a cluster was stronger then, the change is in proportion to its force: most of it is that of its own
    load.
    """
    return np.asarray(np.minimum(response.force_ratio(fit, clusters.label, len(clusters)), 1.0))


def _sums_mm2(
    clusters: Clusters, *nodal_mm2: Float64[np.ndarray, " nodes"]
) -> Float64[np.ndarray, "k clusters"]:
    """(k, c) sums of nodal values over the nodes of each cluster."""
    node = np.flatnonzero(clusters.label >= 0)
    label, count = clusters.label[node], len(clusters)
    sums = [np.bincount(label, each[node], minlength=count) for each in nodal_mm2]
    return np.array(sums, dtype=np.float64)


def significant(clusters: Clusters, fit: Fit, least_stds: float) -> tuple[Clusters, Scalars]:
    """Clusters whose normal force has at least so many standard deviations, and these numbers (c,)."""
    std_mm2 = np.sqrt(clusters.covariance[:, 0, 0])
    unknown = np.flatnonzero(~np.isfinite(std_mm2))
    if len(unknown) > 0:
        inside = clusters.label == unknown[:, None]
        std_mm2[unknown] = fit.posterior.force_std(inside.astype(np.float64), 2)
    stds = clusters.normal_mm2 / np.maximum(std_mm2, np.finfo(np.float64).tiny)
    chosen = np.flatnonzero(stds >= least_stds)
    if len(chosen) == len(clusters):
        return clusters, stds
    return clusters.select(chosen), stds[chosen]


def is_far_from(clusters: Clusters, place_mm: Float64[np.ndarray, "k 2"], distance_mm: float) -> Mask:
    """(c,) whether the centre of each cluster is farther than a distance from all of some places."""
    away_mm = np.linalg.norm(clusters.centre_mm[:, None] - place_mm, axis=2).min(axis=1, initial=np.inf)
    return np.asarray(away_mm > distance_mm)
