"""Slow update of the reference while nothing touches the sheet, which creeps and warms."""

from dataclasses import dataclass

import numpy as np

from manytouch.estimation.frame_interval import remaining
from manytouch.values import TrackedGrid
from manytouch.values.arrays import Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReferenceDrift:
    """Follows the markers by exponential smoothing, within a bound.

    Attributes:
        time_constant_s: the time constant with which the reference follows the markers.
        max_drift_pitch: largest distance of the reference from the initial one, in pitches; a tare is needed
            for more.
    """

    time_constant_s: float = 6.6
    max_drift_pitch: float = 0.01

    def __call__(
        self,
        reference_px: Points2,
        initial_px: Points2,
        grid: TrackedGrid,
        pitch_px: float,
        *,
        elapsed_s: float,
    ) -> Points2:
        """The reference (m, 2) after a frame in which nothing touches the sheet.

        Args:
            reference_px: (m, 2) before the frame.
            initial_px: (m, 2) at the start.
            grid: of the frame; markers that are not seen keep their reference.
            pitch_px: pitch in the image.
            elapsed_s: time since the frame before.
        """
        difference_px = np.where(grid.is_seen[:, None], grid.position_px - reference_px, 0.0)
        share = 1.0 - remaining(elapsed_s, self.time_constant_s)
        drift_px = reference_px + share * difference_px - initial_px
        length = np.linalg.norm(drift_px, axis=1, keepdims=True)
        max_drift_px = self.max_drift_pitch * pitch_px
        return read_only(initial_px + drift_px * np.minimum(1.0, max_drift_px / np.maximum(length, 1e-300)))
