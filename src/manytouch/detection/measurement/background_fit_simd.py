"""Light of the ground and of a plain dot from samples in vector lanes, compiled; compare `light`."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.compilation import FAST, LEAF
from manytouch.detection.measurement.background_fit import PLANE_RADIUS
from manytouch.detection.measurement.sampling_pattern import ALL, CORE, DX, DY, RING, ROWS, USED, VALUE

WITHIN = 2.5  # deviations of a pixel of the core from its plane
STEEP = 0.12  # of the contrast: change over a radius from where on a dot is not plain


@njit(**LEAF, fastmath=FAST)
@no_type_check
def _even_plane(sample, at, shape, part):
    """Least-squares plane of all samples: a, b, c, sum of the rests' squares, mean of the values."""
    f = np.float32
    middle = sample[at + VALUE]
    sv = svx = svy = svv = f(0.0)
    for i in range(ALL):
        used, value = sample[at + USED + i], sample[at + VALUE + i]
        rest = used * (value - middle)
        sv += rest
        svx += rest * sample[at + DX + i]
        svy += rest * sample[at + DY + i]
        svv += rest * rest
    number, mx, my = shape[part, 0], shape[part, 1], shape[part, 2]
    each = f(1.0) / f(number)
    mean = float(sv * each)
    cxv, cyv = svx - sv * mx, svy - sv * my
    db = shape[part, 4] * cxv + shape[part, 5] * cyv
    dc = shape[part, 5] * cxv + shape[part, 6] * cyv
    rests = max(svv - sv * mean - db * cxv - dc * cyv, 0.0)
    mean += middle
    return mean - db * mx - dc * my, db, dc, rests, mean


@njit(**LEAF, fastmath=FAST)
@no_type_check
def _quantile(sample, at, quantile, halvings):
    """Mean of the samples next to a middle quantile: within a range that is halved so many times."""
    f = np.float32
    start = sample[at + VALUE]
    number = total = square = f(0.0)
    for i in range(ALL):
        used, value = sample[at + USED + i], sample[at + VALUE + i] - start
        number += used
        total += used * value
        square += used * value * value
    mean = total / number
    rank = f(min(int(number) - 1, int(quantile * number)))
    # a middle quantile is never farther from the mean than about 1.3 deviations (Cantelli)
    reach = f(2.0) * f(math.sqrt(max(square / number - mean * mean, f(0.0)))) + f(0.01)
    low, high = start + mean - reach, start + mean + reach
    for _ in range(halvings):
        middle = f(0.5) * (low + high)
        lower = f(0.0)
        for i in range(ALL):
            lower += sample[at + USED + i] if sample[at + VALUE + i] < middle else f(0.0)
        if lower <= rank:
            low = middle
        else:
            high = middle
    total = weight = f(0.0)
    for i in range(ALL):
        value = sample[at + VALUE + i]
        inside = sample[at + USED + i] if low <= value < high else f(0.0)
        weight += inside
        total += inside * value
    return float(total / weight) if weight > f(0.0) else float(low)


@njit(**LEAF, fastmath=FAST)
@no_type_check
def _plane(sample, at, start_a, start_b, start_c, margin):
    """Least-squares plane of the samples within `margin` of a given plane (a, b, c).

    Returns a, b, c, number of samples used, variance of the rest, sum of dx^2 + dy^2.
    """
    f = np.float32
    a, b, c, margin = f(start_a), f(start_b), f(start_c), f(margin)
    s1 = sx = sy = sxx = sxy = syy = sv = svx = svy = svv = f(0.0)
    for i in range(ALL):
        dx, dy = sample[at + DX + i], sample[at + DY + i]
        rest = sample[at + VALUE + i] - (a + b * dx + c * dy)
        weight = sample[at + USED + i] if abs(rest) <= margin else f(0.0)
        x, y, v = weight * dx, weight * dy, weight * rest
        s1 += weight
        sx += x
        sy += y
        sxx += x * dx
        sxy += x * dy
        syy += y * dy
        sv += v
        svx += v * dx
        svy += v * dy
        svv += v * rest
    if s1 < f(1.0):
        return start_a, start_b, start_c, 0.0, 0.0, 0.0
    each = f(1.0) / s1
    mx, my, mv = sx * each, sy * each, sv * each
    cxx, cxy, cyy = sxx - sx * mx, sxy - sx * my, syy - sy * my
    cxv, cyv = svx - sx * mv, svy - sy * mv
    determinant, spread = cxx * cyy - cxy * cxy, cxx + cyy
    db = dc = f(0.0)
    if s1 >= f(6.0) and determinant > f(0.0125) * spread * spread:
        each = f(1.0) / determinant
        db, dc = (cyy * cxv - cxy * cyv) * each, (cxx * cyv - cxy * cxv) * each
    variance = f(0.0)
    if s1 > f(6.0):
        variance = max(svv - sv * mv - db * cxv - dc * cyv, f(0.0)) / (s1 - f(3.0))
    # in double precision from here on
    return (
        start_a + mv - db * mx - dc * my,
        start_b + db,
        start_c + dc,
        float(s1),
        float(variance),
        float(spread),
    )


@njit(**LEAF, fastmath=FAST)
@no_type_check
def _keep_near(sample, at, part_x, part_y, reach, number):
    """Uses those of the first samples that lie within a radius of a place; returns how many."""
    f = np.float32
    count, reach2 = f(0.0), f(reach * reach)
    for i in range(ALL):
        x, y = sample[at + DX + i] - part_x, sample[at + DY + i] - part_y
        inside = f(1.0) if x * x + y * y <= reach2 and i < np.uint64(number) else f(0.0)
        sample[at + USED + i] = inside
        count += inside
    return count


@njit(**LEAF, fastmath=FAST)
@no_type_check
def _number_low(sample, at, least):
    """How many of the used samples are darker than `least`?"""
    f = np.float32
    count, least = f(0.0), f(least)
    for i in range(ALL):
        count += sample[at + USED + i] if sample[at + VALUE + i] < least else f(0.0)
    return count


@njit(**LEAF)
@no_type_check
def _fit_ground(sample, shape, level, noise, light):
    """The ground around a core of brightness `level`: its part of `light`, and how much darker it is."""
    ring = np.uint64(RING * ROWS)
    ga, gb, gc, rests, ground = _even_plane(sample, ring, shape, RING)
    spread = shape[RING, 3]
    variance = rests / max(shape[RING, 0] - 3.0, 1.0)
    contrast = level - ground
    # when the squares sum up to less than that of the margin, no sample lies beyond it
    if rests > max(0.3 * contrast, 2.5 * noise) ** 2:
        contrast = level - _quantile(sample, ring, 0.4, 5)
        margin = max(0.3 * contrast, 2.5 * noise)
        ga, gb, gc, _, variance, spread = _plane(sample, ring, level - contrast, 0.0, 0.0, margin)
        ga, gb, gc, _, variance, spread = _plane(sample, ring, ga, gb, gc, margin)
    light[0], light[1], light[2], light[6], light[7] = ga, gb, gc, variance, spread
    return contrast


@njit(**LEAF)
@no_type_check
def _fit_small(sample, shape, in_core, radius, part_x, part_y, noise, light):
    """As `fit_light`, for a dot too small for a plane of its own."""
    core = np.uint64(CORE * ROWS)
    if _keep_near(sample, core, part_x, part_y, max(0.5 * radius, 0.9), in_core) < 1.0:
        return 0
    level = _quantile(sample, core, 0.55, 8)
    contrast = _fit_ground(sample, shape, level, noise, light)
    if not (contrast > 0.0 and level > light[0]):
        return 0
    if radius >= 3.0:
        _keep_near(sample, core, part_x, part_y, radius - 1.0, in_core)
        if _number_low(sample, core, level - 0.3 * contrast) > 0.0:
            return -1
    light[3], light[4], light[5], light[8], light[9] = level - light[0], 0.0, 0.0, 0.0, -1.0
    return 1


@njit(**LEAF)
@no_type_check
def _fit_level(sample, noise, light):
    """As `fit_light`, for a core that is not flat: one brightness, unless part of it is hardly dot."""
    core = np.uint64(CORE * ROWS)
    level = _quantile(sample, core, 0.55, 6)
    height = level - light[0]
    if not height > 2.0 * noise or _number_low(sample, core, level - 0.3 * height) > 0.0:
        return -1
    light[3], light[4], light[5], light[8], light[9] = height, 0.0, 0.0, 0.0, -1.0
    return 1


@njit(**LEAF)
@no_type_check
def fit_light(sample, shape, in_core, radius, part_x, part_y, noise, light):
    """`light` as `light.fit_light` gives it, about the middle pixel; the dot is at (part_x, part_y) from it.

    Returns 1; 0 where there is no dot; -1 where the dot is not plain.
    """
    if radius < PLANE_RADIUS:
        return _fit_small(sample, shape, in_core, radius, part_x, part_y, noise, light)
    ka, kb, kc, rests, level = _even_plane(sample, np.uint64(CORE * ROWS), shape, CORE)
    contrast = _fit_ground(sample, shape, level, noise, light)
    margin, spread = max(0.2 * contrast, 3.0 * noise), shape[CORE, 3]
    used, variance = float(in_core), rests / max(in_core - 3.0, 1.0)
    if contrast > 0.0 and rests > margin * margin:
        # light's own noise may be larger on the dot than anywhere else
        margin = max(margin, WITHIN * math.sqrt(variance))
        ka, kb, kc, used, variance, spread = _plane(sample, np.uint64(CORE * ROWS), ka, kb, kc, margin)
    height, rise_x, rise_y = ka - light[0], kb - light[1], kc - light[2]
    is_flat = contrast > 0.0 and height > 0.0 and used >= 0.9 * in_core and spread > 0.0
    if not is_flat or abs(rise_x) + abs(rise_y) > STEEP / radius * height:
        return _fit_level(sample, noise, light)
    light[3], light[4], light[5], light[8], light[9] = height, rise_x, rise_y, spread, variance
    return 1
