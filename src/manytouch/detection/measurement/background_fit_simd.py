"""Brightness of background and dot for plain dots, from samples in SIMD lanes, compiled.

`background_fit` is the general one, for damaged dots and at the border of the image.
"""

import math

from manytouch.compilation import REORDER, f32, f64, inlined_kernel, no_type_check, u64
from manytouch.detection.measurement.plane_fit import fit_plane
from manytouch.detection.measurement.records import (
    FOUND,
    NO_DOT,
    NO_FIT,
    NOT_PLAIN,
    PLANE_RADIUS,
    BrightnessFit,
    Plane,
    Samples,
    soft_threshold,
)
from manytouch.detection.measurement.sampling_pattern import LANES, LoadedPattern, SampleShape

WITHIN = 2.5  # deviations of a pixel of the core from its plane
STEEP = 0.12  # of the contrast: change over a radius from which on a dot is not plain
DARK = 0.3  # of the contrast: a pixel of the core that is so much darker is damaged
ALL = u64(LANES)


@inlined_kernel(fastmath=REORDER)
@no_type_check
def fit_even_plane(samples: Samples, shape: SampleShape) -> tuple[Plane, float, float]:
    """Least-squares plane of all samples, the sum of its squared residuals, and the mean of the values."""
    middle = samples.value[0]
    sv = svx = svy = svv = f32(0.0)
    for i in range(ALL):
        residual = samples.used[i] * (samples.value[i] - middle)
        sv += residual
        svx += residual * samples.dx[i]
        svy += residual * samples.dy[i]
        svv += residual * residual
    mx, my = shape.mean_x, shape.mean_y
    mean = float(sv * (f32(1.0) / f32(shape.number)))
    cxv, cyv = svx - sv * mx, svy - sv * my
    db = shape.inverse_xx * cxv + shape.inverse_xy * cyv
    dc = shape.inverse_xy * cxv + shape.inverse_yy * cyv
    squares = max(svv - sv * mean - db * cxv - dc * cyv, 0.0)
    mean += middle
    level = mean - db * mx - dc * my
    variance = squares / max(shape.number - 3.0, 1.0)
    return Plane(level, db, dc, shape.number, variance, shape.spread), squares, f64(mean)


@inlined_kernel(fastmath=REORDER)
@no_type_check
def middle_quantile(samples: Samples, quantile: float, halvings: int) -> float:
    """Mean of the samples next to a quantile near the median, from a range that is halved so many times."""
    start = samples.value[0]
    number = total = square = f32(0.0)
    for i in range(ALL):
        used, value = samples.used[i], samples.value[i] - start
        number += used
        total += used * value
        square += used * value * value
    mean = total / number
    rank = f32(min(int(number) - 1, int(quantile * number)))
    # such a quantile is never farther from the mean than about 1.3 deviations (Cantelli)
    reach = f32(2.0) * f32(math.sqrt(max(square / number - mean * mean, f32(0.0)))) + f32(0.01)
    low, high = start + mean - reach, start + mean + reach
    for _ in range(halvings):
        middle = f32(0.5) * (low + high)
        lower = f32(0.0)
        for i in range(ALL):
            lower += samples.used[i] if samples.value[i] < middle else f32(0.0)
        if lower <= rank:
            low = middle
        else:
            high = middle
    total = weight = f32(0.0)
    for i in range(ALL):
        value = samples.value[i]
        inside = samples.used[i] if low <= value < high else f32(0.0)
        weight += inside
        total += inside * value
    return f64(total / weight) if weight > f32(0.0) else f64(low)


@inlined_kernel(fastmath=REORDER)
@no_type_check
def _use_near(samples: Samples, part_x: float, part_y: float, reach: float, number: int) -> float:
    """Uses those of the first samples that are within a radius of a position; returns how many."""
    count, reach2 = f32(0.0), f32(reach * reach)
    for i in range(ALL):
        x, y = samples.dx[i] - part_x, samples.dy[i] - part_y
        inside = f32(1.0) if x * x + y * y <= reach2 and i < u64(number) else f32(0.0)
        samples.used[i] = inside
        count += inside
    return count


@inlined_kernel(fastmath=REORDER)
@no_type_check
def _count_below(samples: Samples, least: float) -> float:
    """Number of used samples that are darker than `least`."""
    count, limit = f32(0.0), f32(least)
    for i in range(ALL):
        count += samples.used[i] if samples.value[i] < limit else f32(0.0)
    return count


@inlined_kernel()
@no_type_check
def _fit_background(pattern: LoadedPattern, level: float, noise: float) -> tuple[Plane, float]:
    """Plane of the background around a core of brightness `level`, and how much darker it is."""
    plane, squares, background = fit_even_plane(pattern.ring, pattern.ring_shape)
    contrast = level - background
    # when the squares sum up to less than that of the margin, no sample is beyond it
    if squares > max(0.3 * contrast, 2.5 * noise) ** 2:
        contrast = level - middle_quantile(pattern.ring, 0.4, 5)
        margin = max(0.3 * contrast, 2.5 * noise)
        plane = fit_plane(pattern.ring, LANES, Plane(level - contrast, 0.0, 0.0, 0.0, 0.0, 0.0), margin)
        plane = fit_plane(pattern.ring, LANES, plane, margin)
    return plane, contrast


@inlined_kernel()
@no_type_check
def _combine(background: Plane, contrast: Plane, noise: float, radius: float) -> BrightnessFit:
    return BrightnessFit(
        background.a, background.b, background.c, contrast.a, contrast.b, contrast.c,
        background.variance, background.spread, contrast.spread, contrast.variance,
        soft_threshold(noise, contrast.a, radius),
    )  # fmt: skip


@inlined_kernel()
@no_type_check
def _fit_small(
    pattern: LoadedPattern, radius: float, part_x: float, part_y: float, noise: float
) -> tuple[int, BrightnessFit]:
    """As `fit_plain_brightness`, for a dot too small for a plane of its own."""
    core, number = pattern.core, pattern.core_count
    if _use_near(core, part_x, part_y, max(0.5 * radius, 0.9), number) < 1.0:
        return NO_DOT, NO_FIT
    level = middle_quantile(core, 0.55, 8)
    background, contrast = _fit_background(pattern, level, noise)
    if not (contrast > 0.0 and level > background.a):
        return NO_DOT, NO_FIT
    if radius >= 3.0:
        _use_near(core, part_x, part_y, radius - 1.0, number)
        if _count_below(core, level - DARK * contrast) > 0.0:
            return NOT_PLAIN, NO_FIT
    height = Plane(level - background.a, 0.0, 0.0, 0.0, -1.0, 0.0)
    return FOUND, _combine(background, height, noise, radius)


@inlined_kernel()
@no_type_check
def _fit_level(
    pattern: LoadedPattern, background: Plane, noise: float, radius: float
) -> tuple[int, BrightnessFit]:
    """As `fit_plain_brightness`, for a core that is not flat: one level, unless part of it is hardly dot."""
    level = middle_quantile(pattern.core, 0.55, 6)
    contrast = level - background.a
    if not contrast > 2.0 * noise or _count_below(pattern.core, level - DARK * contrast) > 0.0:
        return NOT_PLAIN, NO_FIT
    return FOUND, _combine(background, Plane(contrast, 0.0, 0.0, 0.0, -1.0, 0.0), noise, radius)


@inlined_kernel()
@no_type_check
def fit_plain_brightness(
    pattern: LoadedPattern, radius: float, part_x: float, part_y: float, noise: float
) -> tuple[int, BrightnessFit]:
    """Planes of background and contrast about the middle pixel of a dot at (part_x, part_y) from it.

    Returns FOUND and the fit, or NO_DOT or NOT_PLAIN.
    """
    if radius < PLANE_RADIUS:
        return _fit_small(pattern, radius, part_x, part_y, noise)
    core, squares, level = fit_even_plane(pattern.core, pattern.core_shape)
    background, contrast = _fit_background(pattern, level, noise)
    margin = max(0.2 * contrast, 3.0 * noise)
    if contrast > 0.0 and squares > margin * margin:
        # the shot noise may be larger on the dot than anywhere else
        margin = max(margin, WITHIN * math.sqrt(core.variance))
        core = fit_plane(pattern.core, LANES, core, margin)
    height, slope_x, slope_y = core.a - background.a, core.b - background.b, core.c - background.c
    enough = 0.9 * pattern.core_count
    is_flat = contrast > 0.0 and height > 0.0 and core.number >= enough and core.spread > 0.0
    if not is_flat or abs(slope_x) + abs(slope_y) > STEEP / radius * height:
        return _fit_level(pattern, background, noise, radius)
    inner = Plane(height, slope_x, slope_y, 0.0, core.variance, core.spread)
    return FOUND, _combine(background, inner, noise, radius)
