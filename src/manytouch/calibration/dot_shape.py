"""Whether the dots of an image are round, or squeezed along one axis."""

import numpy as np

from manytouch.detection.images import crop
from manytouch.values import Roi
from manytouch.values.arrays import Points2, Scalars

MAX_DOTS = 400
_REACH = 1.6  # half the side of a window, in radii of its dot
_LEAST_PX = 12  # of a dot whose shape is measured


def height_over_width(
    image: np.ndarray,
    weights: np.ndarray,
    centre_px: Points2,
    radius_px: Scalars,
    *,
    roi_px: Roi | None = None,
) -> float:
    """Median ratio of the extents of the dots along y and x; NaN if no dot is complete.

    The extents are the square roots of the second moments of the pixels above half the contrast. At most
    `MAX_DOTS` dots are measured.

    Args:
        image: (h, w) or (h, w, 3) as the camera gave it.
        weights: (c,) of its channels, as `Appearance.weights` gives them.
        centre_px, radius_px: (n, 2), (n,) of the dots, whole-image coordinates.
        roi_px: x, y, width, height of the region of interest.
    """
    part, corner = crop(image, roi_px)
    grey = part @ weights if part.ndim == 3 else part * float(weights[0])
    chosen = np.linspace(0, len(centre_px) - 1, min(len(centre_px), MAX_DOTS)).astype(np.int64)
    ratios = [
        _ratio(grey, centre, float(radius))
        for centre, radius in zip(centre_px[chosen] - corner, radius_px[chosen], strict=True)
    ]
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    return float(np.median(known)) if known else np.nan


def _ratio(grey: np.ndarray, centre_px: np.ndarray, radius_px: float) -> float:
    """Extent along y over that along x of one dot; NaN if its window is cut off or the dot is too small."""
    reach = int(np.ceil(_REACH * radius_px))
    column, row = np.round(centre_px).astype(np.int64)
    if min(column, row) < reach or row + reach >= grey.shape[0] or column + reach >= grey.shape[1]:
        return np.nan
    window = grey[row - reach : row + reach + 1, column - reach : column + reach + 1]
    border = np.concatenate([window[0], window[-1], window[1:-1, 0], window[1:-1, -1]])
    off = np.abs(window - np.median(border))
    y, x = np.nonzero(off > 0.5 * np.median(off[reach - 1 : reach + 2, reach - 1 : reach + 2]))
    if len(x) < _LEAST_PX or np.ptp(x) == 0:
        return np.nan
    return float(y.std() / x.std())
