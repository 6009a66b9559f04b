"""Pixels of plain dots in vector lanes, compiled: fetched as a plan says, and summed up.

A dot that is not plain (with a glint or a hole, chipped, at the border) is left to `kernels`.
Images are flat (h * w * channels,).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.compilation import FAST, LEAF
from manytouch.detection.measurement.sampling_pattern import ALL, DX, DY, LANES, ROWS, USED, VALUE, WALK
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


@njit(**LEAF, fastmath=FAST)
@no_type_check
def gather(flat, weights, base, offset, part, sample):
    """Signed grey levels of the pixels of ring, core or walk."""
    channels = weights.shape[0]
    first, to = np.uint64(part * LANES), np.uint64(part * ROWS + VALUE)
    if channels == 1:
        weight = weights[0]
        for k in range(ALL):
            sample[to + k] = np.float32(flat[np.uint64(base + offset[first + k])]) * weight
    else:
        blue, green, red = weights[0], weights[1], weights[2]
        for k in range(ALL):
            at = np.uint64(base + offset[first + k])
            grey = np.float32(flat[at]) * blue + np.float32(flat[at + np.uint64(1)]) * green
            sample[to + k] = grey + np.float32(flat[at + np.uint64(2)]) * red


@njit(**LEAF)
@no_type_check
def saddle(flat, weights, base, width):
    """Half of what four pixels around a dot's middle differ crosswise: noise, where the dot is round."""
    channels = weights.shape[0]
    total = 0.0
    for c in range(channels):
        above, below = base + c - width * channels, base + c + width * channels
        rise = float(flat[above - channels]) - float(flat[above + channels])
        total += float(weights[c]) * (rise - float(flat[below - channels]) + float(flat[below + channels]))
    return 0.5 * total


@njit(**LEAF, fastmath=FAST)
@no_type_check
def weigh_window(flat, weights, first, width, columns, rows, grey):
    """Signed grey levels of a window of coloured pixels, row by row."""
    three, one, two = np.uint64(3), np.uint64(1), np.uint64(2)
    blue, green, red = weights[0], weights[1], weights[2]
    for row in range(rows):
        at, to = np.uint64(first + 3 * width * row), np.uint64(columns * row)
        for k in range(np.uint64(columns)):
            i = at + three * k
            value = np.float32(flat[i]) * blue + np.float32(flat[i + one]) * green
            grey[to + k] = value + np.float32(flat[i + two]) * red


@njit(**LEAF, fastmath=FAST)
@no_type_check
def pull(sample):
    """Centroid of what is lighter than the middle between the light and the dark half: x, y."""
    f, at = np.float32, np.uint64(WALK * ROWS)
    # least and largest values would not run in lanes
    number = total = f(0.0)
    for i in range(ALL):
        number += sample[at + USED + i]
        total += sample[at + USED + i] * sample[at + VALUE + i]
    mean = total / number
    light = total_light = f(0.0)
    for i in range(ALL):
        is_light = sample[at + USED + i] if sample[at + VALUE + i] > mean else f(0.0)
        light += is_light
        total_light += is_light * sample[at + VALUE + i]
    if light <= f(0.0) or light >= number:
        return 0.0, 0.0
    middle = f(0.5) * (total_light / light + (total - total_light) / (number - light))
    total = sum_x = sum_y = f(0.0)
    for i in range(ALL):
        weight = sample[at + VALUE + i] - middle
        weight = weight if weight > f(0.0) else f(0.0)
        weight *= sample[at + USED + i]
        total += weight
        sum_x += weight * sample[at + DX + i]
        sum_y += weight * sample[at + DY + i]
    if total <= f(0.0):
        return 0.0, 0.0
    return float(sum_x / total), float(sum_y / total)


@njit(**LEAF, fastmath=FAST)
@no_type_check
def moments(flat, scale, first, width, half, strips, mask, light, low, gain, planes, part, sums):
    """As `kernels._moments`, about the middle pixel, with the share of dot computed on the way.

    Args:
        flat: pixels; `scale` times them are signed grey levels.
        first, width: the window's first pixel, and how far its rows are apart.
        half: the window's rows and columns begin so far from the middle one.
        strips, mask: of the plan.
        light: of `planes.fit_light`.
        planes, part: scratch for `strip_sums`.
    """
    # w = gain (value - ground) / height - gain low; 1 / height to first order in the slopes of the dot, since
    # what comes next is the same on both sides
    inverse = gain / light[3]
    fall_x, fall_y = light[4] / light[3] * inverse, light[5] / light[3] * inverse
    planes[GROUND] = (light[0] - half * (light[1] + light[2])) / scale
    planes[GROUND + 1], planes[GROUND + 2] = light[1] / scale, light[2] / scale
    planes[BRIGHT] = (inverse + half * (fall_x + fall_y)) * scale
    planes[BRIGHT + 1], planes[BRIGHT + 2] = -fall_x * scale, -fall_y * scale
    planes[START], planes[LEFT] = gain * low, -half
    strip_sums(flat, first, width, strips, 2 * half + 1, mask, planes, part)
    s0, sx, sxx = float(part[S0]), float(part[SX]), float(part[SXX])
    if s0 <= 0.0:
        return False
    # rows were counted from below: y = under - u
    under, u, uu = half + 1.0, float(part[R1]), 2.0 * part[R2] - part[R1]
    sy, sxy, syy = under * s0 - u, under * sx - part[RX], under * (under * s0 - 2.0 * u) + uu
    # the edge of an ellipse has twice the second moments, per pixel, of its area
    edges, each = float(part[EDGE]), 1.0 / s0
    cx, cy = sx * each, sy * each
    twice = 2.0 * edges
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = s0, sx, sy, edges, edges * cx, edges * cy
    sums[6] = twice * (sxx * each - cx * cx) + edges * cx * cx
    sums[7] = twice * (sxy * each - cx * cy) + edges * cx * cy
    sums[8] = twice * (syy * each - cy * cy) + edges * cy * cy
    return True
