"""Peaks of a difference of Gaussians that are enclosed by background, compiled."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int64, UInt8

from manytouch.compilation import REORDER, f32, inlined_kernel, kernel, no_type_check, u64

BACKGROUND_RADII = (1.3, 1.7, 2.1)  # radii of a dot at which the background is read
STEPS = len(BACKGROUND_RADII)
HIGHEST = 1e9


class Enclosure(NamedTuple):
    """Where around a peak the brightness must fall, and how far.

    Attributes:
        offset: (directions, STEPS, 2) y and x of the pixels that are read.
        least_fall: times the mean fall of all directions.
        most_open: share of the directions that may fall less.
        least_known: share of the directions that must be inside the image.
    """

    offset: Int64[np.ndarray, "d s 2"]
    least_fall: float = 0.35
    most_open: float = 0.2
    least_known: float = 1.0 / 3.0


class FlatOffsets(NamedTuple):
    """`Enclosure` for one image: its offsets in flat memory, the largest offset, and scratch."""

    along: Int64[np.ndarray, "d s"]
    reach: int
    fall: Float32[np.ndarray, " d"]


@kernel(fastmath=REORDER)
@no_type_check
def _mark_peaks(
    above: Float32[np.ndarray, " k"], row: Float32[np.ndarray, " k"], below: Float32[np.ndarray, " k"],
    least: float, mark: UInt8[np.ndarray, " w"],
) -> None:  # fmt: skip
    """1 where no neighbour along or across is higher.

    Of equal ones the first in reading order is the peak.
    """
    one, two = u64(1), u64(2)
    for x in range(u64(mark.shape[0])):
        value = row[x + one]
        is_peak = (value >= least) & (value > row[x]) & (value >= row[x + two])
        is_peak &= (value > above[x + one]) & (value >= below[x + one])
        mark[x] = np.uint8(1) if is_peak else np.uint8(0)


@kernel()
@no_type_check
def _is_highest(response: Float32[np.ndarray, "h w"], y: int, x: int) -> bool:
    """Whether a peak along and across is not lower than its diagonal neighbours."""
    value = response[y + 1, x + 1]
    is_upper: bool = value > response[y, x] and value > response[y, x + 2]
    is_lower: bool = value >= response[y + 2, x] and value >= response[y + 2, x + 2]
    return is_upper and is_lower


@inlined_kernel()
@no_type_check
def _falls_inside(
    flat: Float32[np.ndarray, " k"], at: int, along: Int64[np.ndarray, "d s"], fall: Float32[np.ndarray, " d"]
) -> int:
    """Fall of the brightness in all directions from a pixel whose surroundings are in the image."""
    centre = flat[u64(at)]
    for direction in range(u64(along.shape[0])):
        low = f32(HIGHEST)
        for step in range(STEPS):
            value = flat[u64(at + along[direction, u64(step)])]
            low = value if value < low else low
        fall[direction] = centre - low
    known: int = along.shape[0]
    return known


@inlined_kernel()
@no_type_check
def _falls_at_border(
    image: Float32[np.ndarray, "h w"], y: int, x: int, offset: Int64[np.ndarray, "d s 2"],
    fall: Float32[np.ndarray, " d"],
) -> int:  # fmt: skip
    """`_falls_inside` in those directions that stay in the image. Returns how many."""
    height, width = image.shape
    known = 0
    for direction in range(offset.shape[0]):
        low = f32(HIGHEST)
        for step in range(STEPS):
            v, u = y + offset[direction, step, 0], x + offset[direction, step, 1]
            if 0 <= v < height and 0 <= u < width:
                value = image[u64(v), u64(u)]
                low = value if value < low else low
        if low < f32(HIGHEST):
            fall[known] = image[y, x] - low
            known += 1
    return known


@inlined_kernel()
@no_type_check
def _is_enclosed(
    image: Float32[np.ndarray, "h w"], flat: Float32[np.ndarray, " k"], y: int, x: int,
    enclosure: Enclosure, flat_offsets: FlatOffsets,
) -> bool:  # fmt: skip
    """Whether the brightness falls by a part of its mean fall in nearly all directions."""
    height, width = image.shape
    reach, fall = flat_offsets.reach, flat_offsets.fall
    if reach <= y < height - reach and reach <= x < width - reach:
        known = _falls_inside(flat, y * width + x, flat_offsets.along, fall)
    else:
        known = _falls_at_border(image, y, x, enclosure.offset, fall)
    total = f32(0.0)
    for direction in range(u64(known)):
        total += fall[direction]
    if known < int(enclosure.offset.shape[0] * enclosure.least_known) or total <= 0.0:
        return False
    least = f32(enclosure.least_fall) * total / f32(known)
    open_directions = 0
    for direction in range(u64(known)):
        if fall[direction] < least:
            open_directions += 1
    return open_directions <= enclosure.most_open * known


@kernel()
@no_type_check
def _peak_offset(before: float, value: float, after: float) -> float:
    """Top, between -0.5 and 0.5 px, of the parabola through three values."""
    bend = max(2.0 * value - before - after, 1e-6)
    return min(max(0.5 * (after - before) / bend, -0.5), 0.5)


@kernel()
@no_type_check
def find_peaks(
    smooth: Float32[np.ndarray, "h w"],
    response: Float32[np.ndarray, "h2 w2"],
    least: float,
    enclosure: Enclosure,
    mark: UInt8[np.ndarray, " k"],
    found: Float32[np.ndarray, "n 3"],
) -> int:
    """Finds enclosed local maxima of at least `least`, to sub-pixel precision.

    Args:
        smooth, response: as in `DogImages`.
        least: lowest peak.
        enclosure: where the brightness must fall.
        mark: scratch, longer than a row, a multiple of 8.
        found: written; x, y, height.

    Returns:
        their number.
    """
    height, width = smooth.shape
    offset, words, flat = enclosure.offset, mark.view(np.uint64), smooth.reshape(-1)
    fall = np.empty(offset.shape[0], dtype=np.float32)
    flat_offsets = FlatOffsets(offset[:, :, 0] * width + offset[:, :, 1], np.abs(offset).max(), fall)
    count = 0
    mark[:] = 0
    for y in range(height):
        _mark_peaks(response[y], response[y + 1], response[y + 2], least, mark[:width])
        for word in range(words.shape[0]):
            if words[word] == 0:
                continue
            for x in range(8 * word, min(8 * word + 8, width)):
                if mark[x] == 0 or count >= found.shape[0] or not _is_highest(response, y, x):
                    continue
                if not _is_enclosed(smooth, flat, y, x, enclosure, flat_offsets):
                    continue
                value = response[y + 1, x + 1]
                found[count, 0], found[count, 1], found[count, 2] = x, y, value
                if 0 < x < width - 1:
                    found[count, 0] += _peak_offset(response[y + 1, x], value, response[y + 1, x + 2])
                if 0 < y < height - 1:
                    found[count, 1] += _peak_offset(response[y, x + 1], value, response[y + 2, x + 1])
                count += 1
    return count
