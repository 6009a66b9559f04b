"""Noise of a pixel, from second differences along a few rows, compiled."""

import math

import numpy as np
from jaxtyping import Float32, Float64, Shaped

from manytouch.compilation import REORDER, f32, kernel, no_type_check

MIN_NOISE = 0.3  # grey levels: rounding to whole levels has a deviation of 1 / sqrt(12)
ENOUGH = 1024  # samples: 3 % error
FINE = 0.05  # grey levels: width of a bin for values that are not whole grey levels
BINS = 4096
WITHIN = 2.5  # deviations; larger differences are edges of dots
KEPT = 0.911  # share of the variance of a normal distribution within 2.5 deviations


def estimate_noise(image: np.ndarray, weights: Float64[np.ndarray, " c"], rows: int = 24) -> float:
    """Standard deviation of a pixel in grey levels of 255, from second differences along a few rows.

    Differences of more than 2.5 deviations (edges of dots) are left out. Lossy compression smooths the noise
    away: then this is low.

    Args:
        image: (h, w) or (h, w, c).
        weights: (c,) of the channels, for grey levels of 255.
        rows: number of rows; of wide images only every so many columns count.
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


@kernel(fastmath=REORDER)
@no_type_check
def _mean_square_below(second: Float32[np.ndarray, " n"], limit: float) -> float:
    """Mean square of the values below the limit."""
    square = number = f32(0.0)
    for i in range(second.shape[0]):
        is_within = f32(1.0) if second[i] < limit else f32(0.0)
        number += is_within
        square += is_within * second[i] * second[i]
    return square / number if number > f32(0.0) else f32(0.0)


@kernel()
@no_type_check
def _deviation(
    image: Shaped[np.ndarray, "h w c"],
    weights: Float32[np.ndarray, " c"],
    rows: int,
    stride: int,
    step: float,
) -> float:
    """As `estimate_noise`, from every `stride` columns; differences are counted in bins of `step`."""
    height, columns = image.shape[0], (image.shape[1] - 3) // stride + 1
    second = np.empty(rows * columns, dtype=np.float32)
    count = np.zeros(BINS, dtype=np.int32)
    each, two, half = f32(1.0 / step), f32(2.0), f32(0.5)
    for r in range(rows):
        y = r * (height - 1) // max(rows - 1, 1)
        for k in range(columns):
            x = k * stride
            total = f32(0.0)
            for c in range(weights.shape[0]):
                outer = f32(image[y, x, c]) + f32(image[y, x + 2, c])
                total += weights[c] * (outer - two * f32(image[y, x + 1, c]))
            total = abs(total)
            second[r * columns + k] = total
            count[max(0, min(BINS - 1, int(total * each + half)))] += 1
    # the values in a bin are spread evenly before the median is taken
    below, middle = 0, 0
    while 2 * (below + count[middle]) < second.shape[0]:
        below += count[middle]
        middle += 1
    share = (0.5 * second.shape[0] - below) / count[middle]
    median = max((middle + share - 0.5) * step, 0.0)
    limit = f32(WITHIN * max(median / 0.6745, step))
    return math.sqrt(_mean_square_below(second, limit) / (KEPT * 6.0))
