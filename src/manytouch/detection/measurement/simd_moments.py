"""Pixels of plain dots in SIMD lanes, compiled: read as a sampling pattern states, and summed up."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int64, Shaped, UInt16

from manytouch.compilation import REORDER, f32, f64, inlined_kernel, no_type_check, u64
from manytouch.detection.measurement.plane_fit import centroid_above
from manytouch.detection.measurement.records import (
    NO_MOMENTS,
    BrightnessFit,
    Moments,
    Pixels,
    Samples,
)
from manytouch.detection.measurement.sampling_pattern import LANES
from manytouch.detection.measurement.simd_strip_sums import (
    BRIGHT,
    EDGE,
    GROUND,
    LEFT,
    R1,
    R2,
    RX,
    S0,
    START,
    SX,
    SXX,
    strip_sums,
)

ALL = u64(LANES)


class Window(NamedTuple):
    """The window of a dot.

    Attributes:
        flat: pixels; `scale` times them are signed grey levels.
        scale: see above.
        first, width: first pixel of the window, and the distance of its rows.
        half, strips, mask: as in `SamplingPatterns`.
        planes, sums: (8,) memory for `strip_sums`.
    """

    flat: Shaped[np.ndarray, " k"]
    scale: float
    first: int
    width: int
    half: int
    strips: int
    mask: UInt16[np.ndarray, " bits"]
    planes: Float32[np.ndarray, "8"]
    sums: Float32[np.ndarray, "8"]


@inlined_kernel(fastmath=REORDER)
@no_type_check
def gather(pixels: Pixels, base: int, offset: Int64[np.ndarray, " k"], part: int, samples: Samples) -> None:
    """Reads the signed grey levels of the samples of a part around the pixel at `base`."""
    flat, weights, first = pixels.flat, pixels.weights, u64(part * LANES)
    if pixels.channels == 1:
        weight = weights[0]
        for k in range(ALL):
            samples.value[k] = f32(flat[u64(base + offset[first + k])]) * weight
    else:
        blue, green, red = weights[0], weights[1], weights[2]
        for k in range(ALL):
            at = u64(base + offset[first + k])
            grey = f32(flat[at]) * blue + f32(flat[at + u64(1)]) * green
            samples.value[k] = grey + f32(flat[at + u64(2)]) * red


@inlined_kernel()
@no_type_check
def saddle(pixels: Pixels, base: int) -> float:
    """Half of the crosswise difference of four pixels around a centre: noise, if the dot is round."""
    channels, width = pixels.channels, pixels.width
    total = 0.0
    for c in range(channels):
        above, below = base + c - width * channels, base + c + width * channels
        rise = float(pixels.flat[above - channels]) - float(pixels.flat[above + channels])
        rise += float(pixels.flat[below + channels]) - float(pixels.flat[below - channels])
        total += float(pixels.weights[c]) * rise
    return 0.5 * total


@inlined_kernel(fastmath=REORDER)
@no_type_check
def weigh_window(
    pixels: Pixels, first: int, columns: int, rows: int, grey: Float32[np.ndarray, " k"]
) -> None:
    """Signed grey levels of a window of coloured pixels, row by row."""
    flat, weights = pixels.flat, pixels.weights
    three, one, two = u64(3), u64(1), u64(2)
    blue, green, red = weights[0], weights[1], weights[2]
    for row in range(rows):
        at, to = u64(first + 3 * pixels.width * row), u64(columns * row)
        for k in range(u64(columns)):
            i = at + three * k
            value = f32(flat[i]) * blue + f32(flat[i + one]) * green
            grey[to + k] = value + f32(flat[i + two]) * red


@inlined_kernel(fastmath=REORDER)
@no_type_check
def pull(samples: Samples) -> tuple[float, float]:
    """Centroid of what is lighter than the middle between the light and the dark half: x, y."""
    # least and largest values would not run in SIMD lanes
    number = total = f32(0.0)
    for i in range(ALL):
        number += samples.used[i]
        total += samples.used[i] * samples.value[i]
    mean = total / number
    light = total_light = f32(0.0)
    for i in range(ALL):
        is_light = samples.used[i] if samples.value[i] > mean else f32(0.0)
        light += is_light
        total_light += is_light * samples.value[i]
    if light <= f32(0.0) or light >= number:
        return 0.0, 0.0
    middle = f32(0.5) * (total_light / light + (total - total_light) / (number - light))
    return centroid_above(samples, LANES, middle)


@inlined_kernel(fastmath=REORDER)
@no_type_check
def plain_moments(window: Window, fit: BrightnessFit) -> Moments:
    """Moments about the middle pixel, with the coverage of the pixels computed on the way."""
    # w = gain (value - background) / contrast - gain low; 1 / contrast to first order in the slopes of the
    # dot, since the next order is the same on both sides
    planes, sums, half, scale = window.planes, window.sums, window.half, window.scale
    gain = 1.0 / (1.0 - 2.0 * fit.low)
    inverse = gain / fit.contrast
    fall_x, fall_y = fit.contrast_x / fit.contrast * inverse, fit.contrast_y / fit.contrast * inverse
    planes[GROUND] = (fit.background - half * (fit.background_x + fit.background_y)) / scale
    planes[GROUND + 1], planes[GROUND + 2] = fit.background_x / scale, fit.background_y / scale
    planes[BRIGHT] = (inverse + half * (fall_x + fall_y)) * scale
    planes[BRIGHT + 1], planes[BRIGHT + 2] = -fall_x * scale, -fall_y * scale
    planes[START], planes[LEFT] = gain * fit.low, -half
    rows = 2 * half + 1
    strip_sums(window.flat, window.first, window.width, window.strips, rows, window.mask, planes, sums)
    s0, sx, sxx = f64(sums[S0]), f64(sums[SX]), f64(sums[SXX])
    if s0 <= 0.0:
        return NO_MOMENTS
    # rows were counted from below: y = under - u
    under, u, uu = half + 1.0, f64(sums[R1]), 2.0 * sums[R2] - sums[R1]
    sy, sxy, syy = under * s0 - u, under * sx - sums[RX], under * (under * s0 - 2.0 * u) + uu
    # the edge of an ellipse has twice the second moments, per pixel, of its area
    edges, each = f64(sums[EDGE]), 1.0 / s0
    cx, cy = sx * each, sy * each
    twice = 2.0 * edges
    return Moments(
        s0, sx, sy, edges, edges * cx, edges * cy,
        twice * (sxx * each - cx * cx) + edges * cx * cx,
        twice * (sxy * each - cx * cy) + edges * cx * cy,
        twice * (syy * each - cy * cy) + edges * cy * cy,
    )  # fmt: skip
