"""Measurement of plain dots in SIMD lanes, compiled; others are left to `general_dots`."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math

import numpy as np
from jaxtyping import Float32

from manytouch.compilation import f32, f64, inlined_kernel, no_type_check
from manytouch.detection.measurement.background_fit_simd import fit_plain_brightness
from manytouch.detection.measurement.records import (
    FOUND,
    NO_DOT,
    NO_FIT,
    NO_MOMENTS,
    NOT_PLAIN,
    PLANE_RADIUS,
    BrightnessFit,
    MeasuredDot,
    Moments,
    Pixels,
)
from manytouch.detection.measurement.sampling_pattern import (
    CORE,
    RING,
    WHOLE,
    LoadedPattern,
    window_radius,
)
from manytouch.detection.measurement.simd_moments import (
    Window,
    gather,
    plain_moments,
    pull,
    saddle,
    weigh_window,
)
from manytouch.detection.measurement.simd_strip_sums import STRIP

SADDLE_RADIUS = 3.0  # px: smaller dots are not flat anywhere
SADDLE_OFFSET = 0.03  # px^2: product of the offsets from which on a small dot has a saddle there itself


@inlined_kernel()
@no_type_check
def _is_inside(x: float, y: float, margin: int, pixels: Pixels) -> bool:
    return margin <= x < pixels.width - margin and margin <= y < pixels.height - margin


@inlined_kernel()
@no_type_check
def walk_to_plain_dot(
    pixels: Pixels, x: float, y: float, radius: float, steps: int, pattern: LoadedPattern
) -> tuple[float, float, bool]:
    """Moves a position to the dot near it: x, y, and whether the pattern is inside the image all along."""
    for _ in range(steps):
        near_x, near_y = math.floor(x + 0.5), math.floor(y + 0.5)
        if not _is_inside(near_x, near_y, pattern.reach, pixels):
            return x, y, False
        gather(
            pixels, (near_y * pixels.width + near_x) * pixels.channels, pattern.offset, WHOLE, pattern.whole
        )
        dx, dy = pull(pattern.whole)
        off_x, off_y = near_x + dx - x, near_y + dy - y
        x, y = near_x + dx, near_y + dy
        if off_x * off_x + off_y * off_y < 0.06 * radius * radius:
            break
    return x, y, True


@inlined_kernel()
@no_type_check
def _moments_around(
    pixels: Pixels, base: int, pattern: LoadedPattern, fit: BrightnessFit,
    grey: Float32[np.ndarray, " k"], work: Float32[np.ndarray, "2 8"],
) -> Moments:  # fmt: skip
    """Moments of the window around the pixel at `base`."""
    half, strips = pattern.half, pattern.strips
    first = base - (half * pixels.width + half) * pixels.channels
    if pixels.channels == 1:
        window = Window(
            pixels.flat, f64(pixels.weights[0]), first, pixels.width,
            half, strips, pattern.mask, work[0], work[1],
        )  # fmt: skip
        return plain_moments(window, fit)
    columns = STRIP * strips
    weigh_window(pixels, first, columns, 2 * half + 1, grey)
    weighed = Window(grey, 1.0, 0, columns, half, strips, pattern.mask, work[0], work[1])
    return plain_moments(weighed, fit)


@inlined_kernel()
@no_type_check
def measure_plain(
    pixels: Pixels, x: float, y: float, radius: float, noise: float, pattern: LoadedPattern,
    grey: Float32[np.ndarray, " k"], work: Float32[np.ndarray, "2 8"],
) -> MeasuredDot:  # fmt: skip
    """Measures the dot near (x, y); FOUND, NO_DOT or NOT_PLAIN."""
    reach = window_radius(radius)
    reach2 = reach * reach
    near_x, near_y, base = 0, 0, 0
    fit, moments = NO_FIT, NO_MOMENTS
    for attempt in range(3):
        near_x, near_y = math.floor(x + 0.5), math.floor(y + 0.5)
        if not _is_inside(near_x, near_y, pattern.reach, pixels):
            return MeasuredDot(NOT_PLAIN, x, y, reach2, NO_FIT, NO_MOMENTS)
        base = (near_y * pixels.width + near_x) * pixels.channels
        gather(pixels, base, pattern.offset, RING, pattern.ring)
        gather(pixels, base, pattern.offset, CORE, pattern.core)
        part_x, part_y = f32(x - near_x), f32(y - near_y)
        status, fit = fit_plain_brightness(pattern, radius, (part_x, part_y), noise)
        if status != FOUND:
            return MeasuredDot(status, x, y, reach2, NO_FIT, NO_MOMENTS)
        moments = _moments_around(pixels, base, pattern, fit, grey, work)
        if not moments.total > 0.0:
            return MeasuredDot(NO_DOT, x, y, reach2, NO_FIT, NO_MOMENTS)
        dx, dy = moments.x / moments.total, moments.y / moments.total
        is_near = max(abs(dx), abs(dy)) < 0.04 * radius + 0.6
        if radius < PLANE_RADIUS:
            is_near &= (dx - part_x) ** 2 + (dy - part_y) ** 2 < (0.06 * radius + 0.15) ** 2
        if attempt == 2 or is_near:
            break
        x, y = near_x + dx, near_y + dy
    if SADDLE_RADIUS <= radius < PLANE_RADIUS:
        dx, dy = moments.x / moments.total, moments.y / moments.total
        rise = saddle(pixels, base)
        variance = rise * rise if abs(dx * dy) < SADDLE_OFFSET else -1.0
        fit = BrightnessFit(
            fit.background, fit.background_x, fit.background_y, fit.contrast, fit.contrast_x, fit.contrast_y,
            fit.background_variance, fit.background_spread, fit.core_spread, variance,
            fit.low,
        )  # fmt: skip
    return MeasuredDot(FOUND, float(near_x), float(near_y), reach2, fit, moments)
