"""Sharpness of the dots of an image, for `calibrate rest` and `doctor`."""

import numpy as np

from manytouch.detection import estimate_noise, measure
from manytouch.detection.images import crop
from manytouch.values import Roi
from manytouch.values.arrays import Points2, Scalars
from manytouch.values.images.grey_levels import level_scale

SOFT_EDGE_PX = 3.5
SOFT_SHARE = 0.5


def edge_width_px(
    image: np.ndarray,
    weights: np.ndarray,
    centre_px: Points2,
    radius_px: Scalars,
    *,
    roi_px: Roi | None = None,
) -> float:
    """Median width of the edges of the dots, from background to dot, px; NaN if no dot is complete.

    Args:
        image: (h, w) or (h, w, 3) as the camera gave it.
        weights: (c,) of its channels, as `Appearance.weights` gives them.
        centre_px, radius_px: (n, 2), (n,) of the dots.
        roi_px: x, y, width, height of the region of interest.
    """
    part, corner = crop(image, roi_px)
    scaled = weights * level_scale(image)
    dots = measure(part, scaled, centre_px - corner, radius_px, noise=estimate_noise(part, scaled))
    edge_px = dots.edge_px[dots.is_found & np.isfinite(dots.edge_px)]
    return float(np.median(edge_px)) if len(edge_px) else np.nan


def is_soft(edge_px: float, radius_px: Scalars) -> bool:
    """Whether the edges are so wide that the lens is out of focus or the image is blurred by motion."""
    return edge_px > SOFT_EDGE_PX and edge_px > SOFT_SHARE * float(np.median(radius_px))
