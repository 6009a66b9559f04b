"""The loops over the pixels of each dot, compiled; see `centroid` for what they mean.

Images are (h, w * channels). Loops along rows stand in functions of their own so that they run in
vector lanes.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import no_type_check

import numpy as np
from numba import njit

LOW, HIGH = 0.15, 0.85  # soft threshold on the share of dot in a pixel
GAIN = 1.0 / (HIGH - LOW)
SAMPLES = 80  # of ring and of core
VOTERS = 20  # of them, for medians
PLANE_RADIUS = 5.0  # px: smaller cores are all edge
FAST = {"reassoc", "contract", "nsz", "arcp"}  # lets sums run in lanes; NaN and infinity stay what they are


@njit(cache=True, error_model="numpy")
@no_type_check
def _grey(image, weights, y, x):
    channels = weights.shape[0]
    value = np.float32(image[y, x * channels]) * weights[0]
    for channel in range(1, channels):
        value += np.float32(image[y, x * channels + channel]) * weights[channel]
    return value


@njit(cache=True, error_model="numpy")
@no_type_check
def _choose_offsets(inner, outer, offset):
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
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


@njit(cache=True, error_model="numpy")
@no_type_check
def _walk_to_dot(image, weights, x, y, radius, steps, offset, number, samples):
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
@no_type_check
def _tail(z):
    """E[max(n - z, 0)^2] of a standard normal n: noise that passes the soft threshold."""
    if z > 6.0:
        return 0.0
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return (1.0 + z * z) * 0.5 * math.erfc(z / math.sqrt(2.0)) - z * density


@njit(cache=True, error_model="numpy")
@no_type_check
def _light(image, weights, x, y, radius, noise, offsets, numbers, samples, light):
    """Planes of ground and core: `light` = ground a, b, c, contrast a, b, c, variance and spreads.

    The spreads (sum of dx^2 + dy^2 of the pixels used) are those of ground and core; a core without a
    plane of its own (small, damaged, with a glint) has spread 0. Returns False where there is no dot.
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
    ka, kb, kc, core_spread = level, gb, gc, 0.0
    if radius >= PLANE_RADIUS:
        margin = max(0.2 * contrast, 3.0 * noise)
        pa, pb, pc, used, _, spread = _plane(samples[4:], in_core, level, gb, gc, margin)
        steepness = math.hypot(pb - gb, pc - gc) * radius
        if used >= 9.0 and used > 0.75 * in_core and steepness < 0.4 * (pa - ga):
            ka, kb, kc, core_spread = pa, pb, pc, spread
    light[0], light[1], light[2] = ga, gb, gc
    light[3], light[4], light[5] = ka - ga, kb - gb, kc - gc
    light[6], light[7], light[8] = variance, ground_spread, core_spread
    return ka > ga


@njit(cache=True, error_model="numpy", fastmath=FAST)
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
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


@njit(cache=True, error_model="numpy")
@no_type_check
def _uncertainty(sums, light, noise, reach2, out):
    """Covariance of the centre, out[2:5] = cxx, cxy, cyy; see `centroid`."""
    dx, dy, count = sums[1] / sums[0], sums[2] / sums[0], sums[3]
    exx = sums[6] - 2.0 * dx * sums[4] + count * dx * dx
    eyy = sums[8] - 2.0 * dy * sums[5] + count * dy * dy
    exy = sums[7] - dx * sums[5] - dy * sums[4] + count * dx * dy
    noise2 = max(noise * noise, light[6])
    scale = GAIN / (light[3] * sums[0])
    rest = max(0.5 * math.pi * reach2 * reach2 - exx - eyy, 0.0)
    passed = 0.5 * rest * _tail(LOW * light[3] / math.sqrt(noise2))
    slopes = (2.0 / light[7] if light[7] > 0.0 else 0.0) + (2.0 / light[8] if light[8] > 0.0 else 0.0)
    direct, tilt = noise2 * scale * scale, 0.25 * noise2 * scale * scale * slopes
    out[2] = direct * (exx + passed) + tilt * (exx * exx + exy * exy)
    out[3] = direct * exy + tilt * exy * (exx + eyy)
    out[4] = direct * (eyy + passed) + tilt * (eyy * eyy + exy * exy)


@njit(cache=True, error_model="numpy")
@no_type_check
def _measure_one(image, weights, x, y, radius, noise, offsets, numbers, samples, buffer, stack, out):
    """One dot; `out` as in `measure_dots`. Returns False where there is none."""
    height, width = image.shape[0], image.shape[1] // weights.shape[0]
    reach = 1.35 * radius + 1.2
    reach2 = reach * reach
    light, sums = np.empty(9), np.empty(9)
    for _ in range(3):
        x0, x1 = max(0, int(x - reach)), min(width, int(x + reach) + 2)
        y0, y1 = max(0, int(y - reach)), min(height, int(y + reach) + 2)
        if (
            x1 - x0 < 3
            or y1 - y0 < 3
            or not _light(image, weights, x, y, radius, noise, offsets, numbers, samples, light)
        ):
            return False
        share = buffer[: (y1 - y0) * (x1 - x0)].reshape(y1 - y0, x1 - x0)
        _share(image, weights, x, y, x0, y0, light, share)
        if light[8] == 0.0 and radius >= 3.0:
            _fill_holes(share, stack)
        if not _moments(share, x - x0, y - y0, reach2, sums):
            return False
        dx, dy = sums[1] / sums[0], sums[2] / sums[0]
        x, y = x + dx, y + dy
        if dx * dx + dy * dy < (0.04 * radius + 0.1) ** 2:
            break
    out[0], out[1] = x, y
    _uncertainty(sums, light, noise, reach2, out)
    total = sums[0]
    out[5], out[6] = total, light[3]
    out[7] = sums[3] / (2.0 * math.sqrt(math.pi * total))
    out[8] = 0.0
    margin = min(x, width - 1.0 - x, y, height - 1.0 - y) + 0.5
    if margin < 1.15 * radius:
        # what is missing of a disc of the expected size; its centroid lies that much too far inside
        lacking = min(max(1.0 - total / (math.pi * radius * radius), 0.0), 1.0)
        depth = min(max(1.15 - margin / radius, 0.0), 1.0)
        out[8] = max(lacking, 0.3 * depth)
        inflation = (0.85 * radius * out[8]) ** 2
        out[2] += inflation
        out[4] += inflation
    return True


@njit(cache=True, error_model="numpy")
@no_type_check
def measure_dots(image, weights, near, radius, noise, walk, out):
    """Rows of `out`: x, y, cxx, cxy, cyy, area, contrast, edge width, cut share; NaN without a dot."""
    samples = np.empty((8, 6 * SAMPLES), dtype=np.float32)
    offsets, numbers, planned = (
        np.empty((3, 2, 6 * SAMPLES), dtype=np.int32),
        np.zeros(3, dtype=np.int64),
        0.0,
    )
    largest = 1.0
    for i in range(radius.shape[0]):
        largest = max(largest, radius[i])
    side = 2 * int(1.35 * largest + 4.2) + 1
    stack = np.empty(side * side, dtype=np.int64)
    buffer = np.empty(side * side, dtype=np.float32)
    height, width = image.shape[0], image.shape[1] // weights.shape[0]
    for i in range(near.shape[0]):
        out[i] = np.nan
        x, y = near[i, 0], near[i, 1]
        if not (x >= -0.5 and y >= -0.5 and x <= width - 0.5 and y <= height - 0.5):
            continue
        if radius[i] != planned:
            planned = radius[i]
            numbers[0] = _choose_offsets(1.3 * planned + 1.0, 1.75 * planned + 1.5, offsets[0])
            numbers[1] = _choose_offsets(-1.0, max(0.5 * planned, 0.9) + 0.75, offsets[1])
            numbers[2] = _choose_offsets(-1.0, 1.4 * planned + 0.7, offsets[2])
        if walk > 0:
            x, y = _walk_to_dot(image, weights, x, y, radius[i], walk, offsets[2], numbers[2], samples)
        if not _measure_one(
            image, weights, x, y, radius[i], noise, offsets, numbers, samples, buffer, stack, out[i]
        ):
            out[i] = np.nan
