"""How far off the depth of the markers may be: noise that comes through, and what the model leaves out."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.sheet_model import SheetModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Covariances3, Mask, Points3, read_only

_SAMPLES = 60


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerTrust:
    """Deviations of the displacement of markers.

    Attributes:
        noise_mm: (3,) along x, y, z from the noise of the centres while nothing touches.
        std_px: of the centres that this belongs to.
        nearness: (m, n) how much of a node's force a marker feels.
    """

    noise_mm: Float64[np.ndarray, "3"]
    std_px: float
    nearness: Float64[np.ndarray, "m nodes"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SurfaceError:
    """Parameters of the deviations; the model's part was fitted to solids by finite elements.

    Under a force the face of a solid is dented deeper than a shell says, by about force over thickness
    times E, within about a thickness.

    Attributes:
        reach_thickness: how far, as standard deviation of a bell.
        dent: of forces nearby over thickness, along z.
        depth_share: of the depth.
        along: part of the deviation along z that x and y have.
        unseen: deviation of markers that are not seen, in units of those that are.
        nominal_share: of the depth where the sheet was assumed.
    """

    reach_thickness: float = 0.9
    dent: float = 0.06
    depth_share: float = 0.006
    along: float = 0.5
    unseen: float = 2.0
    nominal_share: float = 0.35

    def start(self, model: SheetModel, weight_mm4: Nodal, std_px: float) -> MarkerTrust:
        """What stays the same: for centres of this deviation and forces of these weights."""
        count = len(model.layout.rest_mm)
        still = np.zeros((model.patch.node_count, 3))
        model.normal.linearise(still)
        information = np.tile(np.eye(2) / std_px**2, (count, 1, 1))
        model.normal.step(np.zeros((count, 2)), information, weight_mm4)
        chosen = np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).astype(np.int64))
        node, slope = model.dots.face.basis.node[chosen], model.dots.face.derivative(still)[chosen]
        variance = [model.normal.variances(node, slope[:, axis]) for axis in range(3)]
        away_mm = np.linalg.norm(model.layout.rest_mm[:, None, :2] - model.patch.place_mm, axis=2)
        reach_mm = self.reach_thickness * model.thickness_mm
        return MarkerTrust(
            noise_mm=read_only(np.sqrt(np.median(variance, axis=1))),
            std_px=std_px,
            nearness=read_only(np.exp(-0.5 * (away_mm / reach_mm) ** 2)),
        )

    def __call__(
        self,
        model: SheetModel,
        trust: MarkerTrust,
        displacement_mm: Points3,
        force_mm2: Nodal,
        is_seen: Mask,
        *,
        std_px: float,
    ) -> Covariances3:
        """(m, 3, 3) covariances; `std_px` of the centres in this frame."""
        noise_mm = trust.noise_mm * max(std_px / trust.std_px, 1.0)
        depth_mm = np.abs(displacement_mm[:, 2])
        dent_mm = self.dent * trust.nearness @ np.maximum(-force_mm2[:, 2], 0.0) / model.thickness_mm
        share = self.nominal_share if model.is_nominal else self.depth_share
        error_mm2 = dent_mm**2 + (share * depth_mm) ** 2
        grown = np.where(is_seen, 1.0, self.unseen**2)
        covariance = np.zeros((len(depth_mm), 3, 3))
        for axis, part in enumerate((self.along, self.along, 1.0)):
            covariance[:, axis, axis] = grown * (noise_mm[axis] ** 2 + part**2 * error_mm2)
        return covariance
