"""The loops over the pixels of each dot, compiled; see `centroid` for what they mean.

Images are (h, w * channels).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.compilation import FAST, LEAF, prefetch
from manytouch.detection.measurement import background_fit_simd as planes
from manytouch.detection.measurement import simd_moments as lanes
from manytouch.detection.measurement.background_fit import (
    PLANE_RADIUS,
    SAMPLES,
    choose_offsets,
    fit_light,
    walk_to_dot,
)
from manytouch.detection.measurement.covariance import GAIN, HIGH, LOW, NOTES, settle, take_note, take_nothing
from manytouch.detection.measurement.sampling_pattern import (
    CORE,
    FARTHEST,
    HALF,
    RING,
    ROWS,
    STRIPS,
    WALK,
    take_plan,
)
from manytouch.detection.measurement.simd_strip_sums import STRIP

SADDLE_RADIUS = 3.0  # px: smaller dots are not flat anywhere
AHEAD = 3  # dots
LINE = 64  # bytes that memory gives at once


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _fill_holes(share, stack):
    """Make dot (share 1) of what the dot encloses: a glint inside it belongs to it."""
    height, width = share.shape
    top = 0
    seen = np.zeros((height, width), dtype=np.bool_)
    for v in range(height):
        for u in range(width):
            is_rim = v in (0, height - 1) or u in (0, width - 1)
            if is_rim and share[v, u] < 0.5 and not seen[v, u]:
                seen[v, u] = True
                stack[top] = v * width + u
                top += 1
    while top > 0:
        top -= 1
        v, u = stack[top] // width, stack[top] % width
        for dv, du in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            y, x = v + dv, u + du
            if 0 <= y < height and 0 <= x < width and not seen[y, x] and share[y, x] < 0.5:
                seen[y, x] = True
                stack[top] = y * width + x
                top += 1
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            if share[v, u] < HIGH and not seen[v, u]:
                # its inner edge is no edge either, but the dot's outer one stays as it is
                outside = (
                    seen[v - 1, u - 1] or seen[v - 1, u] or seen[v - 1, u + 1] or seen[v, u - 1]
                    or seen[v, u + 1] or seen[v + 1, u - 1] or seen[v + 1, u] or seen[v + 1, u + 1]
                )  # fmt: skip
                if share[v, u] < 0.5 or not outside:
                    share[v, u] = 1.0


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _share(image, weights, x, y, x0, y0, light, share):
    """Share of dot in each pixel of the window `share`, whose first pixel is (x0, y0)."""
    f = np.float32
    # unsigned indices need no check for negative ones, and lanes convert no integers: dx is counted in floats
    rows, columns, left, top = (
        np.uint64(share.shape[0]),
        np.uint64(share.shape[1]),
        np.uint64(x0),
        np.uint64(y0),
    )
    slope, rise, least = f(light[1]), f(light[4]), f(0.5 * light[3])
    three = np.uint64(3)
    for v in range(rows):
        dy = float(v) + y0 - y
        below, height = f(light[0] + light[2] * dy), f(light[3] + light[5] * dy)
        dx = f(x0 - x)
        if weights.shape[0] == 1:
            weight = weights[0]
            for u in range(columns):
                here = height + rise * dx
                here = here if here > least else least
                share[v, u] = (f(image[top + v, left + u]) * weight - (below + slope * dx)) / here
                dx += f(1.0)
        else:
            blue, green, red = weights[0], weights[1], weights[2]
            for u in range(columns):
                at = three * (left + u)
                grey = f(image[top + v, at]) * blue + f(image[top + v, at + np.uint64(1)]) * green
                grey += f(image[top + v, at + np.uint64(2)]) * red
                here = height + rise * dx
                here = here if here > least else least
                share[v, u] = (grey - (below + slope * dx)) / here
                dx += f(1.0)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _moments(share, x, y, reach2, sums):
    """`sums` = weight, its moments x, y, edge pixels, their moments x, y, xx, xy, yy, about (x, y)."""
    f = np.float32
    sums[:] = 0.0
    for v in range(np.uint64(share.shape[0])):
        dy = float(v) - y
        if dy * dy > reach2:
            continue
        half = math.sqrt(reach2 - dy * dy)
        left = min(max(0, int(x - half + 1)), share.shape[1])
        right = max(left, min(share.shape[1], int(x + half) + 1))
        total = moment = count = edge_x = edge_xx = f(0.0)
        dx = f(left - x)
        for u in range(np.uint64(left), np.uint64(right)):
            weight = (share[v, u] - f(LOW)) * f(GAIN)
            weight = weight if weight > f(0.0) else f(0.0)
            weight = weight if weight < f(1.0) else f(1.0)
            total += weight
            moment += weight * dx
            is_edge = f(1.0) if f(0.0) < weight < f(1.0) else f(0.0)
            count += is_edge
            edge_x += is_edge * dx
            edge_xx += is_edge * dx * dx
            dx += f(1.0)
        sums[0] += total
        sums[1] += moment
        sums[2] += total * dy
        sums[3] += count
        sums[4] += edge_x
        sums[5] += count * dy
        sums[6] += edge_xx
        sums[7] += edge_x * dy
        sums[8] += count * dy * dy
    return sums[0] > 0.0


@njit(**LEAF)
@no_type_check
def _result(sums, light, reach2, x, y, radius, width, height, out, row, note):
    """`out` as in `measure_dots` from the sums about (x, y), but for the covariance that noise makes."""
    take_note(sums, light, reach2, note[:, row])
    total = sums[0]
    # what the pixels leave when there is no noise at all, measured on rendered discs of 1.5 to 20 px
    least = min(0.013, 0.003 + 0.04 / (radius * radius))
    out[row, 2] = out[row, 4] = least * least
    out[row, 3] = 0.0
    x, y = x + sums[1] / total, y + sums[2] / total
    out[row, 0], out[row, 1] = x, y
    out[row, 5], out[row, 6] = total, light[3]
    out[row, 7] = sums[3] / (2.0 * math.sqrt(math.pi * total))
    out[row, 8] = 0.0
    margin = min(x, width - 1.0 - x, y, height - 1.0 - y) + 0.5
    if margin < 1.15 * radius:
        # what is missing of a disc of the expected size; its centroid lies that much too far inside
        lacking = min(max(1.0 - total / (math.pi * radius * radius), 0.0), 1.0)
        depth = min(max(1.15 - margin / radius, 0.0), 1.0)
        out[row, 8] = max(lacking, 0.3 * depth)
        inflation = (0.85 * radius * out[row, 8]) ** 2
        out[row, 2] += inflation
        out[row, 4] += inflation


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _measure_odd(
    image, weights, x, y, radius, noise, offsets, numbers, samples, buffer, stack, out, row, note
):
    """Any dot, also at the border or with a hole; `out` as in `measure_dots`. False where there is none."""
    height, width = image.shape[0], image.shape[1] // weights.shape[0]
    reach = 1.35 * radius + 1.2
    reach2 = reach * reach
    light, sums = np.empty(10), np.empty(9)
    for attempt in range(3):
        x0, x1 = max(0, int(x - reach)), min(width, int(x + reach) + 2)
        y0, y1 = max(0, int(y - reach)), min(height, int(y + reach) + 2)
        if (
            x1 - x0 < 3
            or y1 - y0 < 3
            or not fit_light(image, weights, x, y, radius, noise, offsets, numbers, samples, light)
        ):
            return False
        share = buffer[: (y1 - y0) * (x1 - x0)].reshape(y1 - y0, x1 - x0)
        _share(image, weights, x, y, x0, y0, light, share)
        if light[8] == 0.0 and radius >= 3.0:
            _fill_holes(share, stack)
        if not _moments(share, x - x0, y - y0, reach2, sums):
            return False
        dx, dy = sums[1] / sums[0], sums[2] / sums[0]
        if attempt == 2 or dx * dx + dy * dy < (0.04 * radius + 0.1) ** 2:
            break
        x, y = x + dx, y + dy
    _result(sums, light, reach2, x, y, radius, width, height, out, row, note)
    return True


@njit(**LEAF)
@no_type_check
def _is_inside(x, y, margin, width, height):
    return margin <= x < width - margin and margin <= y < height - margin


@njit(**LEAF)
@no_type_check
def _walk_plain(flat, weights, width, height, x, y, radius, walk, count, plan, offset, sample):
    """As `walk_to_dot`, in lanes: x, y, and whether the plan still lies within the image."""
    for _ in range(walk):
        here_x, here_y = math.floor(x + 0.5), math.floor(y + 0.5)
        if not _is_inside(here_x, here_y, count[plan, FARTHEST], width, height):
            return x, y, False
        base = (here_y * width + here_x) * weights.shape[0]
        lanes.gather(flat, weights, base, offset, WALK, sample)
        dx, dy = lanes.pull(sample)
        off_x, off_y = here_x + dx - x, here_y + dy - y
        x, y = here_x + dx, here_y + dy
        if off_x * off_x + off_y * off_y < 0.06 * radius * radius:
            break
    return x, y, True


@njit(**LEAF)
@no_type_check
def _measure_plain(
    flat,
    weights,
    width,
    height,
    x,
    y,
    radius,
    noise,
    count,
    plan,
    mask,
    offset,
    sample,
    shape,
    grey,
    work,
    light,
    sums,
    out,
    row,
    note,
):
    """A plain dot in lanes. Returns 1; 0 where there is none; -1 where the dot is not plain."""
    reach = 1.35 * radius + 1.2
    half, strips = np.int64(count[plan, HALF]), np.int64(count[plan, STRIPS])
    for attempt in range(3):
        here_x, here_y = math.floor(x + 0.5), math.floor(y + 0.5)
        if not _is_inside(here_x, here_y, count[plan, FARTHEST], width, height):
            return -1
        base = (here_y * width + here_x) * weights.shape[0]
        lanes.gather(flat, weights, base, offset, RING, sample)
        lanes.gather(flat, weights, base, offset, CORE, sample)
        part_x, part_y = np.float32(x - here_x), np.float32(y - here_y)
        found = planes.fit_light(sample, shape, count[plan, CORE], radius, part_x, part_y, noise, light)
        if found < 1:
            return found
        first = base - (half * width + half) * weights.shape[0]
        if weights.shape[0] == 1:
            is_dot = lanes.moments(
                flat,
                weights[0],
                first,
                width,
                half,
                strips,
                mask[plan],
                light,
                LOW,
                GAIN,
                work[0],
                work[1],
                sums,
            )
        else:
            columns = STRIP * strips
            lanes.weigh_window(flat, weights, first, width, columns, 2 * half + 1, grey)
            is_dot = lanes.moments(
                grey, 1.0, 0, columns, half, strips, mask[plan], light, LOW, GAIN, work[0], work[1], sums
            )
        if not is_dot:
            return 0
        dx, dy = sums[1] / sums[0], sums[2] / sums[0]
        is_near = max(abs(dx), abs(dy)) < 0.04 * radius + 0.6
        if radius < PLANE_RADIUS:
            is_near &= (dx - part_x) ** 2 + (dy - part_y) ** 2 < (0.06 * radius + 0.15) ** 2
        if attempt == 2 or is_near:
            break
        x, y = here_x + dx, here_y + dy
    if SADDLE_RADIUS <= radius < PLANE_RADIUS:
        light[9] = lanes.saddle(flat, weights, base, width) ** 2
    _result(sums, light, reach * reach, here_x, here_y, radius, width, height, out, row, note)
    return 1


@njit(**LEAF)
@no_type_check
def _fetch(flat, channels, width, x, y, reach):
    """Asks memory for a window that is measured soon: no machine foresees where dots lie."""
    if not (abs(x) < 1e6 and abs(y) < 1e6):
        return
    line, first = LINE // flat.itemsize, (int(y) - reach) * width + int(x) - reach
    for row in range(first, first + (2 * reach + 1) * width, width):
        for at in range(row * channels, (row + 2 * reach) * channels + line, line):
            prefetch(flat, at)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def measure_dots(image, weights, near, radius, index, place, mask, count, noise, least, walk, out):
    """Rows of `out`: x, y, cxx, cxy, cyy, area, contrast, edge width, cut share; NaN without a dot.

    `index`, `place`, `mask` and `count` are what `plans.plans_of` gives for the radii.
    """
    flat, channels = image.reshape(-1), weights.shape[0]
    height, width = image.shape[0], image.shape[1] // channels
    odd_samples = np.empty((8, 6 * SAMPLES), dtype=np.float32)
    odd_offsets, numbers = np.empty((3, 2, 6 * SAMPLES), dtype=np.int32), np.zeros(3, dtype=np.int64)
    largest = 1.0
    for i in range(radius.shape[0]):
        largest = max(largest, radius[i])
    side = 2 * int(1.35 * largest + 4.2) + 1
    stack, buffer = np.empty(side * side, dtype=np.int64), np.empty(side * side, dtype=np.float32)
    offset = np.empty(place.shape[2], dtype=np.int64)
    sample = np.empty(3 * ROWS, dtype=np.float32)
    grey = np.empty(STRIP * mask.shape[1] if channels > 1 else 0, dtype=np.float32)
    work = np.empty((2, 8), dtype=np.float32)
    shape, light, sums = np.empty((2, 7)), np.empty(10), np.empty(9)
    note = np.empty((NOTES, near.shape[0]))
    plan, planned = -1, 0.0
    for i in range(near.shape[0]):
        if i + AHEAD < near.shape[0]:
            soon = i + AHEAD
            _fetch(flat, channels, width, near[soon, 0], near[soon, 1], count[index[soon], FARTHEST])
        out[i] = np.nan
        x, y = near[i, 0], near[i, 1]
        if not (x >= -0.5 and y >= -0.5 and x <= width - 0.5 and y <= height - 0.5):
            take_nothing(note[:, i])
            continue
        if index[i] != plan:
            plan = index[i]
            take_plan(place[plan], count[plan], width, channels, offset, sample, shape)
        x, y, is_plain = _walk_plain(
            flat, weights, width, height, x, y, radius[i], walk, count, plan, offset, sample
        )
        found = -1
        if is_plain:
            found = _measure_plain(
                flat, weights, width, height, x, y, radius[i], noise,
                count, plan, mask, offset, sample, shape, grey, work, light, sums, out, i, note,
            )  # fmt: skip
        if found == -1:
            if radius[i] != planned:
                planned = radius[i]
                numbers[0] = choose_offsets(1.3 * planned + 1.0, 1.75 * planned + 1.5, odd_offsets[0])
                numbers[1] = choose_offsets(-1.0, max(0.5 * planned, 0.9) + 0.75, odd_offsets[1])
                numbers[2] = choose_offsets(-1.0, 1.4 * planned + 0.7, odd_offsets[2])
            if walk > 0 and not is_plain:
                x, y = walk_to_dot(
                    image, weights, x, y, radius[i], walk, odd_offsets[2], numbers[2], odd_samples
                )
            if _measure_odd(
                image, weights, x, y, radius[i], noise,
                odd_offsets, numbers, odd_samples, buffer, stack, out, i, note,
            ):  # fmt: skip
                found = 1
        if found != 1:
            out[i] = np.nan
            take_nothing(note[:, i])
    settle(note, radius, least * least, weights.sum() >= 0.0, out)
