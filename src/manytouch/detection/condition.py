"""What is wrong with a whole picture, told from a few of its pixels and from its dots."""

from dataclasses import dataclass

import numpy as np

from manytouch.detection.centroid import Dots

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


def first_of(image: np.ndarray, dots: Dots, keep: np.ndarray) -> First:
    """What to remember of a good picture."""
    return First(
        shape=image.shape,
        dots=int(keep.sum()),
        edge_px=float(np.median(dots.edge_px[keep])),
        contrast=float(np.median(dots.contrast[keep])),
    )


def condition(
    first: First | None, image: np.ndarray, dots: Dots, keep: np.ndarray, *, level: float, markers: int
) -> str:
    """ "ok", or dark, saturated, blurred.

    Dark and saturated are said only when the dots are gone with the light: a bright sheet may well
    be overexposed, and a dark one black.
    """
    found = int(keep.sum())
    wanted = first.dots if first is not None else markers
    if found < 0.5 * wanted:
        few = image[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE].astype(np.float32) * level
        if few.size and np.quantile(few, 0.95) < DARK:
            return "dark"
        if few.size and np.mean(few > BRIGHT) > 0.5:
            return "saturated"
    if first is not None and found >= 0.2 * wanted and found > 0:
        edge_px = float(np.median(dots.edge_px[keep]))
        contrast = float(np.median(dots.contrast[keep]))
        if edge_px > 1.6 * first.edge_px + 0.7 and contrast < 0.9 * first.contrast:
            return "blurred"
    return "ok"
