"""The markers of the layout as one frame shows them."""

from dataclasses import dataclass

from manytouch.values.arrays import Counts, Covariances2, Mask, Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrackedGrid:
    """Which dot is which marker; index = marker of the layout.

    Attributes:
        position_px: (m, 2) measured centres; NaN where not seen.
        covariance_px2: (m, 2, 2); NaN where not seen.
        is_seen: (m,) a marker whose identity is doubtful is not seen.
        frames_unseen: (m,) frames since it was last seen; 0 where seen.
        area_px2: (m,) of the dots in the image; NaN where not seen; None where nothing measured it.
        status: "ok", or few_markers, or what the detections said of the picture.
    """

    position_px: Points2
    covariance_px2: Covariances2
    is_seen: Mask
    frames_unseen: Counts
    area_px2: Scalars | None = None
    status: str = "ok"
