"""Measurement of any dot: with a glint or a hole, chipped, next to a step of brightness, or at the border of
the image; compiled.

About ten times slower than `plain_dots`, which leaves these dots to this module.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math

import numpy as np
from jaxtyping import Float32, Int64

from manytouch.compilation import REORDER, f32, kernel, no_type_check, u64
from manytouch.detection.measurement.background_fit import GeneralScratch, fit_brightness
from manytouch.detection.measurement.plane_fit import CLEAR
from manytouch.detection.measurement.records import (
    FOUND,
    NO_DOT,
    NO_FIT,
    NO_MOMENTS,
    NO_STEP,
    BrightnessFit,
    MeasuredDot,
    Moments,
    Pixels,
    Step,
)
from manytouch.detection.measurement.sampling_pattern import window_radius


@kernel()
@no_type_check
def _mark_outside(
    coverage: Float32[np.ndarray, "h w"], stack: Int64[np.ndarray, " k"], outside: np.ndarray
) -> None:
    """Marks the background pixels that are connected with the border of the window."""
    height, width = coverage.shape
    top = 0
    for v in range(height):
        for u in range(width):
            is_at_border = v in (0, height - 1) or u in (0, width - 1)
            if is_at_border and coverage[v, u] < 0.5 and not outside[v, u]:
                outside[v, u] = True
                stack[top] = v * width + u
                top += 1
    while top > 0:
        top -= 1
        v, u = stack[top] // width, stack[top] % width
        for dv, du in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            y, x = v + dv, u + du
            if 0 <= y < height and 0 <= x < width and not outside[y, x] and coverage[y, x] < 0.5:
                outside[y, x] = True
                stack[top] = y * width + x
                top += 1


@kernel()
@no_type_check
def fill_holes(coverage: Float32[np.ndarray, "h w"], stack: Int64[np.ndarray, " k"], high: float) -> None:
    """Sets coverage 1 in what the dot encloses: a glint inside belongs to it.

    `stack` is scratch; from `high` on a pixel has all of its weight already.
    """
    height, width = coverage.shape
    outside = np.zeros((height, width), dtype=np.bool_)
    _mark_outside(coverage, stack, outside)
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            if coverage[v, u] < high and not outside[v, u]:
                # the inner edge of a hole is not an edge either, but the outer one of the dot remains
                is_outer_edge = (
                    outside[v - 1, u - 1] or outside[v - 1, u] or outside[v - 1, u + 1] or outside[v, u - 1]
                    or outside[v, u + 1] or outside[v + 1, u - 1] or outside[v + 1, u]
                    or outside[v + 1, u + 1]
                )  # fmt: skip
                if coverage[v, u] < 0.5 or not is_outer_edge:
                    coverage[v, u] = 1.0


@kernel(fastmath=REORDER)
@no_type_check
def cover(
    pixels: Pixels, x: float, y: float, x0: int, y0: int, fit: BrightnessFit,
    coverage: Float32[np.ndarray, "h w"],
) -> None:  # fmt: skip
    """Share of dot in each pixel of a window whose first pixel is (x0, y0), for a fit about (x, y)."""
    # unsigned indices need no check for negative ones, and SIMD converts no integers: dx is counted in floats
    left, top, three = u64(x0), u64(y0), u64(3)
    columns = u64(coverage.shape[1])
    slope, rise, least = f32(fit.background_x), f32(fit.contrast_x), f32(0.5 * fit.contrast)
    for v in range(u64(coverage.shape[0])):
        dy = float(v) + y0 - y
        below = f32(fit.background + fit.background_y * dy)
        height = f32(fit.contrast + fit.contrast_y * dy)
        dx = f32(x0 - x)
        if pixels.channels == 1:
            weight = pixels.weights[0]
            for u in range(columns):
                scale = height + rise * dx
                scale = scale if scale > least else least
                coverage[v, u] = (f32(pixels.rows[top + v, left + u]) * weight - (below + slope * dx)) / scale
                dx += f32(1.0)
        else:
            blue, green, red = pixels.weights[0], pixels.weights[1], pixels.weights[2]
            for u in range(columns):
                at = three * (left + u)
                grey = f32(pixels.rows[top + v, at]) * blue + f32(pixels.rows[top + v, at + u64(1)]) * green
                grey += f32(pixels.rows[top + v, at + u64(2)]) * red
                scale = height + rise * dx
                scale = scale if scale > least else least
                coverage[v, u] = (grey - (below + slope * dx)) / scale
                dx += f32(1.0)


@kernel()
@no_type_check
def clear_beyond(coverage: Float32[np.ndarray, "h w"], x: float, y: float, step: Step, radius: float) -> None:
    """Sets coverage 0 beyond a step next to a dot about (x, y), but not on the dot."""
    limit = max(step.limit, radius + CLEAR)
    for v in range(coverage.shape[0]):
        for u in range(coverage.shape[1]):
            if (u - x) * step.x + (v - y) * step.y > limit:
                coverage[v, u] = 0.0


@kernel(fastmath=REORDER)
@no_type_check
def coverage_moments(
    coverage: Float32[np.ndarray, "h w"], x: float, y: float, reach2: float, low: float
) -> Moments:
    """Moments about (x, y) of the pixels within a radius of it; those below the coverage `low` count 0."""
    least, gain = f32(low), f32(1.0 / (1.0 - 2.0 * low))
    s0 = sx = sy = edges = edge_sx = edge_sy = edge_sxx = edge_sxy = edge_syy = 0.0
    for v in range(u64(coverage.shape[0])):
        dy = float(v) - y
        if dy * dy > reach2:
            continue
        half = math.sqrt(reach2 - dy * dy)
        left = min(max(0, int(x - half + 1)), coverage.shape[1])
        right = max(left, min(coverage.shape[1], int(x + half) + 1))
        total = first = count = edge_x = edge_xx = f32(0.0)
        dx = f32(left - x)
        for u in range(u64(left), u64(right)):
            weight = (coverage[v, u] - least) * gain
            weight = weight if weight > f32(0.0) else f32(0.0)
            weight = weight if weight < f32(1.0) else f32(1.0)
            total += weight
            first += weight * dx
            is_edge = f32(1.0) if f32(0.0) < weight < f32(1.0) else f32(0.0)
            count += is_edge
            edge_x += is_edge * dx
            edge_xx += is_edge * dx * dx
            dx += f32(1.0)
        s0 += total
        sx += first
        sy += total * dy
        edges += count
        edge_sx += edge_x
        edge_sy += count * dy
        edge_sxx += edge_xx
        edge_sxy += edge_x * dy
        edge_syy += count * dy * dy
    return Moments(s0, sx, sy, edges, edge_sx, edge_sy, edge_sxx, edge_sxy, edge_syy)


@kernel()
@no_type_check
def measure_general(
    pixels: Pixels, x: float, y: float, radius: float, noise: float, scratch: GeneralScratch
) -> MeasuredDot:
    """Measures the dot near (x, y); FOUND or NO_DOT."""
    reach = window_radius(radius)
    reach2 = reach * reach
    fit, moments, step = NO_FIT, NO_MOMENTS, NO_STEP
    for attempt in range(3):
        x0, x1 = max(0, int(x - reach)), min(pixels.width, int(x + reach) + 2)
        y0, y1 = max(0, int(y - reach)), min(pixels.height, int(y + reach) + 2)
        if x1 - x0 < 3 or y1 - y0 < 3:
            return MeasuredDot(NO_DOT, x, y, reach2, NO_FIT, NO_MOMENTS)
        is_dot, fit, step = fit_brightness(pixels, x, y, radius, noise, step, scratch)
        if not is_dot:
            return MeasuredDot(NO_DOT, x, y, reach2, NO_FIT, NO_MOMENTS)
        coverage = scratch.coverage[: (y1 - y0) * (x1 - x0)].reshape(y1 - y0, x1 - x0)
        cover(pixels, x, y, x0, y0, fit, coverage)
        if fit.core_spread == 0.0 and radius >= 3.0:
            fill_holes(coverage, scratch.stack, 1.0 - fit.low)
        if step.limit < NO_STEP.limit:
            clear_beyond(coverage, x - x0, y - y0, step, radius)
        moments = coverage_moments(coverage, x - x0, y - y0, reach2, fit.low)
        if not moments.total > 0.0:
            return MeasuredDot(NO_DOT, x, y, reach2, NO_FIT, NO_MOMENTS)
        dx, dy = moments.x / moments.total, moments.y / moments.total
        if attempt == 2 or dx * dx + dy * dy < (0.04 * radius + 0.1) ** 2:
            break
        x, y = x + dx, y + dy
        if step.limit < NO_STEP.limit:
            # it stays where it is in the image
            step = Step(step.x, step.y, step.limit - dx * step.x - dy * step.y)
    return MeasuredDot(FOUND, x, y, reach2, fit, moments)
