"""Light of the ground and of the dot, from a few pixels around and in each dot, compiled.

Loops that run in vector lanes stand in functions of their own. Images are (h, w * channels).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.compilation import FAST

SAMPLES = 80  # of ring and of core
VOTERS = 20  # of them, for medians
PLANE_RADIUS = 6.2  # px: smaller cores are all edge, or too small for a plane of their own


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _grey(image, weights, y, x):
    channels = weights.shape[0]
    value = np.float32(image[y, x * channels]) * weights[0]
    for channel in range(1, channels):
        value += np.float32(image[y, x * channels + channel]) * weights[channel]
    return value


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def core_reach(radius):
    """How far from its centre a dot that has a plane of its own is core."""
    return max(0.5 * radius, min(0.65 * radius, radius - 2.75))


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def choose_offsets(inner, outer, offset):
    """Every few pixels between two radii: rows of `offset` are x, y. Returns how many."""
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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _sample(image, weights, x, y, offset, number, reach, samples):
    """Pixels at offsets from the one nearest to (x, y), at most `reach` away: `samples` = dx, dy, value.

    Returns how many lie within the image.
    """
    height, width = image.shape[0], image.shape[1] // weights.shape[0]
    middle_x, middle_y = math.floor(x + 0.5), math.floor(y + 0.5)
    part_x, part_y = np.float32(middle_x - x), np.float32(middle_y - y)
    count = 0
    for k in range(number):
        u, v = middle_x + offset[0, k], middle_y + offset[1, k]
        if 0 <= u < width and 0 <= v < height:
            dx, dy = np.float32(offset[0, k]) + part_x, np.float32(offset[1, k]) + part_y
            if dx * dx + dy * dy > reach * reach:
                continue
            samples[0, count], samples[1, count] = dx, dy
            if weights.shape[0] == 1:
                samples[2, count] = np.float32(image[np.uint64(v), np.uint64(u)]) * weights[0]
            else:
                samples[2, count] = _grey(image, weights, v, u)
            count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _quantile(samples, count, quantile):
    """Quantile of about VOTERS of the sampled values, sorted by insertion; the last row is scratch."""
    stride = max(1, count // VOTERS)
    chosen = samples[3]
    number = 0
    for i in range(0, count, stride):
        value = samples[2, i]
        place = number
        while place > 0 and chosen[place - 1] > value:
            chosen[place] = chosen[place - 1]
            place -= 1
        chosen[place] = value
        number += 1
    return chosen[min(number - 1, int(quantile * number))]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _pull(dx, dy, value):
    """Centroid of what is lighter than the middle of the extremes: x, y; 0 where all is equal."""
    f = np.float32
    low = high = value[0]
    for i in range(value.shape[0]):
        low = value[i] if value[i] < low else low
        high = value[i] if value[i] > high else high
    middle = f(0.5) * (low + high)
    total = sum_x = sum_y = f(0.0)
    for i in range(value.shape[0]):
        weight = value[i] - middle
        weight = weight if weight > f(0.0) else f(0.0)
        total += weight
        sum_x += weight * dx[i]
        sum_y += weight * dy[i]
    if total <= f(0.0):
        return 0.0, 0.0
    return float(sum_x / total), float(sum_y / total)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def walk_to_dot(image, weights, x, y, radius, steps, offset, number, samples):
    """A few mean-shift steps on some of the pixels; returns x, y."""
    for _ in range(steps):
        count = _sample(image, weights, x, y, offset, number, 1e6, samples)
        if count < 4:
            break
        dx, dy = _pull(samples[0, :count], samples[1, :count], samples[2, :count])
        x, y = x + dx, y + dy
        if dx * dx + dy * dy < 0.02 * radius * radius:
            break
    return x, y


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _sums(dx, dy, value, a, b, c, margin):
    """Sums over the samples within `margin` of the plane a + b dx + c dy."""
    s1 = sx = sy = sxx = sxy = syy = sv = svx = svy = svv = np.float32(0.0)
    for i in range(value.shape[0]):
        rest = value[i] - (a + b * dx[i] + c * dy[i])
        weight = np.float32(1.0) if abs(rest) <= margin else np.float32(0.0)
        x, y, v = weight * dx[i], weight * dy[i], weight * rest
        s1 += weight
        sx += x
        sy += y
        sxx += x * dx[i]
        sxy += x * dy[i]
        syy += y * dy[i]
        sv += v
        svx += v * dx[i]
        svy += v * dy[i]
        svv += v * rest
    return s1, sx, sy, sxx, sxy, syy, sv, svx, svy, svv


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _plane(samples, count, a, b, c, margin):
    """Least-squares plane a + b dx + c dy of the samples within `margin` of a given plane.

    Returns a, b, c, number of samples used, variance of the rest, sum of dx^2 + dy^2.
    """
    f = np.float32
    s1, sx, sy, sxx, sxy, syy, sv, svx, svy, svv = _sums(
        samples[0, :count], samples[1, :count], samples[2, :count], f(a), f(b), f(c), f(margin)
    )
    if s1 < 1.0:
        return a, b, c, 0.0, 0.0, 0.0
    mx, my, mv = sx / s1, sy / s1, sv / s1
    cxx, cxy, cyy = sxx - s1 * mx * mx, sxy - s1 * mx * my, syy - s1 * my * my
    cxv, cyv = svx - s1 * mx * mv, svy - s1 * my * mv
    determinant = cxx * cyy - cxy * cxy
    db = dc = 0.0
    if s1 >= 6.0 and determinant > 0.05 * (cxx + cyy) ** 2 / 4.0:
        db = (cyy * cxv - cxy * cyv) / determinant
        dc = (cxx * cyv - cxy * cxv) / determinant
    variance = 0.0
    if s1 > 6.0:
        variance = max(svv - s1 * mv * mv - db * cxv - dc * cyv, 0.0) / (s1 - 3.0)
    return a + mv - db * mx - dc * my, b + db, c + dc, float(s1), variance, cxx + cyy


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def fit_light(image, weights, x, y, radius, noise, offsets, numbers, samples, light):
    """Planes of ground and core: `light` = ground a, b, c, contrast a, b, c, variance, spreads, variance.

    The spreads (sum of dx^2 + dy^2 of the pixels used) are those of ground and core; a core without a
    plane of its own (small, damaged, with a glint) has spread 0. The variances are those of ground and
    core, -1 where not known. Returns False where there is no dot.
    """
    count = _sample(image, weights, x, y, offsets[0], numbers[0], 1e6, samples)
    if count < 4:
        return False
    ground = _quantile(samples, count, 0.4)
    in_core = _sample(image, weights, x, y, offsets[1], numbers[1], max(0.5 * radius, 0.9), samples[4:])
    if in_core < 1:
        return False
    level = _quantile(samples[4:], in_core, 0.55)
    contrast = level - ground
    if not contrast > 0.0:
        return False
    margin = max(0.3 * contrast, 2.5 * noise)
    ga, gb, gc, _, variance, ground_spread = _plane(samples, count, ground, 0.0, 0.0, margin)
    ga, gb, gc, _, variance, ground_spread = _plane(samples, count, ga, gb, gc, margin)
    ka, kb, kc, core_spread, core_variance = level, gb, gc, 0.0, -1.0
    if radius >= PLANE_RADIUS:
        margin = max(0.2 * contrast, 3.0 * noise)
        pa, pb, pc, used, inner, spread = _plane(samples[4:], in_core, level, gb, gc, margin)
        steepness = math.hypot(pb - gb, pc - gc) * radius
        if used >= 9.0 and used > 0.75 * in_core and steepness < 0.4 * (pa - ga):
            ka, kb, kc, core_spread, core_variance = pa, pb, pc, spread, inner
    light[0], light[1], light[2] = ga, gb, gc
    light[3], light[4], light[5] = ka - ga, kb - gb, kc - gc
    light[6], light[7], light[8] = variance, ground_spread, core_spread
    light[9] = core_variance
    return ka > ga
