"""The reduced image and its difference of Gaussians (DoG), compiled.

Loops run over whole rows, with a fixed number of taps. Images are flat rows (h, w * channels).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Shaped

from manytouch.compilation import REORDER, f32, kernel, no_type_check, u64

# Taps on each side of the narrow and of the wide Gaussian, for small and for large reduced dots: kernels are
# compiled for their number.
TAPS = ((4, 7), (5, 9))
PADDING = TAPS[1][1]

Taps = tuple[np.float32, ...]
Row = Shaped[np.ndarray, " k"]


class DogImages(NamedTuple):
    """Memory for the response to one pair of Gaussians.

    Attributes:
        small: (h + 2 PADDING, w) reduced image; the padding is filled by `respond`.
        row: (2, w + 2 PADDING) scratch.
        smooth: (h, w) blurred by the narrow Gaussian.
        response: (h + 2, w + 2) difference of Gaussians; its border is low and stays as it is.
    """

    small: Float32[np.ndarray, "hp w"]
    row: Float32[np.ndarray, "2 wp"]
    smooth: Float32[np.ndarray, "h w"]
    response: Float32[np.ndarray, "h2 w2"]


@kernel(fastmath=REORDER)
@no_type_check
def _add_rows(rows: Shaped[np.ndarray, "h k"], first: int, factor: int, total: Row) -> None:
    """Sum of some rows."""
    for x in range(u64(total.shape[0])):
        total[x] = rows[first, x]
    for v in range(1, factor):
        for x in range(u64(total.shape[0])):
            total[x] += rows[first + v, x]


@kernel(fastmath=REORDER)
@no_type_check
def _weigh(total: Row, weights: Float32[np.ndarray, " c"], grey: Float32[np.ndarray, " k"]) -> None:
    """One value of three channels."""
    blue, green, red = weights[0], weights[1], weights[2]
    three, one, two = u64(3), u64(1), u64(2)
    for x in range(u64(grey.shape[0])):
        at = three * x
        grey[x] = f32(total[at]) * blue + f32(total[at + one]) * green
        grey[x] += f32(total[at + two]) * red


@kernel(fastmath=REORDER)
@no_type_check
def _add_columns(total: Row, factor: int, scale: float, out: Float32[np.ndarray, " w"]) -> None:
    """Sums of `factor` neighbours, scaled; the usual factors in SIMD lanes."""
    one, two, three = u64(1), u64(2), u64(3)
    if factor == 2:
        for x in range(u64(out.shape[0])):
            at = two * x
            out[x] = (f32(total[at]) + f32(total[at + one])) * scale
    elif factor == 3:
        for x in range(u64(out.shape[0])):
            at = three * x
            out[x] = (f32(total[at]) + f32(total[at + one]) + f32(total[at + two])) * scale
    elif factor == 4:
        for x in range(u64(out.shape[0])):
            at = u64(4) * x
            pair = f32(total[at]) + f32(total[at + one])
            out[x] = (pair + f32(total[at + two]) + f32(total[at + three])) * scale
    else:
        for x in range(u64(out.shape[0])):
            sum_of_block = f32(0.0)
            for k in range(u64(factor)):
                sum_of_block += f32(total[u64(factor) * x + k])
            out[x] = sum_of_block * scale


@kernel()
@no_type_check
def reduce_rows(
    rows: Shaped[np.ndarray, "h k"],
    weights: Float32[np.ndarray, " c"],
    factor: int,
    total: Row,
    grey: Float32[np.ndarray, " k"],
    small: Float32[np.ndarray, "h w"],
) -> None:
    """Means of whole blocks of `factor` x `factor` pixels, weighted by channel.

    `total` and `grey` are scratch.
    """
    scale = f32(1.0 / (factor * factor))
    for y in range(small.shape[0]):
        _add_rows(rows, y * factor, factor, total)
        if weights.shape[0] == 1:
            _add_columns(total, factor, scale * weights[0], small[y])
        else:
            _weigh(total, weights, grey)
            _add_columns(grey, factor, scale, small[y])


def gaussian_taps(deviation: float, number: int) -> Taps:
    """Half of a Gaussian of sum 1, from its middle outwards."""
    half = np.exp(-0.5 * (np.arange(number + 1) / deviation) ** 2)
    return tuple((half / (2.0 * half.sum() - half[0])).astype(np.float32))


@kernel()
@no_type_check
def _mirror(place: int, size: int) -> int:
    """Index after mirroring at the border between two pixels."""
    period = 2 * size
    place %= period
    return place if place < size else period - 1 - place


@kernel(fastmath=REORDER)
@no_type_check
def _blur_columns(
    near: Float32[np.ndarray, "taps w"], narrow: Taps, wide: Taps,
    inner: Float32[np.ndarray, " w"], outer: Float32[np.ndarray, " w"],
) -> None:  # fmt: skip
    """Weighted sums of 2 PADDING + 1 rows (near), for both Gaussians."""
    for x in range(u64(inner.shape[0])):
        middle = near[PADDING, x]
        low, high = narrow[0] * middle, wide[0] * middle
        for k in range(1, len(narrow)):
            pair = near[PADDING - k, x] + near[PADDING + k, x]
            low += narrow[k] * pair
            high += wide[k] * pair
        for k in range(len(narrow), len(wide)):
            high += wide[k] * (near[PADDING - k, x] + near[PADDING + k, x])
        inner[x] = low
        outer[x] = high


@kernel(fastmath=REORDER)
@no_type_check
def _blur_row(
    row: Float32[np.ndarray, "2 wp"], narrow: Taps, wide: Taps,
    smooth: Float32[np.ndarray, " w"], response: Float32[np.ndarray, " w"],
) -> None:  # fmt: skip
    """Blur along a row whose ends are padded; `response` is the difference of both results."""
    zero = u64(PADDING)
    inner, outer = row[0], row[1]
    for x in range(u64(smooth.shape[0])):
        at = x + zero
        low, high = narrow[0] * inner[at], wide[0] * outer[at]
        for k in range(1, len(narrow)):
            low += narrow[k] * (inner[at - u64(k)] + inner[at + u64(k)])
        for k in range(1, len(wide)):
            high += wide[k] * (outer[at - u64(k)] + outer[at + u64(k)])
        smooth[x] = low
        response[x] = low - high


@kernel()
@no_type_check
def respond(images: DogImages, narrow: Taps, wide: Taps) -> None:
    """Blurs `images.small` by both Gaussians, mirrored at its borders, into `smooth` and `response`."""
    small, row = images.small, images.row
    height, width = images.smooth.shape
    for k in range(PADDING):
        small[PADDING - 1 - k] = small[PADDING + _mirror(-1 - k, height)]
        small[PADDING + height + k] = small[PADDING + _mirror(height + k, height)]
    for y in range(height):
        near = small[y : y + 2 * PADDING + 1]
        _blur_columns(near, narrow, wide, row[0, PADDING:-PADDING], row[1, PADDING:-PADDING])
        for k in range(PADDING):
            before, after = PADDING + _mirror(-1 - k, width), PADDING + _mirror(width + k, width)
            for i in range(2):
                row[i, PADDING - 1 - k] = row[i, before]
                row[i, PADDING + width + k] = row[i, after]
        _blur_row(row, narrow, wide, images.smooth[y], images.response[y + 1, 1:-1])
