"""Covariances of marker displacements: by the noise of marker images and by the error of the model."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Covariances3, Mask, Points3, read_only

_SAMPLES = 60
"""Number of markers whose variances are computed; their median is used for all markers."""
_MOST_REACH = 5.5
"""Distance beyond which the weight of a force, a Gaussian, counts as 0, in its standard deviations."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DisplacementCovarianceState:
    """What the covariances of the marker displacements depend on that is the same in every frame.

    Attributes:
        noise_mm: (3,) standard deviation of a marker's displacement along x, y, z, by the noise of the marker
            images alone, while nothing touches the sheet; median over the markers.
        std_px: standard deviation of the marker images along an axis for which `noise_mm` was computed.
        proximity: (m, n) weight of the force at each node in the error at each marker, 0 to 1; it decreases
            with their distance, and is 0 beyond `_MOST_REACH`.
    """

    noise_mm: Float64[np.ndarray, "3"]
    std_px: float
    proximity: csr_array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DisplacementCovariance:
    """Covariances of the marker displacements: by the noise of marker images, and by the error of the model.

    The error of the model was fitted to 3-D finite elements. Under a force the face of a solid lies deeper
    than that of a shell, by about force over thickness and E, within about one thickness.

    Attributes:
        reach_thickness: standard deviation, in thicknesses, of the Gaussian of the distance between a node
            and a marker by which the force at the node is weighted.
        dent: standard deviation along z by the forces near a marker, over their weighted sum divided by E and
            thickness.
        depth_share: standard deviation along z in proportion to the depth, over the depth.
        level_share: standard deviation along z of all markers of an assumed sheet, over the largest depth:
            what holds the sheet beyond them is not known. Chosen on six sheets (ADR 173).
        lateral_share: the model's standard deviation along x and y, over that along z.
        unseen_factor: multiplies the standard deviations of markers that are not seen.
    """

    reach_thickness: float = 0.9
    dent: float = 0.06
    depth_share: float = 0.006
    level_share: float = 0.06
    lateral_share: float = 0.5
    unseen_factor: float = 2.0

    def start(
        self, model: InversionModel, weight_per_mm4: Nodal, std_px: float
    ) -> DisplacementCovarianceState:
        """What depends on the sensor only.

        Args:
            model: of the sheet.
            weight_per_mm4: (n, 3) weights of the forces over E at rest, from `GaussNewton.weights`.
            std_px: standard deviation of the marker images along an axis.
        """
        count = len(model.layout.rest_mm)
        rest_mm = np.zeros((model.patch.node_count, 3))
        information = np.tile(np.eye(2) / std_px**2, (count, 1, 1))
        linearisation = model.normal_equations.linearise(rest_mm)
        posterior = model.normal_equations.solve(
            linearisation, np.zeros((count, 2)), information, weight_per_mm4
        )
        chosen = np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).astype(np.int64))
        node, slope = model.dots.face.basis.node[chosen], model.dots.face.derivative(rest_mm)[chosen]
        variance = [posterior.variances(node, slope[:, axis]) for axis in range(3)]
        reach_mm = self.reach_thickness * model.thickness_mm
        return DisplacementCovarianceState(
            noise_mm=read_only(np.sqrt(np.median(variance, axis=1))),
            std_px=std_px,
            proximity=_proximity(model.layout.rest_mm[:, :2], model.patch.place_mm, reach_mm),
        )

    def __call__(
        self,
        model: InversionModel,
        state: DisplacementCovarianceState,
        displacement_mm: Points3,
        force_mm2: Nodal,
        is_seen: Mask,
        *,
        std_px: float,
    ) -> Covariances3:
        """Covariances (m, 3, 3) of the marker displacements of a frame, mm^2.

        Args:
            model: of the sheet.
            state: from `start`.
            displacement_mm: (m, 3) of the markers.
            force_mm2: (n, 3) nodal forces over E.
            is_seen: (m,) markers with an image in this frame.
            std_px: standard deviation of the marker images of this frame along an axis.
        """
        noise_mm = state.noise_mm * max(std_px / state.std_px, 1.0)
        depth_mm = np.abs(displacement_mm[:, 2])
        weighted_mm2 = state.proximity @ np.maximum(-force_mm2[:, 2], 0.0)
        dent_mm = self.dent * weighted_mm2 / model.thickness_mm
        # variance of the model's error along z: by the forces nearby, in proportion to the depth, by level
        error_mm2 = dent_mm**2 + (self.depth_share**2 + model.assumed_depth_std**2) * depth_mm**2
        if model.is_assumed:
            error_mm2 += (self.level_share * float(depth_mm.max(initial=0.0))) ** 2
        factor = np.where(is_seen, 1.0, self.unseen_factor**2)
        covariance = np.zeros((len(depth_mm), 3, 3))
        for axis, share in enumerate((self.lateral_share, self.lateral_share, 1.0)):
            covariance[:, axis, axis] = factor * (noise_mm[axis] ** 2 + share**2 * error_mm2)
        return covariance


def _proximity(
    marker_mm: Float64[np.ndarray, "m 2"], node_mm: Float64[np.ndarray, "n 2"], reach_mm: float
) -> csr_array:
    """(m, n) Gaussians of the distances between markers (m, 2) and nodes (n, 2)."""
    near = cKDTree(marker_mm / reach_mm).sparse_distance_matrix(
        cKDTree(node_mm / reach_mm), _MOST_REACH, output_type="ndarray"
    )
    weight = np.exp(-0.5 * near["v"] ** 2)
    return csr_array((weight, (near["i"], near["j"])), shape=(len(marker_mm), len(node_mm)))
