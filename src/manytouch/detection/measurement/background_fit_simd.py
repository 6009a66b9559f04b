"""Brightness of background and dot for plain dots, from samples in SIMD lanes, compiled.

`background_fit` is the general one, for damaged dots and at the border of the image.
"""

import math

from manytouch.compilation import REORDER, f32, f64, inlined_kernel, no_type_check, u64
from manytouch.detection.measurement.plane_fit import EVERYTHING, find_step, fit_plane
from manytouch.detection.measurement.records import (
    FOUND,
    NO_DOT,
    NO_FIT,
    NO_STEP,
    NOT_PLAIN,
    PLANE_RADIUS,
    BrightnessFit,
    Plane,
    Samples,
    soft_threshold,
)
from manytouch.detection.measurement.sampling_pattern import (
    LANES,
    LoadedPattern,
    core_radius,
    ring_radii,
)

WITHIN = 2.5  # deviations of a pixel of the core from its plane
STEEP = 0.12  # of the contrast: change over a radius from which on a dot is not plain
DARK = 0.3  # of the contrast: a pixel of the core that is so much darker is damaged
ALL = u64(LANES)


@inlined_kernel()
@no_type_check
def fit_all(samples: Samples) -> Plane:
    """Least-squares plane of all samples that are used."""
    return fit_plane(samples, LANES, Plane(f64(samples.value[0]), 0.0, 0.0, 0.0, 0.0, 0.0), EVERYTHING)


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
def use_between(samples: Samples, part: tuple[float, float], radii: tuple[float, float]) -> float:
    """Uses the samples that are between two distances from a position; returns how many."""
    count, least, most = f32(0.0), f32(radii[0] * radii[0]), f32(radii[1] * radii[1])
    part_x, part_y = f32(part[0]), f32(part[1])
    for i in range(ALL):
        x, y = samples.dx[i] - part_x, samples.dy[i] - part_y
        distance2 = x * x + y * y
        inside = f32(1.0) if least <= distance2 <= most else f32(0.0)
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
def _fit_background(
    pattern: LoadedPattern, radius: float, part: tuple[float, float], level: float, noise: float
) -> tuple[Plane, float, bool]:
    """Plane of the background around a core of brightness `level`, how much darker it is, and if it is even.

    A background with a step is not.
    """
    use_between(pattern.ring, part, ring_radii(radius))
    plane = fit_all(pattern.ring)
    contrast = level - plane.a
    # when the squares sum up to less than that of the margin, no sample is beyond it
    if plane.variance * (plane.number - 3.0) > max(0.3 * contrast, 2.5 * noise) ** 2:
        step = find_step(pattern.ring, LANES, plane, radius, contrast, noise, pattern.whole.value)
        if step.limit < NO_STEP.limit:
            return plane, contrast, False
        contrast = level - middle_quantile(pattern.ring, 0.4, 5)
        margin = max(0.3 * contrast, 2.5 * noise)
        plane = fit_plane(pattern.ring, LANES, Plane(level - contrast, 0.0, 0.0, 0.0, 0.0, 0.0), margin)
        plane = fit_plane(pattern.ring, LANES, plane, margin)
    return plane, contrast, True


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
    pattern: LoadedPattern, radius: float, part: tuple[float, float], noise: float
) -> tuple[int, BrightnessFit]:
    """As `fit_plain_brightness`, for a dot too small for a plane of its own."""
    core = pattern.core
    if use_between(core, part, (0.0, core_radius(radius))) < 1.0:
        return NO_DOT, NO_FIT
    level = middle_quantile(core, 0.55, 8)
    background, contrast, is_even = _fit_background(pattern, radius, part, level, noise)
    if not is_even:
        return NOT_PLAIN, NO_FIT
    if not (contrast > 0.0 and level > background.a):
        return NO_DOT, NO_FIT
    if radius >= 3.0:
        use_between(core, part, (0.0, radius - 1.0))
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
    pattern: LoadedPattern, radius: float, part: tuple[float, float], noise: float
) -> tuple[int, BrightnessFit]:
    """Planes of background and contrast about the middle pixel of a dot whose centre is at `part` from it.

    Returns FOUND and the fit, or NO_DOT or NOT_PLAIN.
    """
    if radius < PLANE_RADIUS:
        return _fit_small(pattern, radius, part, noise)
    used = use_between(pattern.core, part, (0.0, core_radius(radius)))
    core = fit_all(pattern.core)
    background, contrast, is_even = _fit_background(pattern, radius, part, core.a, noise)
    if not is_even:
        return NOT_PLAIN, NO_FIT
    margin = max(0.2 * contrast, 3.0 * noise)
    if contrast > 0.0 and core.variance * (core.number - 3.0) > margin * margin:
        # the shot noise may be larger on the dot than anywhere else
        margin = max(margin, WITHIN * math.sqrt(core.variance))
        core = fit_plane(pattern.core, LANES, core, margin)
    height, slope_x, slope_y = core.a - background.a, core.b - background.b, core.c - background.c
    enough = 0.9 * used
    is_flat = contrast > 0.0 and height > 0.0 and core.number >= enough and core.spread > 0.0
    if not is_flat or abs(slope_x) + abs(slope_y) > STEEP / radius * height:
        return _fit_level(pattern, background, noise, radius)
    inner = Plane(height, slope_x, slope_y, 0.0, core.variance, core.spread)
    return FOUND, _combine(background, inner, noise, radius)
