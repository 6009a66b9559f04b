"""What is wrong with a whole image, from a few of its pixels and from its dots."""

from dataclasses import dataclass

import numpy as np

from manytouch.medians import median
from manytouch.values import Detections, Status
from manytouch.values.arrays import Scalars

STRIDE_PX = 16
"""Distance of the pixels, along x and y, that are examined."""
DARK_LEVEL = 12.0
"""An image is dark if 95 % of its pixels are below, grey levels of 255."""
SATURATED_LEVEL = 250.0
"""An image as a whole is saturated if half of its pixels are above, grey levels of 255."""
FEW_DOTS = 0.5
"""An image is dark or saturated only if it shows less than this share of the expected dots."""
LEAST_DOTS = 0.2
"""An image is blurred only if it shows at least this share of the expected dots, so that the median width of
their edges is that of dots."""
EDGE_GROWTH = 1.6
"""Edges are wide above this many times their width in the reference plus `EDGE_MARGIN_PX`."""
EDGE_MARGIN_PX = 0.7
"""Width that even sharp edges exceed in noise, in addition."""
CONTRAST_LOSS = 0.9
"""A blurred image has less than this share of the contrast of the reference: blur lowers the contrast, a
change of the light does not widen the edges."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReferenceImage:
    """Properties of the first good image, which later ones are compared with.

    Attributes:
        shape: of the image.
        dots: number of dots.
        edge_px: median width of their edges.
        contrast: median contrast.
    """

    shape: tuple[int, ...]
    dots: int
    edge_px: float
    contrast: float


def describe_reference(image: np.ndarray, found: Detections, edge_px: Scalars) -> ReferenceImage:
    """Properties of a good image; `edge_px` (n,) are the widths of the edges of its dots."""
    return ReferenceImage(
        shape=image.shape,
        dots=len(edge_px),
        edge_px=median(edge_px),
        contrast=median(found.contrast),
    )


def find_condition(
    reference: ReferenceImage | None,
    image: np.ndarray,
    found: Detections,
    edge_px: Scalars,
    *,
    level_scale: float,
    markers: int,
) -> Status:
    """Status of an image: OK, DARK, SATURATED or BLURRED.

    An image is dark or saturated only if the dots are not found either: a bright sheet may well be
    overexposed, and a dark one black.

    Args:
        reference: the first good image; None before.
        image: (h, w) or (h, w, c).
        found: its dots.
        edge_px: (n,) widths of their edges.
        level_scale: grey levels of 255 per level of the image.
        markers: expected number of dots without a reference.
    """
    number = len(edge_px)
    expected = reference.dots if reference is not None else markers
    if number < FEW_DOTS * expected:
        few = image[STRIDE_PX // 2 :: STRIDE_PX, STRIDE_PX // 2 :: STRIDE_PX].astype(np.float32) * level_scale
        if few.size and np.quantile(few, 0.95) < DARK_LEVEL:
            return Status.DARK
        if few.size and np.mean(few > SATURATED_LEVEL) > 0.5:
            return Status.SATURATED
    if reference is not None and number >= LEAST_DOTS * expected and number > 0:
        is_wide = 2 * np.count_nonzero(edge_px > EDGE_GROWTH * reference.edge_px + EDGE_MARGIN_PX) > number
        if is_wide and median(found.contrast) < CONTRAST_LOSS * reference.contrast:
            return Status.BLURRED
    return Status.OK
