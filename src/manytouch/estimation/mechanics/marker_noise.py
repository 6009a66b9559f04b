"""Standard deviations of marker images."""

from dataclasses import dataclass, replace

import numpy as np

from manytouch.medians import median
from manytouch.values import Sensor, TrackedGrid
from manytouch.values.arrays import Scalars, read_only

USUAL_REST_FRAMES = 15
"""Number of frames at rest with which `model_std_pitch` was determined."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerNoise:
    """Parameters of the standard deviations of marker images.

    Attributes:
        model_std_pitch: standard deviation of a marker image that the model does not explain, in pitches.
        max_pitch_thickness: a pitch of more thicknesses counts as one of so many. What the model does not
            explain extends over thicknesses, and a press moves markers that are further apart by less. It was
            chosen on presses with pitches of 1.5 to 5 thicknesses.
        default_centre_noise_px: noise of centres if the sensor does not state it.
        usual_ratio: largest ratio of the whole standard deviation of marker images to that of model and rest
            positions in a frame that does not count as noisy.
        rough_share: share of the model's standard deviation by which a marker may differ from its neighbours.
            The error of the model is alike at near markers, unlike noise. Chosen on sharp images of 53 random
            sheets with known properties, where it was 0.1 to 0.5 in most frames, and 0.85 at the most.
    """

    model_std_pitch: float = 8.4e-4
    max_pitch_thickness: float = 2.0
    default_centre_noise_px: float = 0.05
    usual_ratio: float = 1.5
    rough_share: float = 0.5

    def unexplained_std_px(self, pitch_px: float, pitch_thickness: float) -> float:
        """`model_std_pitch` in pixels, for a pitch in the image and in thicknesses of the sheet."""
        return pitch_px * min(1.0, self.max_pitch_thickness / pitch_thickness) * self.model_std_pitch

    def constant_std_px(self, pitch_px: float, pitch_thickness: float, sensor: Sensor) -> float:
        """Standard deviation that all frames have in common: of the model, and of the rest positions.

        A rest position is the mean over the frames at rest of this recording. With the usual number of them
        its noise is part of `model_std_pitch`; with fewer, what is missing is added.
        """
        frames = USUAL_REST_FRAMES if sensor.rest_frames is None else sensor.rest_frames
        noise_px = sensor.centre_noise_px or self.default_centre_noise_px
        excess = max(0.0, 1.0 / frames - 1.0 / USUAL_REST_FRAMES)
        return float(np.hypot(self.unexplained_std_px(pitch_px, pitch_thickness), noise_px * excess**0.5))

    def frame_std_px(self, grid: TrackedGrid, model_std_px: float) -> float:
        """Median standard deviation of the marker images of a frame along an axis.

        Args:
            grid: the frame.
            model_std_px: of the model and of the rest positions, as from `constant_std_px`.
        """
        noise_px2 = _variance_px2(grid)[grid.is_seen]
        return float(np.sqrt(median(noise_px2) + model_std_px**2))

    def usual_std_px(self, model_std_px: float) -> float:
        """Largest whole standard deviation of the marker images of a frame that does not count as noisy."""
        return self.usual_ratio * model_std_px

    def noise_ratio(self, grid: TrackedGrid, model_std_px: float) -> float:
        """`frame_std_px` over `usual_std_px`; at least 1."""
        return max(1.0, self.frame_std_px(grid, model_std_px) / self.usual_std_px(model_std_px))

    def rough_px2(self, grid: TrackedGrid, model_std_px: float) -> Scalars:
        """(m,) variance along an axis by which a marker image differs from those of its neighbours.

        `model_std_px` is that of the model and of the rest positions, as from `constant_std_px`.
        """
        return marker_variances_px2(grid, self.rough_share * model_std_px)


def marker_variances_px2(grid: TrackedGrid, model_std_px: float) -> Scalars:
    """(m,) variance of each marker image along an axis; that of a marker that is not seen is arbitrary.

    `model_std_px` is that of the model and of the rest positions, as from `MarkerNoise.constant_std_px`.
    """
    noise_px2 = np.where(grid.is_seen, _variance_px2(grid), 1.0)
    return np.asarray(noise_px2 + model_std_px**2)


def _variance_px2(grid: TrackedGrid) -> Scalars:
    """(m,) mean variance along both axes."""
    return np.asarray(0.5 * (grid.covariance_px2[:, 0, 0] + grid.covariance_px2[:, 1, 1]))


def with_excess(grid: TrackedGrid, excess_px2: float) -> TrackedGrid:
    """A frame whose marker images have a variance that is larger by `excess_px2` along each axis."""
    if excess_px2 == 0.0:
        return grid
    return replace(grid, covariance_px2=read_only(grid.covariance_px2 + excess_px2 * np.eye(2)))
