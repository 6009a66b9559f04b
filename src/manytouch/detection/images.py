"""Region of interest and grey levels of images."""

import numpy as np
from jaxtyping import Float64

from manytouch.values import Roi


def level_scale(image: np.ndarray) -> float:
    """Grey levels of 255 per level of the image: cameras store 10, 12, 14 bits in 16, in either end."""
    if image.dtype == np.uint8:
        return 1.0
    largest = int(image.max())
    bits = next(bits for bits in (8, 10, 12, 14, 16) if largest < 2**bits)
    return 255.0 / float(2**bits - 1)


def crop(image: np.ndarray, roi_px: Roi | None) -> tuple[np.ndarray, Float64[np.ndarray, "2"]]:
    """The region of interest of an image, and the position of its first pixel."""
    if roi_px is None:
        return image, np.zeros(2)
    x, y, width, height = roi_px
    x0, y0 = max(x, 0), max(y, 0)
    return image[y0 : max(y + height, 0), x0 : max(x + width, 0)], np.array([float(x0), float(y0)])
