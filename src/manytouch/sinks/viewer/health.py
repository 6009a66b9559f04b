"""How well the picture is taken and the readings flow: the numbers of the viewer's health strip."""

import cv2
import numpy as np

from manytouch.values import Reading

_STRIDE = 4
DARK, BRIGHT = 4, 251  # grey levels of 255 that hold no detail


class PictureHealth:
    """Focus and exposure of a source's pictures, told from a quarter of their lines and columns.

    Focus is the share of sharp change in the picture (variance of its Laplacian over its variance), in
    parts of the best seen so far, so 1 is as sharp as it ever was.
    """

    def __init__(self) -> None:
        self._best = 0.0

    def __call__(self, image: np.ndarray) -> dict[str, float]:
        """Focus 0..1, median level 0..1, share of pixels that are black or white without detail."""
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
            "clipped": float(np.mean((few <= DARK) | (few >= BRIGHT))),
        }


def residual_mm(reading: Reading) -> float:
    """How deep the sheet seems to be while nothing touches: the median of |depth|; NaN while something does.

    At rest it should be as small as the deviation of a depth; more says that the sheet has crept or the
    camera has moved, and that it is time to tare.
    """
    if reading.contacts.touching:
        return float("nan")
    depth_mm = np.abs(reading.surface.displacement_mm[:, 2])
    return float(np.nanmedian(depth_mm)) if np.isfinite(depth_mm).any() else float("nan")
