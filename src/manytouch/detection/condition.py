"""What is wrong with a whole picture, told from a few of its pixels and from its dots."""

from dataclasses import dataclass

import numpy as np

from manytouch.values import Detections, Status
from manytouch.values.arrays import Scalars

STRIDE = 16
DARK, BRIGHT = 12.0, 250.0  # grey levels of 255


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class First:
    """The first good picture, which later ones are compared with.

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


def middle_of(ordered: Scalars) -> float:
    """Median of sorted values; 0 of none."""
    size = len(ordered)
    return 0.5 * float(ordered[size // 2] + ordered[(size - 1) // 2]) if size else 0.0


def first_of(image: np.ndarray, found: Detections, edge_px: Scalars) -> First:
    """What to remember of a good picture; `edge_px` (n,) are the widths of the dots' edges."""
    return First(
        shape=image.shape,
        dots=len(edge_px),
        edge_px=middle_of(np.sort(edge_px)),
        contrast=middle_of(np.sort(found.contrast)),
    )


def condition(
    first: First | None,
    image: np.ndarray,
    found: Detections,
    edge_px: Scalars,
    *,
    level: float,
    markers: int,
) -> Status:
    """`OK`, or dark, saturated, blurred.

    Dark and saturated are said only when the dots are gone with the light: a bright sheet may well
    be overexposed, and a dark one black.
    """
    number = len(edge_px)
    wanted = first.dots if first is not None else markers
    if number < 0.5 * wanted:
        few = image[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE].astype(np.float32) * level
        if few.size and np.quantile(few, 0.95) < DARK:
            return Status.DARK
        if few.size and np.mean(few > BRIGHT) > 0.5:
            return Status.SATURATED
    if first is not None and number >= 0.2 * wanted and number > 0:
        is_wide = 2 * np.count_nonzero(edge_px > 1.6 * first.edge_px + 0.7) > number
        if is_wide and middle_of(np.sort(found.contrast)) < 0.9 * first.contrast:
            return Status.BLURRED
    return Status.OK
