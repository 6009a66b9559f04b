"""Noise of marker images that their detection does not know of."""

from dataclasses import dataclass, replace

import numpy as np

from manytouch.geometry.neighbours import Neighbours
from manytouch.medians import median
from manytouch.values import TrackedGrid
from manytouch.values.arrays import Mask, Points2, Scalars, read_only

_MEDIAN_CHI2 = 0.4549
"""Median of the square of a normally distributed number, over its variance."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ExcessNoiseState:
    """What a frame passes to the next one.

    Attributes:
        position_px: (m, 2) of the frame before; NaN where not seen.
        held_share: share of the markers that stayed exactly where they were, mean over the last frames.
        same_pictures: number of frames in a row, up to `ExcessNoise.noiseless_frames`, in which all of them
            did.
        is_compressed: whether that share was once too large for pictures of their own.
        variance_px2: the excess along an axis.
    """

    position_px: Points2
    held_share: float = 0.0
    same_pictures: int = 0
    is_compressed: bool = False
    variance_px2: float = 0.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ExcessNoise:
    """Variance that marker images have in excess of the one that is assumed.

    Compressed video keeps a block of pixels as it was in the picture before, or displaces it, unless it has
    changed by more than a threshold. Its pixels have hardly any noise, but its dots are displaced. It is
    found by markers that stay exactly where they were, which noise does not allow. Its errors are assumed to
    be `compressed_std_px`, or more where the residuals of the fits show more: those of near markers differ by
    more than their variances explain, while an error of the model is about the same at near markers. The
    median over all markers does not depend on what happens under a few contacts.

    Attributes:
        held_stds: a marker stayed where it was if it moved by less than this, in standard deviations.
        max_held_share: largest mean share of such markers in pictures of their own, where it is 0.005.
        frames: number of frames over which the mean is taken.
        noiseless_frames: after so many frames in a row in which no marker moved, pictures have no noise, as
            simulated ones may, and markers that nothing moves do not show that a video is compressed.
        compressed_std_px: errors of dots in compressed video along an axis. In H.264 of quality 23 (the usual
            one of x264), 30 and 36 they were 0.025, 0.045 and 0.08 px, in MPEG-4 of quality 8 0.05 px.
        share: share of a new value where it is less than the one before. A larger one holds at once.
    """

    held_stds: float = 0.1
    max_held_share: float = 0.05
    frames: int = 10
    noiseless_frames: int = 5
    compressed_std_px: float = 0.05
    share: float = 0.1

    def start(self, markers: int) -> ExcessNoiseState:
        """The state before the first frame."""
        return ExcessNoiseState(position_px=read_only(np.full((markers, 2), np.nan)))

    def observe(self, state: ExcessNoiseState, grid: TrackedGrid) -> ExcessNoiseState:
        """The state with what a new frame shows, before its fit."""
        moved_px = grid.position_px - state.position_px
        is_known = ~np.isnan(moved_px[:, 0])
        after = replace(state, position_px=grid.position_px)
        is_noiseless = state.same_pictures == self.noiseless_frames
        if state.is_compressed or is_noiseless or not is_known.any():
            return after
        moved_px2 = (moved_px[is_known] ** 2).sum(axis=1)
        trace_px2 = np.trace(grid.covariance_px2[is_known], axis1=1, axis2=2)
        held = float(np.mean(moved_px2 < 2.0 * self.held_stds**2 * trace_px2))
        if held == 1.0:
            return replace(after, same_pictures=state.same_pictures + 1)
        after = replace(after, same_pictures=0)
        held_share = state.held_share + (held - state.held_share) / self.frames
        if held_share <= self.max_held_share:
            return replace(after, held_share=held_share)
        return replace(after, is_compressed=True, variance_px2=self.compressed_std_px**2)

    def update(
        self,
        state: ExcessNoiseState,
        residual_px: Points2,
        variance_px2: Scalars,
        is_used: Mask,
        neighbours: Neighbours,
    ) -> ExcessNoiseState:
        """The state after a fit.

        Args:
            state: with the excess that was assumed in this frame.
            residual_px: (m, 2) of the fit; any value where not used.
            variance_px2: (m,) assumed along an axis, the excess included.
            is_used: (m,) markers with a residual.
            neighbours: of each marker.
        """
        near = is_used[neighbours.index]
        count = np.maximum(near.sum(axis=1), 1)[:, None]
        mean_px = np.einsum("mk,mkc->mc", near, residual_px[neighbours.index]) / count
        rough_px2 = (residual_px - mean_px) ** 2 * (count / (count + 1.0))
        # half of the squares are less than the median of their distribution if the variances are right
        more_px2 = (rough_px2 / _MEDIAN_CHI2 - variance_px2[:, None])[is_used]
        least_px2 = self.compressed_std_px**2 if state.is_compressed else 0.0
        now_px2 = max(state.variance_px2 + float(median(more_px2.ravel())), least_px2)
        share = 1.0 if now_px2 > state.variance_px2 else self.share
        return replace(state, variance_px2=state.variance_px2 + share * (now_px2 - state.variance_px2))
