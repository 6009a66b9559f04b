"""The reference of the untouched sheet, which creeps and warms: slowly learnt while nothing touches."""

from dataclasses import dataclass

import numpy as np

from manytouch.values import TrackedGrid
from manytouch.values.arrays import Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReferenceDrift:
    """How the reference follows.

    Attributes:
        share: of what is left, per frame.
        farthest_pitch: it never goes further than this from where it began, in pitches: what a person
            wants to call untouched beyond that is said by a tare.
    """

    share: float = 0.005
    farthest_pitch: float = 0.01

    def __call__(
        self, reference_px: Points2, began_px: Points2, grid: TrackedGrid, pitch_px: float
    ) -> Points2:
        """(m, 2) the reference after a frame that nothing touches."""
        left_px = np.where(grid.is_seen[:, None], grid.position_px - reference_px, 0.0)
        gone_px = reference_px + self.share * left_px - began_px
        length = np.linalg.norm(gone_px, axis=1, keepdims=True)
        farthest_px = self.farthest_pitch * pitch_px
        return read_only(began_px + gone_px * np.minimum(1.0, farthest_px / np.maximum(length, 1e-300)))
