"""The reduced image, its difference of Gaussians and the peaks of that, compiled.

Loops run over whole rows, with a fixed number of taps. Images are flat rows (h, w * channels).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.compilation import FAST, LEAF

# Taps on each side of the narrow and of the wide Gaussian, for small and for large reduced dots: kernels are
# compiled for their number.
TAPS = ((4, 7), (5, 9))
WIDE = TAPS[1][1]
LOWEST = np.float32(-1e9)
AROUND = (1.3, 1.7, 2.1)  # radii of a dot: where its ground is looked at
STEPS = len(AROUND)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _add_rows(rows, first, factor, total):
    """Sum of some rows."""
    for x in range(np.uint64(total.shape[0])):
        total[x] = rows[first, x]
    for v in range(1, factor):
        for x in range(np.uint64(total.shape[0])):
            total[x] += rows[first + v, x]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _weigh(total, weights, grey):
    """One value of three channels."""
    blue, green, red = weights[0], weights[1], weights[2]
    three, one, two = np.uint64(3), np.uint64(1), np.uint64(2)
    for x in range(np.uint64(grey.shape[0])):
        at = three * x
        grey[x] = np.float32(total[at]) * blue + np.float32(total[at + one]) * green
        grey[x] += np.float32(total[at + two]) * red


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _add_columns(total, factor, scale, out):
    """Sums of `factor` neighbours, scaled; the usual factors in lanes."""
    f = np.float32
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    if factor == 2:
        for x in range(np.uint64(out.shape[0])):
            at = two * x
            out[x] = (f(total[at]) + f(total[at + one])) * scale
    elif factor == 3:
        for x in range(np.uint64(out.shape[0])):
            at = three * x
            out[x] = (f(total[at]) + f(total[at + one]) + f(total[at + two])) * scale
    elif factor == 4:
        for x in range(np.uint64(out.shape[0])):
            at = np.uint64(4) * x
            out[x] = (f(total[at]) + f(total[at + one]) + f(total[at + two]) + f(total[at + three])) * scale
    else:
        for x in range(np.uint64(out.shape[0])):
            here = f(0.0)
            for k in range(np.uint64(factor)):
                here += f(total[np.uint64(factor) * x + k])
            out[x] = here * scale


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def reduce_rows(rows, weights, factor, total, grey, small):
    """Means of whole blocks of a (h, w * channels) image, weighted; `total` and `grey` are scratch."""
    scale = np.float32(1.0 / (factor * factor))
    for y in range(small.shape[0]):
        _add_rows(rows, y * factor, factor, total)
        if weights.shape[0] == 1:
            _add_columns(total, factor, scale * weights[0], small[y])
        else:
            _weigh(total, weights, grey)
            _add_columns(grey, factor, scale, small[y])


def taps(deviation: float, number: int) -> tuple[np.float32, ...]:
    """Half of a Gaussian of sum 1, from its middle outwards."""
    half = np.exp(-0.5 * (np.arange(number + 1) / deviation) ** 2)
    return tuple((half / (2.0 * half.sum() - half[0])).astype(np.float32))


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _mirrored(place, size):
    """The border is a mirror between two pixels."""
    period = 2 * size
    place %= period
    return place if place < size else period - 1 - place


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _columns(near, narrow, wide, inner, outer):
    """Weighted sums of 2 WIDE + 1 rows (near), for both Gaussians."""
    for x in range(np.uint64(inner.shape[0])):
        middle = near[WIDE, x]
        low, high = narrow[0] * middle, wide[0] * middle
        for k in range(1, len(narrow)):
            pair = near[WIDE - k, x] + near[WIDE + k, x]
            low += narrow[k] * pair
            high += wide[k] * pair
        for k in range(len(narrow), len(wide)):
            high += wide[k] * (near[WIDE - k, x] + near[WIDE + k, x])
        inner[x] = low
        outer[x] = high


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _along(inner, outer, narrow, wide, smooth, answer):
    """The same along a row whose ends are padded by WIDE; `answer` is the difference."""
    zero = np.uint64(WIDE)
    for x in range(np.uint64(smooth.shape[0])):
        at = x + zero
        low, high = narrow[0] * inner[at], wide[0] * outer[at]
        for k in range(1, len(narrow)):
            low += narrow[k] * (inner[at - np.uint64(k)] + inner[at + np.uint64(k)])
        for k in range(1, len(wide)):
            high += wide[k] * (outer[at - np.uint64(k)] + outer[at + np.uint64(k)])
        smooth[x] = low
        answer[x] = low - high


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def respond(small, narrow, wide, row, smooth, answer):
    """Blurs by both Gaussians: `smooth` is the narrow one, `answer` their difference.

    `small` is padded by WIDE rows above and below (filled here), `answer` by one pixel all around, and
    `row` is scratch (2, w + 2 WIDE).
    """
    height, width = smooth.shape
    for k in range(WIDE):
        small[WIDE - 1 - k] = small[WIDE + _mirrored(-1 - k, height)]
        small[WIDE + height + k] = small[WIDE + _mirrored(height + k, height)]
    for y in range(height):
        _columns(small[y : y + 2 * WIDE + 1], narrow, wide, row[0, WIDE:-WIDE], row[1, WIDE:-WIDE])
        for k in range(WIDE):
            before, after = WIDE + _mirrored(-1 - k, width), WIDE + _mirrored(width + k, width)
            for i in range(2):
                row[i, WIDE - 1 - k] = row[i, before]
                row[i, WIDE + width + k] = row[i, after]
        _along(row[0], row[1], narrow, wide, smooth[y], answer[y + 1, 1:-1])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _mark_peaks(above, here, below, least, mark):
    """1 where no neighbour along or across is higher; of equal ones the first in reading order is it."""
    one, two = np.uint64(1), np.uint64(2)
    for x in range(np.uint64(mark.shape[0])):
        value = here[x + one]
        is_peak = (value >= least) & (value > here[x]) & (value >= here[x + two])
        is_peak &= (value > above[x + one]) & (value >= below[x + one])
        mark[x] = np.uint8(1) if is_peak else np.uint8(0)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _is_highest(answer, y, x):
    """Is a peak along and across not lower than its neighbours in the corners?"""
    value = answer[y + 1, x + 1]
    return (
        value > answer[y, x] and value > answer[y, x + 2]
        and value >= answer[y + 2, x] and value >= answer[y + 2, x + 2]
    )  # fmt: skip


@njit(**LEAF)
@no_type_check
def _falls_inside(flat, at, along, fall):
    """How far the brightness falls in all directions from a place whose surroundings are in the image."""
    here = flat[np.uint64(at)]
    for direction in range(np.uint64(along.shape[0])):
        low = np.float32(1e9)
        for step in range(STEPS):
            there = flat[np.uint64(at + along[direction, np.uint64(step)])]
            low = there if there < low else low
        fall[direction] = here - low
    return along.shape[0]


@njit(**LEAF)
@no_type_check
def _falls_at_border(image, y, x, offset, fall):
    """The same in those directions that stay in the image. Returns how many."""
    height, width = image.shape
    known = 0
    for direction in range(offset.shape[0]):
        low = np.float32(1e9)
        for step in range(STEPS):
            v, u = y + offset[direction, step, 0], x + offset[direction, step, 1]
            if 0 <= v < height and 0 <= u < width:
                there = image[np.uint64(v), np.uint64(u)]
                low = there if there < low else low
        if low < np.float32(1e9):
            fall[known] = image[y, x] - low
            known += 1
    return known


@njit(**LEAF)
@no_type_check
def _is_enclosed(image, flat, y, x, offset, along, reach, fall):
    """Does the brightness fall by a third of its mean fall in nearly all directions?

    `along` (directions, STEPS) are the offsets in the `flat` image; `fall` is scratch.
    """
    height, width = image.shape
    if reach <= y < height - reach and reach <= x < width - reach:
        known = _falls_inside(flat, y * width + x, along, fall)
    else:
        known = _falls_at_border(image, y, x, offset, fall)
    total = np.float32(0.0)
    for direction in range(np.uint64(known)):
        total += fall[direction]
    if known < offset.shape[0] // 3 or total <= 0.0:
        return False
    least = np.float32(0.35) * total / np.float32(known)
    open_directions = 0
    for direction in range(np.uint64(known)):
        if fall[direction] < least:
            open_directions += 1
    return open_directions <= 0.2 * known


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _part(before, value, after):
    """Where between -0.5 and 0.5 px the parabola through three values has its top."""
    bend = max(2.0 * value - before - after, 1e-6)
    return min(max(0.5 * (after - before) / bend, -0.5), 0.5)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def peaks(smooth, answer, least, offset, mark, found):
    """Enclosed local maxima of the padded `answer`, at parts of pixels: rows x, y, height. Returns how many.

    `mark` is scratch, as long as a row and then some, a multiple of 8.
    """
    height, width = smooth.shape
    fall = np.empty(offset.shape[0], dtype=np.float32)
    words = mark.view(np.uint64)
    count, reach = 0, np.abs(offset).max()
    flat, along = smooth.reshape(-1), offset[:, :, 0] * width + offset[:, :, 1]
    mark[:] = 0
    for y in range(height):
        _mark_peaks(answer[y], answer[y + 1], answer[y + 2], least, mark[:width])
        for word in range(words.shape[0]):
            if words[word] == 0:
                continue
            for x in range(8 * word, min(8 * word + 8, width)):
                if mark[x] == 0 or count >= found.shape[0] or not _is_highest(answer, y, x):
                    continue
                if not _is_enclosed(smooth, flat, y, x, offset, along, reach, fall):
                    continue
                value = answer[y + 1, x + 1]
                found[count, 0], found[count, 1], found[count, 2] = x, y, value
                if 0 < x < width - 1:
                    found[count, 0] += _part(answer[y + 1, x], value, answer[y + 1, x + 2])
                if 0 < y < height - 1:
                    found[count, 1] += _part(answer[y, x + 1], value, answer[y + 2, x + 1])
                count += 1
    return count
