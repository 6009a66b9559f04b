"""Quality of the camera image and of the rest position: numbers for the health pane of the viewer."""

import cv2
import numpy as np

from manytouch.values import Reading

_STRIDE = 4
DARK_LEVEL = 4
"""A pixel at or below has no detail, grey levels of 255."""
SATURATED_LEVEL = 251
"""A pixel at or above has no detail, grey levels of 255."""


class ImageQuality:
    """Focus and brightness of the images of a source.

    Focus is the variance of the Laplacian of an image over its variance, relative to the best image so far:
    1 is as sharp as the sharpest.
    """

    def __init__(self) -> None:
        self._best = 0.0

    def __call__(self, image: np.ndarray) -> dict[str, float]:
        """Focus 0..1, median level 0..1, and the share of pixels that are black or white without detail."""
        grey = image if image.ndim == 2 else image[..., 1]
        if grey.dtype != np.uint8:
            grey = (grey >> 8).astype(np.uint8)
        height, width = grey.shape
        middle = np.ascontiguousarray(
            grey[height // 4 : height - height // 4 : 2, width // 4 : width - width // 4 : 2]
        )
        spread = float(middle.var())
        sharp = float(cv2.Laplacian(middle, cv2.CV_32F).var()) / spread if spread > 0 else 0.0
        self._best = max(self._best, sharp)
        few = grey[::_STRIDE, ::_STRIDE]
        return {
            "focus": sharp / self._best if self._best > 0 else 0.0,
            "level": float(np.median(few)) / 255.0,
            "clipped": float(np.mean((few <= DARK_LEVEL) | (few >= SATURATED_LEVEL))),
        }


def residual_mm(reading: Reading) -> float:
    """Median of |depth| while nothing touches the sheet; NaN during contacts.

    At rest it should be as small as the standard deviation of a depth. A larger value indicates that the
    sheet has crept or the camera has moved, and that a tare is due.
    """
    if reading.contacts.touching:
        return float("nan")
    depth_mm = np.abs(reading.surface.displacement_mm[:, 2])
    return float(np.nanmedian(depth_mm)) if np.isfinite(depth_mm).any() else float("nan")
