"""Brightness of background and dot for any dot, also at the border of the image or with a damaged core;
compiled.

Samples are every few pixels of a square grid, as far as they are inside the image. `background_fit_simd` is
the fast path for plain dots, whose samples are a fixed pattern.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int32, Int64

from manytouch.compilation import REORDER, f32, f64, kernel, no_type_check, u64
from manytouch.detection.measurement.plane_fit import (
    EVERYTHING,
    centroid_above,
    find_step,
    fit_plane,
    use_before,
)
from manytouch.detection.measurement.records import (
    NO_FIT,
    NO_STEP,
    PLANE_RADIUS,
    BrightnessFit,
    Pixels,
    Plane,
    Samples,
    Step,
    soft_threshold,
)
from manytouch.detection.measurement.sampling_pattern import core_radius, ring_radii

SAMPLES = 80  # wanted of ring and of core
MOST_SAMPLES = 6 * SAMPLES
VOTERS = 20  # samples that a quantile is taken of
EVERYWHERE = 1e6  # px
RING, CORE, WHOLE = 0, 1, 2


class GeneralScratch(NamedTuple):
    """Memory for the measurement of dots that are not plain.

    Attributes:
        offsets: (3, 2, MOST_SAMPLES) x and y of ring, core and whole dot.
        counts: (3,) how many there are.
        first, second: samples.
        sorted_values: (MOST_SAMPLES,).
        coverage: (k,) for a window.
        stack: (k,) for a flood fill.
    """

    offsets: Int32[np.ndarray, "3 2 n"]
    counts: Int64[np.ndarray, "3"]
    first: Samples
    second: Samples
    sorted_values: Float32[np.ndarray, " n"]
    coverage: Float32[np.ndarray, " k"]
    stack: Int64[np.ndarray, " k"]


@kernel()
@no_type_check
def choose_offsets(radius: float, scratch: GeneralScratch) -> None:
    """Chooses the pixels that are sampled around dots of a radius (px)."""
    counts, offsets = scratch.counts, scratch.offsets
    inner, outer = ring_radii(radius)
    counts[RING] = _choose_between(inner - 0.5, outer + 0.5, offsets[RING])
    counts[CORE] = _choose_between(-1.0, core_radius(radius) + 0.75, offsets[CORE])
    counts[WHOLE] = _choose_between(-1.0, 1.4 * radius + 0.7, offsets[WHOLE])


@kernel()
@no_type_check
def _choose_between(inner: float, outer: float, offset: Int32[np.ndarray, "2 n"]) -> int:
    """Every few pixels between two radii. Returns how many."""
    stride = max(1, int(math.sqrt(math.pi * (outer * outer - max(inner, 0.0) ** 2) / SAMPLES) + 0.5))
    count = 0
    reach = int(outer / stride) * stride
    for v in range(-reach, reach + 1, stride):
        for u in range(-reach, reach + 1, stride):
            distance = math.sqrt(u * u + v * v)
            if inner <= distance <= outer and count < offset.shape[1]:
                offset[0, count], offset[1, count] = u, v
                count += 1
    return count


@kernel()
@no_type_check
def _grey_level(pixels: Pixels, y: int, x: int) -> float:
    value: float = f32(pixels.rows[y, x * pixels.channels]) * pixels.weights[0]
    for channel in range(1, pixels.channels):
        value += f32(pixels.rows[y, x * pixels.channels + channel]) * pixels.weights[channel]
    return value


@kernel()
@no_type_check
def _sample(
    pixels: Pixels, x: float, y: float, scratch: GeneralScratch, part: int,
    radii: tuple[float, float], samples: Samples,
) -> int:  # fmt: skip
    """Reads pixels at the offsets of `part` from the one nearest to (x, y), between two distances from it.

    Returns how many are inside the image. Their offsets are from (x, y).
    """
    offset = scratch.offsets[part]
    near_x, near_y = math.floor(x + 0.5), math.floor(y + 0.5)
    part_x, part_y = f32(near_x - x), f32(near_y - y)
    count = 0
    for k in range(scratch.counts[part]):
        u, v = near_x + offset[0, k], near_y + offset[1, k]
        if 0 <= u < pixels.width and 0 <= v < pixels.height:
            dx, dy = f32(offset[0, k]) + part_x, f32(offset[1, k]) + part_y
            if not radii[0] * radii[0] <= dx * dx + dy * dy <= radii[1] * radii[1]:
                continue
            samples.dx[count], samples.dy[count], samples.used[count] = dx, dy, 1.0
            if pixels.channels == 1:
                samples.value[count] = f32(pixels.rows[u64(v), u64(u)]) * pixels.weights[0]
            else:
                samples.value[count] = _grey_level(pixels, v, u)
            count += 1
    return count


@kernel()
@no_type_check
def _pack(samples: Samples, number: int) -> int:
    """Moves the samples that are used to the front. Returns how many there are."""
    count = 0
    for i in range(number):
        if samples.used[i] > f32(0.0):
            samples.dx[count], samples.dy[count] = samples.dx[i], samples.dy[i]
            samples.value[count], samples.used[count] = samples.value[i], 1.0
            count += 1
    return count


@kernel()
@no_type_check
def _quantile(
    value: Float32[np.ndarray, " n"], count: int, quantile: float, ordered: Float32[np.ndarray, " n"]
) -> float:
    """Quantile of about VOTERS of the first `count` values, sorted by insertion."""
    stride = max(1, count // VOTERS)
    number = 0
    for i in range(0, count, stride):
        inserted = value[i]
        place = number
        while place > 0 and ordered[place - 1] > inserted:
            ordered[place] = ordered[place - 1]
            place -= 1
        ordered[place] = inserted
        number += 1
    found: float = ordered[min(number - 1, int(quantile * number))]
    return found


@kernel(fastmath=REORDER)
@no_type_check
def _middle(value: Float32[np.ndarray, " n"], count: int) -> float:
    """Middle of the extremes of the first `count` values."""
    low = high = value[0]
    for i in range(count):
        low = value[i] if value[i] < low else low
        high = value[i] if value[i] > high else high
    middle: float = f32(0.5) * (low + high)
    return middle


@kernel()
@no_type_check
def walk_to_dot(
    pixels: Pixels, x: float, y: float, radius: float, steps: int, scratch: GeneralScratch
) -> tuple[float, float]:
    """Moves a position by a few mean-shift steps to the dot near it."""
    for _ in range(steps):
        count = _sample(pixels, x, y, scratch, WHOLE, (0.0, EVERYWHERE), scratch.first)
        if count < 4:
            break
        dx, dy = centroid_above(scratch.first, count, _middle(scratch.first.value, count))
        x, y = x + dx, y + dy
        if dx * dx + dy * dy < 0.02 * radius * radius:
            break
    return x, y


@kernel()
@no_type_check
def _find_step(
    ring: Samples, number: int, level: float, radius: float, noise: float,
    memory: Float32[np.ndarray, " n"],
) -> Step:  # fmt: skip
    """Finds a step in the ring around a dot of brightness `level`.

    As in `background_fit_simd`, there is none where the residuals of a plane are all within the margin.
    """
    even = fit_plane(ring, number, Plane(f64(ring.value[0]), 0.0, 0.0, 0.0, 0.0, 0.0), EVERYTHING)
    contrast = level - even.a
    if even.variance * (even.number - 3.0) <= max(0.3 * contrast, 2.5 * noise) ** 2:
        return NO_STEP
    return find_step(ring, number, even, radius, contrast, noise, memory)


@kernel()
@no_type_check
def fit_brightness(
    pixels: Pixels, x: float, y: float, radius: float, noise: float, known: Step, scratch: GeneralScratch
) -> tuple[bool, BrightnessFit, Step]:
    """Planes of background and core about (x, y), whether there is a dot, and a step next to it.

    `known` is a step that was found before, or NO_STEP.
    """
    ring, core, ordered = scratch.first, scratch.second, scratch.sorted_values
    count = _sample(pixels, x, y, scratch, RING, ring_radii(radius), ring)
    if count < 4:
        return False, NO_FIT, NO_STEP
    in_core = _sample(pixels, x, y, scratch, CORE, (0.0, core_radius(radius)), core)
    if in_core < 1:
        return False, NO_FIT, NO_STEP
    level = f64(_quantile(core.value, in_core, 0.55, ordered))
    step = _find_step(ring, count, level, radius, noise, ordered)
    if step.limit >= NO_STEP.limit:
        step = known
    if step.limit < NO_STEP.limit:
        use_before(ring, count, step, ring.used)
        count = _pack(ring, count)
    background = f64(_quantile(ring.value, count, 0.4, ordered))
    contrast = level - background
    if not contrast > 0.0:
        return False, NO_FIT, NO_STEP
    margin = max(0.3 * contrast, 2.5 * noise)
    ground = fit_plane(ring, count, Plane(background, 0.0, 0.0, 0.0, 0.0, 0.0), margin)
    ground = fit_plane(ring, count, ground, margin)
    a, b, c, spread, variance = level, ground.b, ground.c, 0.0, -1.0
    if radius >= PLANE_RADIUS:
        start = Plane(level, ground.b, ground.c, 0.0, 0.0, 0.0)
        inner = fit_plane(core, in_core, start, max(0.2 * contrast, 3.0 * noise))
        steepness = math.hypot(inner.b - ground.b, inner.c - ground.c) * radius
        is_plane = inner.number >= 9.0 and inner.number > 0.75 * in_core
        if is_plane and steepness < 0.4 * (inner.a - ground.a):
            a, b, c, spread, variance = inner.a, inner.b, inner.c, inner.spread, inner.variance
    fit = BrightnessFit(
        ground.a, ground.b, ground.c, a - ground.a, b - ground.b, c - ground.c,
        ground.variance, ground.spread, spread, variance, soft_threshold(noise, a - ground.a, radius),
    )  # fmt: skip
    return a > ground.a, fit, step
