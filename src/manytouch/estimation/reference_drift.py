"""Slow update of the reference while nothing touches the sheet, which creeps and warms."""

from dataclasses import dataclass

import numpy as np

from manytouch.values import TrackedGrid
from manytouch.values.arrays import Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReferenceDrift:
    """Follows the markers by exponential smoothing, within a bound.

    Attributes:
        share: of the difference between markers and reference, the share that is taken over in a frame.
        max_drift_pitch: largest distance of the reference from the initial one, in pitches; a tare is needed
            for more.
    """

    share: float = 0.005
    max_drift_pitch: float = 0.01

    def __call__(
        self, reference_px: Points2, initial_px: Points2, grid: TrackedGrid, pitch_px: float
    ) -> Points2:
        """The reference (m, 2) after a frame in which nothing touches the sheet.

        Args:
            reference_px: (m, 2) before the frame.
            initial_px: (m, 2) at the start.
            grid: of the frame; markers that are not seen keep their reference.
            pitch_px: pitch in the image.
        """
        difference_px = np.where(grid.is_seen[:, None], grid.position_px - reference_px, 0.0)
        drift_px = reference_px + self.share * difference_px - initial_px
        length = np.linalg.norm(drift_px, axis=1, keepdims=True)
        max_drift_px = self.max_drift_pitch * pitch_px
        return read_only(initial_px + drift_px * np.minimum(1.0, max_drift_px / np.maximum(length, 1e-300)))
