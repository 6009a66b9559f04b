"""Quality of the camera image and of the rest position: numbers for the health pane of the viewer."""

import math
import time

import cv2
import numpy as np

from manytouch.values import Reading
from manytouch.values.images.grey_levels import least_scale, to_8_bits

INTERVAL_S = 0.1
"""Between two images whose quality is measured: the numbers are for reading, and each takes a millisecond."""
_STRIDE = 4
BLACK_LEVEL, WHITE_LEVEL = 4, 251
"""Pixels at or beyond one of them are clipped: they have no detail. Grey levels of 255."""


class ImageQuality:
    """Focus and brightness of the images of a source.

    Focus is the variance of the Laplacian of an image over its variance, relative to the best image so far:
    1 is as sharp as the sharpest.
    """

    def __init__(self) -> None:
        self._best = 0.0
        self._scale: float | None = None
        self._measured_s = -math.inf
        self._found: dict[str, float] = {}

    def latest(self, image: np.ndarray) -> dict[str, float]:
        """The quality of this image, or of one of the last `INTERVAL_S` seconds."""
        now_s = time.monotonic()
        if now_s - self._measured_s >= INTERVAL_S:
            self._measured_s, self._found = now_s, self(image)
        return self._found

    def __call__(self, image: np.ndarray) -> dict[str, float]:
        """Focus 0..1, median level 0..1, and the share of clipped pixels, black or white without detail."""
        grey = image if image.ndim == 2 else image[..., 1]
        self._scale = least_scale(self._scale, image)
        grey = to_8_bits(grey, self._scale)
        height, width = grey.shape
        middle = np.ascontiguousarray(
            grey[height // 4 : height - height // 4 : 2, width // 4 : width - width // 4 : 2]
        )
        spread = _variance(middle)
        sharp = _variance(cv2.Laplacian(middle, cv2.CV_32F)) / spread if spread > 0 else 0.0
        self._best = max(self._best, sharp)
        few = np.ascontiguousarray(grey[::_STRIDE, ::_STRIDE])
        up_to = cv2.calcHist([few], [0], None, [256], [0, 256]).ravel().cumsum(dtype=np.int64)
        middles = np.searchsorted(up_to, [(few.size - 1) // 2, few.size // 2], side="right")
        clipped = up_to[BLACK_LEVEL] + few.size - up_to[WHITE_LEVEL - 1]
        return {
            "focus": sharp / self._best if self._best > 0 else 0.0,
            "level": float(middles.mean()) / 255.0,
            "clipped": float(clipped) / few.size,
        }


def _variance(values: np.ndarray) -> float:
    """Variance of all pixels."""
    _, deviation = cv2.meanStdDev(values)
    return float(deviation[0, 0]) ** 2


def residual_mm(reading: Reading) -> float:
    """Median of |depth| while nothing touches the sheet; NaN during contacts.

    At rest it should be as small as the standard deviation of a depth. A larger value indicates that the
    sheet has crept or the camera has moved, and that a tare is due.
    """
    if reading.contacts.touching:
        return float("nan")
    depth_mm = np.abs(reading.surface.displacement_mm[:, 2])
    return float(np.nanmedian(depth_mm)) if np.isfinite(depth_mm).any() else float("nan")
