"""Markers of compressed video, which stay exactly where they were."""

from dataclasses import dataclass, replace

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Points2, read_only

_MOST_STD_PX = 0.5
"""Markers with larger standard deviations, such as the 3 px of a dot that the border of the image or of its
region cuts, are not counted: that they stay within a tenth of it shows nothing."""
COMPRESSED_VIDEO = (
    "the video is compressed, which displaces dots by a few hundredths of a pixel: deviations are larger, "
    "and faint contacts may be missed. Record with less compression, or every image by itself "
    "(Motion JPEG, PNG, manytouch run --record)"
)
"""A warning where `HeldMarkersState.is_compressed`."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HeldMarkersState:
    """What a frame passes to the next one.

    Attributes:
        position_px: (m, 2) of the last frame in which markers were identified; NaN where not seen.
        share: share of the markers that stayed exactly where they were, mean over the last frames.
        counted: number of frames in which so many stayed that they would show it, but not all.
        same_pictures: number of frames in a row, up to `HeldMarkers.noiseless_frames`, in which all of them
            did.
        is_compressed: whether that share was once too large for pictures of their own, or pictures that a
            codec predicted have stayed the same.
    """

    position_px: Points2
    share: float = 0.0
    counted: int = 0
    same_pictures: int = 0
    is_compressed: bool = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HeldMarkers:
    """Notices compressed video, whose dots are displaced while their pixels have hardly any noise.

    Compressed video keeps a block of pixels as it was in the picture before, or displaces it, unless it has
    changed by more than a threshold. It is found by markers that stay exactly where they were, which noise
    does not allow.

    Attributes:
        held_stds: a marker stayed where it was if it moved by less than this, in standard deviations.
        max_share: largest mean share of such markers in pictures of their own, where it is 0.005.
        frames: number of frames over which the mean is taken.
        least_frames: number of such frames that are needed. The search for dots begins where the frame before
            found them, so that in the first ones some move a little though the pictures are the same.
        same_share: from this share on all of them stayed.
        noiseless_frames: after so many frames in a row in which no marker moved, pictures have no noise, as
            simulated ones may, and markers that nothing moves do not show that a video is compressed. Where a
            codec predicted them (`Frame.is_predicted`), it has removed the noise: the video is compressed.
        std_px: additional errors of the centres of dots in compressed video along an axis. In H.264 of
            quality 23 (the usual one of x264), 30 and 36 they were 0.025, 0.045 and 0.08 px, in MPEG-4 of
            quality 8 0.05 px.
    """

    held_stds: float = 0.1
    max_share: float = 0.05
    frames: int = 10
    least_frames: int = 3
    same_share: float = 0.99
    noiseless_frames: int = 5
    std_px: float = 0.05

    def start(self, markers: int) -> HeldMarkersState:
        """The state before the first frame."""
        return HeldMarkersState(position_px=read_only(np.full((markers, 2), np.nan)))

    def step(
        self,
        state: HeldMarkersState,
        position_px: np.ndarray,
        covariance_px2: np.ndarray,
        *,
        is_predicted: bool = False,
    ) -> HeldMarkersState:
        """The state after a frame, to whose covariances the error of compressed video is added if it is.

        Args:
            state: after the frame before.
            position_px: (m, 2) centres; NaN where not seen.
            covariance_px2: (m, 2, 2) of them, as the pixels show; changed in place.
            is_predicted: of the frame (`Frame.is_predicted`).
        """
        known, held = 0, 0
        if not state.is_compressed and state.same_pictures < self.noiseless_frames:
            known, held = count_held(state.position_px, position_px, covariance_px2, self.held_stds)
        after = self._observed(state, position_px, known, held, is_predicted=is_predicted)
        if after.is_compressed:
            add_variance(covariance_px2, self.std_px**2)
        return after

    def _observed(
        self, state: HeldMarkersState, position_px: Points2, known: int, held: int, *, is_predicted: bool
    ) -> HeldMarkersState:
        """The state after a frame in which `held` of `known` markers stayed where they were."""
        after = replace(state, position_px=position_px)
        if known == 0:
            return after
        if held >= self.same_share * known:
            same_pictures = state.same_pictures + 1
            is_compressed = is_predicted and same_pictures == self.noiseless_frames
            return replace(after, same_pictures=same_pictures, is_compressed=is_compressed)
        share = state.share + (held / known - state.share) / self.frames
        counted = state.counted + (held > self.max_share * known)
        is_compressed = share > self.max_share and counted >= self.least_frames
        return replace(after, share=share, counted=counted, same_pictures=0, is_compressed=is_compressed)


@kernel()
@no_type_check
def count_held(
    before_px: np.ndarray, position_px: np.ndarray, covariance_px2: np.ndarray, held_stds: float
) -> tuple[int, int]:
    """Number of markers that two frames show wholly, and of those that moved by less than `held_stds`.

    Args:
        before_px, position_px: (m, 2) centres in both frames; NaN where not seen.
        covariance_px2: (m, 2, 2) of the second ones.
        held_stds: in standard deviations of the motion along an axis.
    """
    known = held = 0
    for k in range(len(position_px)):
        x, y = position_px[k, 0] - before_px[k, 0], position_px[k, 1] - before_px[k, 1]
        trace_px2 = covariance_px2[k, 0, 0] + covariance_px2[k, 1, 1]
        if not np.isnan(x) and trace_px2 < 2.0 * _MOST_STD_PX * _MOST_STD_PX:
            known += 1
            held += x * x + y * y < 2.0 * held_stds * held_stds * trace_px2
    return known, held


@kernel()
@no_type_check
def add_variance(covariance_px2: np.ndarray, variance_px2: float) -> None:
    """Add a variance along both axes to covariances (m, 2, 2), in place."""
    for k in range(len(covariance_px2)):
        covariance_px2[k, 0, 0] += variance_px2
        covariance_px2[k, 1, 1] += variance_px2
