"""The loops over the pixels of each dot, compiled; see `centroid` for what they mean."""

import math

import numpy as np
from numba import njit

LOW, HIGH = 0.15, 0.85  # soft threshold on the share of dot in a pixel
GAIN = 1.0 / (HIGH - LOW)
SAMPLES = 96  # of ring and core, for their medians


@njit(cache=True, inline="always", error_model="numpy")
def _grey(image, weights, y, x):  # type: ignore[no-untyped-def]
    value = np.float32(image[y, x, 0]) * weights[0]
    for channel in range(1, image.shape[2]):
        value += np.float32(image[y, x, channel]) * weights[channel]
    return value


@njit(cache=True, error_model="numpy")
def _walk_to_dot(image, weights, x, y, radius, steps):  # type: ignore[no-untyped-def]
    """A few mean-shift steps on every stride-th pixel; returns x, y."""
    height, width = image.shape[:2]
    stride = max(1, int(radius / 3.0))
    for _ in range(steps):
        reach = 1.6 * radius + 1.0
        x0, x1 = max(0, int(x - reach)), min(width - 1, int(x + reach) + 1)
        y0, y1 = max(0, int(y - reach)), min(height - 1, int(y + reach) + 1)
        low, high = np.float32(1e9), np.float32(-1e9)
        for v in range(y0, y1 + 1, stride):
            for u in range(x0, x1 + 1, stride):
                value = _grey(image, weights, v, u)
                low, high = min(low, value), max(high, value)
        middle = 0.5 * (low + high)
        total = sum_x = sum_y = 0.0
        reach2 = (1.35 * radius + 0.7) ** 2
        for v in range(y0, y1 + 1, stride):
            for u in range(x0, x1 + 1, stride):
                dx, dy = u - x, v - y
                if dx * dx + dy * dy <= reach2:
                    weight = _grey(image, weights, v, u) - middle
                    if weight > 0.0:
                        total += weight
                        sum_x += weight * dx
                        sum_y += weight * dy
        if total <= 0.0:
            break
        dx, dy = sum_x / total, sum_y / total
        x, y = x + dx, y + dy
        if dx * dx + dy * dy < 0.01 * radius * radius:
            break
    return x, y


@njit(cache=True, error_model="numpy")
def _sampled_quantile(window, x, y, inner2, outer2, quantile, scratch):  # type: ignore[no-untyped-def]
    """Quantile of some of the pixels between two radii around (x, y); NaN where there are none."""
    height, width = window.shape
    y0, y1 = max(0, int(y - math.sqrt(outer2))), min(height - 1, int(y + math.sqrt(outer2)) + 1)
    area = math.pi * (outer2 - inner2)
    stride = max(1, int(math.sqrt(area / SAMPLES) + 0.5))
    count = 0
    for v in range(y0, y1 + 1, stride):
        dy2 = (v - y) ** 2
        if dy2 > outer2:
            continue
        half = math.sqrt(outer2 - dy2)
        for u in range(max(0, int(x - half + 1)), min(width - 1, int(x + half)) + 1, stride):
            if dy2 + (u - x) ** 2 >= inner2 and count < scratch.shape[0]:
                scratch[count] = window[v, u]
                count += 1
    if count == 0:
        return np.float32(np.nan)
    chosen = np.sort(scratch[:count])
    return chosen[min(count - 1, int(quantile * count))]


@njit(cache=True, error_model="numpy")
def _plane(window, x, y, inner2, outer2, a, b, c, margin):  # type: ignore[no-untyped-def]
    """Least-squares plane a + b dx + c dy of the pixels within `margin` of a given plane.

    Returns a, b, c, number of pixels, share of pixels used, variance of the rest, sum of dx^2 + dy^2.
    """
    height, width = window.shape
    outer = math.sqrt(outer2)
    s1 = sx = sy = sxx = sxy = syy = sv = svx = svy = svv = 0.0
    total = 0
    for v in range(max(0, int(y - outer)), min(height - 1, int(y + outer) + 1) + 1):
        dy = v - y
        if dy * dy > outer2:
            continue
        half = math.sqrt(outer2 - dy * dy)
        for u in range(max(0, int(x - half + 1)), min(width - 1, int(x + half)) + 1):
            dx = u - x
            if dx * dx + dy * dy < inner2:
                continue
            total += 1
            rest = window[v, u] - (a + b * dx + c * dy)
            if abs(rest) <= margin:
                s1 += 1.0
                sx += dx
                sy += dy
                sxx += dx * dx
                sxy += dx * dy
                syy += dy * dy
                sv += rest
                svx += rest * dx
                svy += rest * dy
                svv += rest * rest
    if s1 < 1.0:
        return a, b, c, 0.0, 0.0, 0.0, 0.0
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
    return a + mv - db * mx - dc * my, b + db, c + dc, s1, s1 / total, variance, cxx + cyy


@njit(cache=True, error_model="numpy")
def _fill_holes(share, stack):  # type: ignore[no-untyped-def]
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
def _tail(z):  # type: ignore[no-untyped-def]
    """E[max(n - z, 0)^2] of a standard normal n: noise that passes the soft threshold."""
    if z > 6.0:
        return 0.0
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return (1.0 + z * z) * 0.5 * math.erfc(z / math.sqrt(2.0)) - z * density


@njit(cache=True, error_model="numpy")
def _flattened(window, x, y, radius, scratch, share):  # type: ignore[no-untyped-def]
    """Share of dot in each pixel of the window.

    Returns contrast at the centre, variance of the ground, and the spreads (sum of dx^2 + dy^2) of
    the pixels that made the ground's and the core's plane; contrast <= 0 where there is no dot.
    """
    ring_in2, ring_out2 = (1.3 * radius + 1.0) ** 2, (1.75 * radius + 1.5) ** 2
    core2 = max(0.6 * radius, 0.9) ** 2
    ground = _sampled_quantile(window, x, y, ring_in2, ring_out2, 0.4, scratch)
    level = _sampled_quantile(window, x, y, -1.0, core2, 0.6, scratch)
    contrast = level - ground
    if not contrast > 0.0:
        return 0.0, 0.0, 0.0, 0.0
    ga, gb, gc, _, _, _, _ = _plane(window, x, y, ring_in2, ring_out2, ground, 0.0, 0.0, 0.4 * contrast)
    ga, gb, gc, _, _, ground_variance, ground_spread = _plane(
        window, x, y, ring_in2, ring_out2, ga, gb, gc, 0.3 * contrast
    )
    ka, kb, kc, spread = level, 0.0, 0.0, 0.0
    if radius >= 3.0:
        pa, pb, pc, count, used, _, core_spread = _plane(
            window, x, y, -1.0, core2, level, 0.0, 0.0, 0.25 * contrast
        )
        steepness = math.hypot(pb - gb, pc - gc) * radius
        if count >= 9.0 and used > 0.7 and steepness < 0.4 * (pa - ga):
            ka, kb, kc, spread = pa, pb, pc, core_spread
    amplitude = ka - ga
    if not amplitude > 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if spread == 0.0:
        kb, kc = gb, gc
    for v in range(window.shape[0]):
        dy = v - y
        for u in range(window.shape[1]):
            dx = u - x
            below = ga + gb * dx + gc * dy
            height = (ka + kb * dx + kc * dy) - below
            share[v, u] = (window[v, u] - below) / max(height, 0.5 * amplitude)
    return amplitude, ground_variance, ground_spread, spread


@njit(cache=True, error_model="numpy")
def _centre(share, x, y, reach2):  # type: ignore[no-untyped-def]
    """Centroid of the soft threshold around (x, y): weight, x, y."""
    total = sum_x = sum_y = 0.0
    reach = math.sqrt(reach2)
    for v in range(max(0, int(y - reach)), min(share.shape[0] - 1, int(y + reach) + 1) + 1):
        dy = v - y
        if dy * dy > reach2:
            continue
        half = math.sqrt(reach2 - dy * dy)
        for u in range(max(0, int(x - half + 1)), min(share.shape[1] - 1, int(x + half)) + 1):
            weight = min(max((share[v, u] - LOW) * GAIN, 0.0), 1.0)
            total += weight
            sum_x += weight * u
            sum_y += weight * v
    if total <= 0.0:
        return 0.0, x, y
    return total, sum_x / total, sum_y / total


@njit(cache=True, error_model="numpy")
def _edge(share, x, y, reach2):  # type: ignore[no-untyped-def]
    """Second moments of the edge's pixels, their number, and dx^2 + dy^2 of all other pixels."""
    exx = exy = eyy = count = rest = 0.0
    reach = math.sqrt(reach2)
    for v in range(max(0, int(y - reach)), min(share.shape[0] - 1, int(y + reach) + 1) + 1):
        dy = v - y
        for u in range(max(0, int(x - reach)), min(share.shape[1] - 1, int(x + reach) + 1) + 1):
            dx = u - x
            if dx * dx + dy * dy > reach2:
                continue
            if LOW < share[v, u] < HIGH:
                exx += dx * dx
                exy += dx * dy
                eyy += dy * dy
                count += 1.0
            else:
                rest += dx * dx + dy * dy
    return exx, exy, eyy, count, rest


@njit(cache=True, error_model="numpy")
def _measure_one(image, weights, x, y, radius, noise, scratch, stack, out):  # type: ignore[no-untyped-def]
    """One dot; `out` as in `measure_dots`. Returns False where there is none."""
    height, width = image.shape[:2]
    half = int(1.75 * radius + 3.0)
    x0, x1 = max(0, int(x + 0.5) - half), min(width, int(x + 0.5) + half + 1)
    y0, y1 = max(0, int(y + 0.5) - half), min(height, int(y + 0.5) + half + 1)
    if x1 - x0 < 3 or y1 - y0 < 3:
        return False
    window = np.empty((y1 - y0, x1 - x0), dtype=np.float32)
    for v in range(y0, y1):
        for u in range(x0, x1):
            window[v - y0, u - x0] = _grey(image, weights, v, u)
    share = np.empty_like(window)
    wx, wy = x - x0, y - y0
    reach2 = (1.35 * radius + 1.2) ** 2
    amplitude = total = variance = ground_spread = core_spread = 0.0
    for _ in range(3):
        amplitude, variance, ground_spread, core_spread = _flattened(window, wx, wy, radius, scratch, share)
        if amplitude <= 0.0:
            return False
        if core_spread == 0.0 and radius >= 3.0:
            _fill_holes(share, stack)
        total, nx, ny = _centre(share, wx, wy, reach2)
        if total <= 0.0:
            return False
        shift2 = (nx - wx) ** 2 + (ny - wy) ** 2
        wx, wy = nx, ny
        if shift2 < (0.02 * radius + 0.05) ** 2:
            break
    total, wx, wy = _centre(share, wx, wy, reach2)
    if total <= 0.0:
        return False
    exx, exy, eyy, count, rest = _edge(share, wx, wy, reach2)
    noise2 = max(noise * noise, variance)
    scale = GAIN / (amplitude * total)
    passed = 0.5 * rest * _tail(LOW * amplitude / math.sqrt(noise2))
    slopes = (2.0 / ground_spread if ground_spread > 0.0 else 0.0) + (
        2.0 / core_spread if core_spread > 0.0 else 0.0
    )
    direct, tilt = noise2 * scale * scale, 0.25 * noise2 * scale * scale * slopes
    out[0], out[1] = wx + x0, wy + y0
    out[2] = direct * (exx + passed) + tilt * (exx * exx + exy * exy)
    out[3] = direct * exy + tilt * exy * (exx + eyy)
    out[4] = direct * (eyy + passed) + tilt * (eyy * eyy + exy * exy)
    out[5], out[6] = total, amplitude
    own = math.sqrt(total / math.pi)
    out[7] = count / (2.0 * math.pi * own)
    out[8] = 0.0
    margin = min(min(out[0], width - 1.0 - out[0]), min(out[1], height - 1.0 - out[1])) + 0.5
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
def measure_dots(image, weights, near, radius, noise, walk, out):  # type: ignore[no-untyped-def]
    """Rows of `out`: x, y, cxx, cxy, cyy, area, contrast, edge width, cut share; NaN without a dot."""
    scratch = np.empty(4 * SAMPLES, dtype=np.float32)
    largest = 1.0
    for i in range(radius.shape[0]):
        largest = max(largest, radius[i])
    side = 2 * int(1.75 * largest + 3.0) + 1
    stack = np.empty(side * side, dtype=np.int64)
    for i in range(near.shape[0]):
        out[i] = np.nan
        x, y = near[i, 0], near[i, 1]
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        if x < -0.5 or y < -0.5 or x > image.shape[1] - 0.5 or y > image.shape[0] - 0.5:
            continue
        if walk > 0:
            x, y = _walk_to_dot(image, weights, x, y, radius[i], walk)
        if not _measure_one(image, weights, x, y, radius[i], noise, scratch, stack, out[i]):
            out[i] = np.nan
