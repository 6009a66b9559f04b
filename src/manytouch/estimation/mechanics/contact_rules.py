"""Which force clusters start, continue or end a contact."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.force_lattice import ForceLattice
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Mask, Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactRules:
    """Thresholds of contacts; force thresholds are multiples of the least force of a cluster.

    Attributes:
        start_force: least normal force of a new contact where there was a cluster in the previous frame.
        sudden_force: least normal force of a new contact elsewhere.
        clamp_factor: factor of these least forces within `clamp_thickness` thicknesses of the edge of the
            part in which contacts are found. A camera that moves a little displaces all markers alike; the
            fit explains this by small forces near the clamp.
        clamp_thickness: distance from the edge, in thicknesses, within which `clamp_factor` applies.
        max_friction: largest ratio of shear to normal force of a new contact.
        least_stds: clusters with a smaller normal force, in standard deviations, are not examined.
        start_stds, last_stds: least normal force of a new contact and of one that continues, in standard
            deviations.
        noise_share: nodal forces below this share of what noise adds to `GaussNewton.negligible_force` belong
            to no cluster.
    """

    start_force: float = 1.5
    sudden_force: float = 4.0
    clamp_factor: float = 3.0
    clamp_thickness: float = 2.0
    max_friction: float = 1.5
    least_stds: float = 1.0
    start_stds: float = 4.0
    last_stds: float = 2.5
    noise_share: float = 0.3

    def may_start(
        self,
        lattice: ForceLattice,
        clusters: Clusters,
        is_new: Mask,
        *,
        least_mm2: float,
        thickness_mm: float,
    ) -> Mask:
        """(c,) whether each cluster is strong enough to start a contact.

        Args:
            lattice: of the nodes.
            clusters: of this frame.
            is_new: (c,) whether there was no cluster here in the previous frame.
            least_mm2: least normal force of a cluster over E.
            thickness_mm: of the sheet.
        """
        needed_mm2 = least_mm2 * np.where(is_new, self.sudden_force, self.start_force)
        inside_mm = (lattice.inner_mm - np.abs(clusters.centre_mm)).min(axis=1, initial=np.inf)
        is_near_clamp = inside_mm < self.clamp_thickness * thickness_mm
        shear_mm2 = np.linalg.norm(clusters.force_mm2[:, :2], axis=1)
        is_strong = clusters.normal_mm2 >= np.where(is_near_clamp, self.clamp_factor * needed_mm2, needed_mm2)
        return np.asarray(is_strong & (shear_mm2 <= self.max_friction * clusters.normal_mm2))


def has_force_near(
    lattice: ForceLattice, force_mm2: Nodal, place_mm: Points2, *, radius_mm: float, least_mm2: float
) -> Mask:
    """(k,) whether the normal forces within a radius of each place (k, 2) sum to at least a value over E."""
    away_mm = np.linalg.norm(place_mm[:, None] - lattice.place_mm, axis=2)
    near_mm2 = (away_mm < radius_mm) @ np.maximum(-force_mm2[:, 2], 0.0)
    return np.asarray(near_mm2 >= least_mm2)


def is_far_from(clusters: Clusters, place_mm: Float64[np.ndarray, "k 2"], distance_mm: float) -> Mask:
    """(c,) whether the centre of each cluster is farther than a distance from all of some places."""
    away_mm = np.linalg.norm(clusters.centre_mm[:, None] - place_mm, axis=2).min(axis=1, initial=np.inf)
    return np.asarray(away_mm > distance_mm)
