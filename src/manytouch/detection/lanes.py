"""Pixels of plain dots in vector lanes, compiled: fetched as a plan says, and summed up.

A dot that is not plain (with a glint or a hole, chipped, at the border) is left to `kernels`.
Images are flat (h * w * channels,).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.compilation import FAST, LEAF, copy_16
from manytouch.detection.plans import ALL, BLOCKS, DX, DY, LANES, ROWS, USED, VALUE, WALK


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
def copy_blocks(flat, base, offset, count, length, raw):
    """Blocks of pixels in a row, as they are, one after the other."""
    to = np.uint64(0)
    for b in range(np.uint64(count)):
        at = np.uint64(base + offset[np.uint64(BLOCKS * LANES) + b])
        for _ in range(np.uint64(length // 16)):
            copy_16(flat, at, raw, to)
            at += np.uint64(16)
            to += np.uint64(16)


@njit(**LEAF, fastmath=FAST)
@no_type_check
def weigh_blocks(flat, weights, base, offset, count, length, grey):
    """Signed grey levels of blocks of coloured pixels in a row."""
    three, one, two = np.uint64(3), np.uint64(1), np.uint64(2)
    blue, green, red = weights[0], weights[1], weights[2]
    for b in range(np.uint64(count)):
        at, to = np.uint64(base + offset[np.uint64(BLOCKS * LANES) + b]), b * np.uint64(length)
        for k in range(np.uint64(length)):
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
def moments(pixel, value, scale, count, light, low, gain, sums):
    """As `kernels._moments`, about the middle pixel, with the share of dot computed on the way.

    `value` (times `scale`) are signed grey levels; `pixel` = x, y, inside.
    """
    f = np.float32
    below, slope_x, slope_y = f(light[0]), f(light[1]), f(light[2])
    # w = gain (value - ground) / height - gain low; 1 / height to first order in the slopes of the dot, since
    # what comes next is the same on both sides
    inverse, start, scale = f(gain / light[3]), f(gain * low), f(scale)
    fall_x, fall_y = f(light[4] / light[3]) * inverse, f(light[5] / light[3]) * inverse
    zero, one = f(0.0), f(1.0)
    s0 = sx = sy = sxx = sxy = syy = edges = f(0.0)
    for i in range(np.uint64(count)):
        x, y = pixel[0, i], pixel[1, i]
        brightness = inverse - fall_x * x - fall_y * y
        weight = (f(value[i]) * scale - (below + slope_x * x + slope_y * y)) * brightness - start
        weight = zero if zero > weight else weight
        weight = one if one < weight else weight
        weight *= pixel[2, i]
        edges += one if zero < weight < one else zero
        wx, wy = weight * x, weight * y
        s0 += weight
        sx += wx
        sy += wy
        sxx += wx * x
        sxy += wx * y
        syy += wy * y
    if s0 <= zero:
        return False
    # the edge of an ellipse has twice the second moments, per pixel, of its area
    cx, cy = float(sx) / s0, float(sy) / s0
    twice = 2.0 * edges
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = s0, sx, sy, edges, edges * cx, edges * cy
    sums[6] = twice * (sxx / s0 - cx * cx) + edges * cx * cx
    sums[7] = twice * (sxy / s0 - cx * cy) + edges * cx * cy
    sums[8] = twice * (syy / s0 - cy * cy) + edges * cy * cy
    return True
