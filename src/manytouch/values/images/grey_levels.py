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
