"""Grey levels of 255, of images with 8 or 16 bits per channel."""

import numpy as np


def level_scale(image: np.ndarray) -> float:
    """Grey levels of 255 per level of an image, whose largest level decides.

    Cameras store 10, 12 or 14 bits in 16: as the upper ones, so that the largest level is near 65535, or as
    the lower ones, so that it is below 1024, 4096 or 16384. The fewest of 8, 10, 12, 14 and 16 bits that
    contain the largest level of this image are taken as those of the camera: a dark image may have fewer.

    Args:
        image: (h, w) or (h, w, c), uint8 or uint16.
    """
    if image.dtype == np.uint8:
        return 1.0
    largest = int(image.max())
    bits = next(bits for bits in (8, 10, 12, 14, 16) if largest < 2**bits)
    return 255.0 / float(2**bits - 1)


def to_8_bits(image: np.ndarray, scale: float | None = None) -> np.ndarray:
    """The image with 8 bits per channel, 255 being the largest level; one that has them already, as it is.

    Args:
        image: (h, w) or (h, w, c), uint8 or uint16.
        scale: `level_scale` of the camera; None: of this image.
    """
    if image.dtype == np.uint8:
        return image
    import cv2

    return np.asarray(cv2.convertScaleAbs(image, alpha=level_scale(image) if scale is None else scale))


def least_scale(known: float | None, image: np.ndarray) -> float:
    """The scale of a camera by its images so far, so that a dark one among them is not shown brighter.

    Args:
        known: by the images before; None before the first one.
        image: the next one.
    """
    scale = level_scale(image)
    return scale if known is None else min(known, scale)
