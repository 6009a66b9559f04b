"""Noise of a pixel, from second differences along a few rows, compiled."""

import math
from typing import no_type_check

import numpy as np
from jaxtyping import Float64
from numba import njit

from manytouch.detection.compilation import FAST

MIN_NOISE = 0.3  # grey levels: rounding to whole levels has a deviation of 1 / sqrt(12)
ENOUGH = 4096  # samples: 1.5 % error


def noise_of(image: np.ndarray, weights: Float64[np.ndarray, " c"], rows: int = 24) -> float:
    """Standard deviation of a pixel in grey levels of 255, from second differences along a few rows.

    What differs by more than 2.5 deviations (edges of dots) is left out. Compression
    smooths the noise away: then this is low. Of wide images every so many columns are looked at.
    """
    height, width = image.shape[:2]
    if width < 3:
        return MIN_NOISE
    take = np.unique(np.linspace(0, height - 1, min(rows, height)).astype(np.int64))
    stride = max(1, len(take) * (width - 2) // max(ENOUGH, rows * ENOUGH // 24))
    step = float(np.abs(weights).sum()) if image.dtype == np.uint8 else 0.0
    if image.dtype not in (np.uint8, np.uint16):
        image = image.astype(np.float32)
    planes = image[:, :, None] if image.ndim == 2 else image
    second = np.empty((len(take), (width - 3) // stride + 1), dtype=np.float32)
    _second_differences(planes, weights.astype(np.float32), take, stride, second)
    flat = second.ravel()
    middle = float(np.partition(flat, flat.size // 2)[flat.size // 2])
    return max(float(_deviation(flat, middle, step)), MIN_NOISE)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _second_differences(image, weights, rows, stride, second):
    for r in range(rows.shape[0]):
        y = rows[r]
        for k in range(second.shape[1]):
            x = k * stride
            total = np.float32(0.0)
            for c in range(weights.shape[0]):
                outer = np.float32(image[y, x, c]) + np.float32(image[y, x + 2, c])
                total += weights[c] * (outer - np.float32(2.0) * np.float32(image[y, x + 1, c]))
            second[r, k] = abs(total)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _deviation(second, middle, step):
    """From second differences (n,), of which `middle` is the median; ties count as spread over `step`."""
    f = np.float32
    m = f(middle)
    below = ties = f(0.0)
    for i in range(second.shape[0]):
        below += f(1.0) if second[i] < m else f(0.0)
        ties += f(1.0) if second[i] == m else f(0.0)
    # ties of whole grey levels are spread evenly before the median is taken
    share = (0.5 * second.shape[0] - below) / ties
    median = max(middle + (share - 0.5) * step, 0.0)
    limit = f(2.5 * max(median / 0.6745, step))
    square = number = f(0.0)
    for i in range(second.shape[0]):
        is_within = f(1.0) if second[i] < limit else f(0.0)
        number += is_within
        square += is_within * second[i] * second[i]
    if number == f(0.0):
        return 0.0
    # second moment of what lies within 2.5 deviations, where a normal distribution keeps 0.911 of it
    return math.sqrt(square / number / (0.911 * 6.0))
