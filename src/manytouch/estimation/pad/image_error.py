"""The measured marker images of a frame, and what the linear model of a pad does not explain of them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.pad.pad_model import BondedPadModel
from manytouch.medians import median
from manytouch.values.arrays import Points2, Points3, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MeasuredImages:
    """The marker images of a frame.

    Attributes:
        moved_px: (m, 2) displacements, 0 where not seen.
        gate: (m,) weights of the markers.
        noise_px2: (m,) variances along an axis; their median where not seen.
        around: (m, m) weights of the markers around each.
        local_pitch: largest local motion, in pitches.
        is_touched: whether that is more than noise and what the pad keeps of earlier presses.
    """

    moved_px: Points2
    gate: Scalars
    noise_px2: Scalars
    around: Float64[np.ndarray, "m m"]
    local_pitch: float
    is_touched: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ImageError:
    """Standard deviation of a marker image by the error of the model.

    It is in proportion to the motion around a marker and not to that of the marker itself: in the middle of a
    contact, where markers hardly move, the error of the model is as large as around it. Far from contacts it
    is in proportion to the largest motion: what hardly moves there must not decide how wide a contact is. On
    a pad that nothing touches the model has no error. What counts as one there is as large as the noise,
    whose size is not known better.

    Attributes:
        std_pitch: least and largest where nothing moves around a marker, in pitches.
        far: the same over the largest motion; added to the noise in quadrature.
        share: over the root mean square of the motion around the marker.
        around: standard deviation, in thicknesses, of the Gaussian weights of that mean.
        reach: distance in thicknesses within which markers have this error in common.
        nominal_share, nominal_reach: `share` and `reach` where the shape of the pad is that of a nominal
            sensor file; chosen on three recordings of gels with two kinds of markers.
    """

    std_pitch: tuple[float, float] = (1e-4, 5e-4)
    far: float = 0.01
    share: float = 0.09
    around: float = 1.0
    reach: float = 0.5
    nominal_share: float = 0.25
    nominal_reach: float = 1.0

    def weights(self, model: BondedPadModel) -> Float64[np.ndarray, "m m"]:
        """Weights of the markers in the mean around each; rows add up to 1."""
        place_mm = model.layout.rest_mm[:, :2] / (self.around * model.thickness_mm)
        weight = np.exp(-0.5 * ((place_mm[:, None] - place_mm) ** 2).sum(axis=2))
        return read_only(weight / weight.sum(axis=1, keepdims=True))

    def __call__(
        self,
        model: BondedPadModel,
        weights: Float64[np.ndarray, "m m"],
        moved_px2: Scalars,
        noise_px2: Scalars,
    ) -> Scalars:
        """(m,) variances along an axis, px^2, of markers that are treated as independent.

        Args:
            model: of the pad.
            weights: by `weights`.
            moved_px2: (m,) squared displacements of the marker images.
            noise_px2: (m,) variances of the marker images by noise, along an axis.
        """
        share, reach = self.share, self.reach
        if model.shape_is_nominal:
            share, reach = self.nominal_share, self.nominal_reach
        shared = max(1.0, (reach * model.thickness_mm / model.pitch_mm) ** 2)
        least_px, most_px = (pitches * model.pitch_px for pitches in self.std_pitch)
        local_px2 = weights @ moved_px2
        still_px2 = max(median(noise_px2), least_px**2) + self.far**2 * float(local_px2.max())
        variance: Scalars = min(still_px2, most_px**2) + share**2 * local_px2
        return shared * variance

    def images(
        self, model: BondedPadModel, measured: MeasuredImages, moved_mm: Points3
    ) -> tuple[Float64[np.ndarray, " r"], Float64[np.ndarray, " r"]]:
        """(2 m,) displacements without what is not linear in those (m, 3) of the markers; their weights."""
        linear_px = np.einsum("mij,mj->mi", model.slope_px, moved_mm)
        error_px2 = self(model, measured.around, (linear_px**2).sum(axis=1), measured.noise_px2)
        curved_px = model.project(moved_mm) - model.rest_px - linear_px
        weight = np.repeat(measured.gate / (measured.noise_px2 + error_px2), 2)
        return (measured.moved_px - curved_px).ravel(), weight
