"""Pixels that are read around a plain dot of a given radius, chosen so that loops over them run in SIMD
lanes.

In whole pixels from the one nearest to the dot: 96 of the background around it, 96 of its core, 96 of the
whole dot, and a window of strips, 16 columns wide, that covers dot and edge. Similar radii share a pattern.
Ring and core reach half a pixel farther than they are used: which of their samples are within the radii is
decided from the centre of the dot, since a ring about the nearest pixel is nearer to the edge on one side.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int32, Int64, UInt16

from manytouch.compilation import i64, inlined_kernel, kernel, no_type_check
from manytouch.detection.measurement.records import PLANE_RADIUS, Samples
from manytouch.detection.measurement.simd_strip_sums import STRIP
from manytouch.values.arrays import Scalars

LANES = 96  # samples of each part
STEP = 1.03  # between the radii that have a pattern of their own
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
RING, CORE, WHOLE = 0, 1, 2
PARTS = 3
FAR = 1e4  # px: offset of lanes without a sample, which is within no radius


class SamplingPatterns(NamedTuple):
    """Pixels that are read around dots of some radii.

    Attributes:
        row: (n,) pattern of each radius.
        offset: (p, 2, 288) x and y of ring, core and whole dot.
        mask: (p, k) bits of the pixels of the window that count: strip after strip, row after row.
        number: (p, 3) samples of ring, core and whole dot.
        reach: (p,) largest offset of all.
        half: (p,) offset of the first row and column of the window, to the left and up.
        strips: (p,) number of strips.
    """

    row: Int32[np.ndarray, " n"]
    offset: Int32[np.ndarray, "p 2 k"]
    mask: UInt16[np.ndarray, "p bits"]
    number: Int32[np.ndarray, "p 3"]
    reach: Int32[np.ndarray, " p"]
    half: Int32[np.ndarray, " p"]
    strips: Int32[np.ndarray, " p"]

    def at(self, chosen: np.ndarray) -> "SamplingPatterns":
        """Patterns of some of the radii."""
        return self._replace(row=self.row[chosen])


class LoadedPattern(NamedTuple):
    """One pattern, prepared for one image.

    Attributes:
        offset: (288,) of the samples in the flat image.
        ring, core, whole: memory for the samples; their offsets are filled in, FAR where there is no sample.
        reach, half, strips, mask: as in `SamplingPatterns`.
    """

    offset: Int64[np.ndarray, " k"]
    ring: Samples
    core: Samples
    whole: Samples
    reach: int
    half: int
    strips: int
    mask: UInt16[np.ndarray, " bits"]


def sampling_patterns(radius_px: Scalars) -> SamplingPatterns:
    """Patterns for some radii (n,); similar ones share a pattern."""
    step = np.rint(np.log(np.maximum(radius_px, 0.3)) / np.log(STEP)).astype(np.int64)
    steps, index = np.unique(step, return_inverse=True)
    radii = STEP ** steps.astype(np.float64)
    largest = float(radii[-1]) if len(radii) else 1.0
    most_bits = _strips(largest) * (2 * _half(largest) + 1)
    patterns = SamplingPatterns(
        row=index.astype(np.int32),
        offset=np.zeros((len(radii), 2, PARTS * LANES), dtype=np.int32),
        mask=np.zeros((len(radii), most_bits), dtype=np.uint16),
        number=np.zeros((len(radii), PARTS), dtype=np.int32),
        reach=np.zeros(len(radii), dtype=np.int32),
        half=np.zeros(len(radii), dtype=np.int32),
        strips=np.zeros(len(radii), dtype=np.int32),
    )
    for row, radius in enumerate(radii):
        _fill_pattern(float(radius), row, patterns)
    return patterns


@kernel()
@no_type_check
def window_radius(radius: float) -> float:
    """Radius of the window, about the centre of a dot, whose pixels are summed up."""
    return max(1.35 * radius + 1.2, radius + 2.2)


@kernel()
@no_type_check
def _half(radius: float) -> int:
    """Rows above the middle one, and columns to the left of it."""
    return int(window_radius(radius) + 0.3)


@kernel()
@no_type_check
def _strips(radius: float) -> int:
    return (2 * _half(radius) + STRIP) // STRIP


@kernel()
@no_type_check
def _add_pixel(offset: Int32[np.ndarray, "2 k"], first: int, count: int, u: int, v: int) -> int:
    """Adds a pixel to those of a part, unless it is one of them. Returns how many there are."""
    for k in range(first, first + count):
        if offset[0, k] == u and offset[1, k] == v:
            return count
    offset[0, first + count], offset[1, first + count] = u, v
    return count + 1


@kernel()
@no_type_check
def _spread_between(inner: float, outer: float, offset: Int32[np.ndarray, "2 k"], first: int) -> int:
    """Up to LANES different pixels, evenly spread between two radii, inner ones first. Returns how many.

    Each has its opposite, so that what depends on the distance from the middle alone has no slope.
    """
    count, pairs = 0, LANES // 2
    area = math.pi * (outer * outer - inner * inner)
    wanted = min(LANES, int(area) + 1)
    # twice as many positions as needed are tried, since some are in the same pixel
    for trial in range(2 * pairs):
        if count + 2 > wanted:
            break
        part = ((trial % pairs) + 0.5 * (1 + trial // pairs)) / pairs
        distance = math.sqrt(inner * inner + (outer * outer - inner * inner) * min(part, 1.0))
        u = math.floor(distance * math.cos(trial * GOLDEN_ANGLE) + 0.5)
        v = math.floor(distance * math.sin(trial * GOLDEN_ANGLE) + 0.5)
        count = _add_pixel(offset, first, count, u, v)
        count = _add_pixel(offset, first, count, -u, -v)
    return count


@kernel()
@no_type_check
def ring_radii(radius: float) -> tuple[float, float]:
    """Inner and outer radius of the ring of background around a dot."""
    return 1.3 * radius + 1.5, 1.75 * radius + 1.8


@kernel()
@no_type_check
def core_radius(radius: float) -> float:
    """Radius of the core of a dot, which is free of its edge where it is large enough for that."""
    return max(0.9, 0.5 * radius, min(0.6 * radius, radius - 3.25))


@kernel()
@no_type_check
def _fill_small_core(radius: float, offset: Int32[np.ndarray, "2 k"]) -> int:
    """All pixels of a small core, inner ones first. Returns how many."""
    reach, number = core_radius(radius) + 0.75, 0
    for limit in range(int(reach * reach) + 1):
        for v in range(-int(reach), int(reach) + 1):
            for u in range(-int(reach), int(reach) + 1):
                if u * u + v * v == limit and number < LANES:
                    offset[0, CORE * LANES + number], offset[1, CORE * LANES + number] = u, v
                    number += 1
    return number


@kernel()
@no_type_check
def _fill_pattern(radius: float, row: int, patterns: SamplingPatterns) -> None:
    """One row of `sampling_patterns`."""
    offset, count, mask = patterns.offset[row], patterns.number[row], patterns.mask[row]
    inner, outer = ring_radii(radius)
    count[RING] = _spread_between(inner - 0.5, outer + 0.5, offset, RING * LANES)
    if radius >= PLANE_RADIUS:
        count[CORE] = _spread_between(0.0, core_radius(radius) + 0.5, offset, CORE * LANES)
    else:
        count[CORE] = _fill_small_core(radius, offset)
    count[WHOLE] = _spread_between(0.0, 1.4 * radius + 0.7, offset, WHOLE * LANES)
    reach, half = window_radius(radius) + 0.3, _half(radius)
    patterns.half[row], patterns.strips[row] = half, _strips(radius)
    patterns.reach[row] = max(int(outer + 1.0), half + 2)
    for v in range(-half, half + 1):
        for u in range(-half, half + 1):
            if u * u + v * v <= reach * reach:
                strip, lane = (u + half) // STRIP, (u + half) % STRIP
                mask[strip * (2 * half + 1) + v + half] |= np.uint16(1 << lane)


@inlined_kernel()
@no_type_check
def _load_part(
    patterns: SamplingPatterns, row: int, part: int, stride: tuple[int, int],
    flat_offset: Int64[np.ndarray, " k"], samples: Samples,
) -> None:  # fmt: skip
    """Writes the offsets of a part; `stride` is that of a row and of a pixel of the flat image."""
    for k in range(LANES):
        u, v = patterns.offset[row, 0, part * LANES + k], patterns.offset[row, 1, part * LANES + k]
        is_sample = k < patterns.number[row, part]
        samples.dx[k], samples.dy[k] = u if is_sample else FAR, v
        samples.used[k] = 1.0 if is_sample else 0.0
        flat_offset[part * LANES + k] = i64(v) * stride[0] + u * stride[1]


@inlined_kernel()
@no_type_check
def load_pattern(
    patterns: SamplingPatterns, row: int, stride: tuple[int, int],
    flat_offset: Int64[np.ndarray, " k"], memory: Float32[np.ndarray, "3 4 lanes"],
) -> LoadedPattern:  # fmt: skip
    """Prepares a pattern in some memory; `stride` is that of a row and of a pixel of the flat image."""
    ring = Samples(memory[RING, 0], memory[RING, 1], memory[RING, 2], memory[RING, 3])
    core = Samples(memory[CORE, 0], memory[CORE, 1], memory[CORE, 2], memory[CORE, 3])
    whole = Samples(memory[WHOLE, 0], memory[WHOLE, 1], memory[WHOLE, 2], memory[WHOLE, 3])
    _load_part(patterns, row, RING, stride, flat_offset, ring)
    _load_part(patterns, row, CORE, stride, flat_offset, core)
    _load_part(patterns, row, WHOLE, stride, flat_offset, whole)
    return LoadedPattern(
        flat_offset, ring, core, whole,
        patterns.reach[row], i64(patterns.half[row]),
        i64(patterns.strips[row]), patterns.mask[row],
    )  # fmt: skip
