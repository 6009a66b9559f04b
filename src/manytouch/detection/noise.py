"""Noise of a pixel, from second differences along a few rows, compiled."""

import math
from typing import no_type_check

import numpy as np
from jaxtyping import Float64
from numba import njit

from manytouch.detection.compilation import FAST

MIN_NOISE = 0.3  # grey levels: rounding to whole levels has a deviation of 1 / sqrt(12)
ENOUGH = 1024  # samples: 3 % error


FINE = 0.05  # grey levels: bins of what is not whole grey levels
BINS = 4096


def noise_of(image: np.ndarray, weights: Float64[np.ndarray, " c"], rows: int = 24) -> float:
    """Standard deviation of a pixel in grey levels of 255, from second differences along a few rows.

    What differs by more than 2.5 deviations (edges of dots) is left out. Compression
    smooths the noise away: then this is low. Of wide images every so many columns are looked at.
    """
    height, width = image.shape[:2]
    if width < 3:
        return MIN_NOISE
    if image.dtype not in (np.uint8, np.uint16):
        image = image.astype(np.float32)
    rows = min(rows, height)
    stride = max(1, rows * (width - 2) // max(ENOUGH, rows * ENOUGH // 24))
    is_whole = image.dtype == np.uint8 and len(weights) == 1
    step = float(abs(weights[0])) if is_whole else FINE
    planes = image[:, :, None] if image.ndim == 2 else image
    return max(float(_deviation(planes, weights.astype(np.float32), rows, stride, step)), MIN_NOISE)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _square_within(second, limit):
    """Mean square of what is below the limit."""
    f = np.float32
    square = number = f(0.0)
    for i in range(second.shape[0]):
        is_within = f(1.0) if second[i] < limit else f(0.0)
        number += is_within
        square += is_within * second[i] * second[i]
    return square / number if number > f(0.0) else f(0.0)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _deviation(image, weights, rows, stride, step):
    """As `noise_of`, from every so many columns; differences are counted in bins of `step`."""
    height, columns = image.shape[0], (image.shape[1] - 3) // stride + 1
    second = np.empty(rows * columns, dtype=np.float32)
    count = np.zeros(BINS, dtype=np.int32)
    each, two, half = np.float32(1.0 / step), np.float32(2.0), np.float32(0.5)
    for r in range(rows):
        y = r * (height - 1) // max(rows - 1, 1)
        for k in range(columns):
            x = k * stride
            total = np.float32(0.0)
            for c in range(weights.shape[0]):
                outer = np.float32(image[y, x, c]) + np.float32(image[y, x + 2, c])
                total += weights[c] * (outer - two * np.float32(image[y, x + 1, c]))
            total = abs(total)
            second[r * columns + k] = total
            count[max(0, min(BINS - 1, int(total * each + half)))] += 1
    # what lies in a bin is spread evenly before the median is taken
    below, middle = 0, 0
    while 2 * (below + count[middle]) < second.shape[0]:
        below += count[middle]
        middle += 1
    share = (0.5 * second.shape[0] - below) / count[middle]
    median = max((middle + share - 0.5) * step, 0.0)
    limit = np.float32(2.5 * max(median / 0.6745, step))
    # second moment of what lies within 2.5 deviations, where a normal distribution keeps 0.911 of it
    return math.sqrt(_square_within(second, limit) / (0.911 * 6.0))
