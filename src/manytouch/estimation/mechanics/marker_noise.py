"""Standard deviations of marker images: noise of their centres, and what the model does not explain."""

from dataclasses import dataclass

import numpy as np

from manytouch.values import TrackedGrid
from manytouch.values.arrays import Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerNoise:
    """Parameters of the deviations.

    Attributes:
        model_std_pitch: standard deviation of a marker image that the model does not explain, in pitches.
        assumed_sheet_std_pitch: the same for a sheet that was assumed.
        default_centre_noise_px: noise of centres if the sensor does not state it.
        usual_ratio: ratio of the whole deviation to that of the model up to which a frame is not noisy.
    """

    model_std_pitch: float = 8.4e-4
    assumed_sheet_std_pitch: float = 5e-3
    default_centre_noise_px: float = 0.05
    usual_ratio: float = 1.5

    def model_std_px(self, pitch_px: float, *, is_assumed: bool) -> float:
        """Standard deviation of what the model does not explain, for a pitch in the image."""
        return pitch_px * (self.assumed_sheet_std_pitch if is_assumed else self.model_std_pitch)

    def frame_std_px(self, grid: TrackedGrid, model_std_px: float) -> float:
        """Median standard deviation of the marker images of a frame along an axis."""
        noise_px2 = 0.5 * np.trace(grid.covariance_px2[grid.is_seen], axis1=1, axis2=2)
        return float(np.sqrt(np.median(noise_px2) + model_std_px**2))

    def noise_ratio(self, grid: TrackedGrid, model_std_px: float) -> float:
        """Deviation of a frame's marker images over the usual one; at least 1."""
        return max(1.0, self.frame_std_px(grid, model_std_px) / (self.usual_ratio * model_std_px))


def marker_variances_px2(grid: TrackedGrid, model_std_px: float) -> Scalars:
    """(m,) variance of each marker image along an axis; that of a marker that is not seen is arbitrary."""
    noise_px2 = np.where(grid.is_seen, 0.5 * np.trace(grid.covariance_px2, axis1=1, axis2=2), 1.0)
    return np.asarray(noise_px2 + model_std_px**2)
