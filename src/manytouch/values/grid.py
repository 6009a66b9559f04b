"""Markers of one frame."""

from dataclasses import dataclass

from manytouch.values.arrays import Counts, Covariances2, Mask, Points2, Scalars, reduced
from manytouch.values.status import Status


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrackedGrid:
    """Marker positions of one frame; the index is the marker of the layout.

    Attributes:
        position_px: (m, 2) measured centres x, y; NaN where not seen.
        covariance_px2: (m, 2, 2), also of errors by compression where `is_compressed`; NaN where not seen.
        is_seen: (m,) false also where the identity of the dot is doubtful.
        frames_unseen: (m,) number of successive frames up to this one in which the marker was not seen; 0
            where seen. One that was never seen, also because it is known to be missing, counts from the first
            frame. A recording and the process of the outputs do not keep the number: 1 there where not seen.
        area_px2: (m,) area of the dots; NaN where not seen; None if the method does not measure it.
        lost_ids: number of markers that were seen in the frame before and are not in this one; None if the
            method does not count it: only `paper` does.
        new_ids: number of dots of this frame that got an identity that no marker of the layout has; None if
            the method gives no new identities: only `paper` does.
        status: that of the detections if it is not `OK`; else `AMBIGUOUS_SHIFT`, `FEW_MARKERS` or `OK`. The
            method `paper` has `MANY_MARKERS` instead of `AMBIGUOUS_SHIFT`.
        is_compressed: whether markers that stayed exactly where they were have shown that these are pictures
            of compressed video. The process of the outputs does not keep it, and `paper` does not notice it.
        timestamp_ns: that of the frame, by which an estimator knows the time between frames; None: not known.
    """

    position_px: Points2
    covariance_px2: Covariances2
    is_seen: Mask
    frames_unseen: Counts
    area_px2: Scalars | None = None
    lost_ids: int | None = None
    new_ids: int | None = None
    status: Status = Status.OK
    is_compressed: bool = False
    timestamp_ns: int | None = None

    __reduce__ = reduced

    def __repr__(self) -> str:
        return f"TrackedGrid({int(self.is_seen.sum())} of {len(self.is_seen)} markers seen, {self.status})"
