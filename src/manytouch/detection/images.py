"""The region of interest of images."""

import numpy as np
from jaxtyping import Float64

from manytouch.values import Roi


def crop(image: np.ndarray, roi_px: Roi | None) -> tuple[np.ndarray, Float64[np.ndarray, "2"]]:
    """The region of interest of an image, and the position of its first pixel."""
    if roi_px is None:
        return image, np.zeros(2)
    x, y, width, height = roi_px
    x0, y0 = max(x, 0), max(y, 0)
    return image[y0 : max(y + height, 0), x0 : max(x + width, 0)], np.array([float(x0), float(y0)])
