"""Plain dots in vector lanes, compiled: each loop runs over a fixed or padded number of pixels.

A `plan` says for one radius which pixels are looked at, in whole pixels from the middle one: 64 of the
ground around the dot, 64 of its core, 64 to walk by, and blocks of 16 or 32 in a row that cover dot and edge.
A dot that is not plain (with a glint or a hole, chipped, at the border) is left to `kernels`.
Images are flat (h * w * channels,).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from dataclasses import dataclass
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.light import FAST, PLANE_RADIUS
from manytouch.values.arrays import Scalars

LANES = 64  # of each sample
EVEN = 0.03  # of the contrast
NARROW, WIDE = 16, 32  # lengths of blocks
STEP = 1.03  # between the radii that have a plan of their own
GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
RING, CORE, WALK, BLOCKS = 0, 1, 2, 3
# rows of `sample`, LANES long, of ring, core and walk: where a pixel lies, its value, and 1 if it counts
DX, DY, VALUE, USED = np.uint64(0), np.uint64(LANES), np.uint64(2 * LANES), np.uint64(3 * LANES)
ROWS = 4 * LANES
ALL = np.uint64(LANES)  # unsigned numbers need no check for negative ones, so that loops run in lanes


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Plans:
    """Which pixels are looked at around dots of some radii.

    Attributes:
        index: (n,) row of the plan of each radius.
        place: (p, 2, k) x and y: ring, core, walk (64 each), then the blocks' first pixels.
        count: (p, 6) number in ring, core, walk and blocks (padded to whole sets of 64 pixels), the farthest
            place, and the blocks' length.
    """

    index: np.ndarray
    place: np.ndarray
    count: np.ndarray

    def at(self, chosen: np.ndarray) -> "Plans":
        """Those of some of the radii."""
        return Plans(index=self.index[chosen], place=self.place, count=self.count)


def plans_of(radius_px: Scalars) -> Plans:
    """Plans for some radii (n,); similar ones share a plan."""
    step = np.rint(np.log(np.maximum(radius_px, 0.3)) / np.log(STEP)).astype(np.int64)
    steps, index = np.unique(step, return_inverse=True)
    radii = STEP ** steps.astype(np.float64)
    most = 1 if len(radii) == 0 else _most_blocks(float(radii[-1]))
    place = np.zeros((len(radii), 2, 3 * LANES + most), dtype=np.int32)
    count = np.zeros((len(radii), 6), dtype=np.int32)
    for row, radius in enumerate(radii):
        _plan(radius, place[row], count[row])
    return Plans(index=index.astype(np.int32), place=place, count=count)


def _most_blocks(radius: float) -> int:
    side = 2 * int(1.35 * radius + 2.2) + 1
    return side * (side // NARROW + 1) + LANES // NARROW


@njit(cache=True, error_model="numpy")
@no_type_check
def _spread(inner, outer, place, first):
    """Up to LANES different pixels, evenly spread between two radii, inner ones first. Returns how many."""
    count, tries = 0, 2 * LANES
    area = math.pi * (outer * outer - inner * inner)
    wanted = min(LANES, int(area) + 1)
    # twice as many places as lanes are tried, since some fall into the same pixel
    for trial in range(tries):
        if count >= wanted:
            break
        part = ((trial % LANES) + 0.5 * (1 + trial // LANES)) / LANES
        distance = math.sqrt(inner * inner + (outer * outer - inner * inner) * min(part, 1.0))
        u = math.floor(distance * math.cos(trial * GOLDEN) + 0.5)
        v = math.floor(distance * math.sin(trial * GOLDEN) + 0.5)
        is_new = True
        for k in range(count):
            if place[0, first + k] == u and place[1, first + k] == v:
                is_new = False
        if is_new:
            place[0, first + count], place[1, first + count] = u, v
            count += 1
    return count


@njit(cache=True, error_model="numpy")
@no_type_check
def _plan(radius, place, count):
    """One row of `plans_of`."""
    count[RING] = _spread(1.3 * radius + 1.0, 1.75 * radius + 1.5, place, RING * LANES)
    if radius >= PLANE_RADIUS:
        count[CORE] = _spread(0.0, max(0.5 * radius, min(0.65 * radius, radius - 2.75)), place, CORE * LANES)
    else:
        reach = max(0.5 * radius, 0.9) + 0.75
        number = 0
        for limit in range(int(reach * reach) + 1):
            for v in range(-int(reach), int(reach) + 1):
                for u in range(-int(reach), int(reach) + 1):
                    if u * u + v * v == limit and number < LANES:
                        place[0, CORE * LANES + number], place[1, CORE * LANES + number] = u, v
                        number += 1
        count[CORE] = number
    count[WALK] = _spread(0.0, 1.4 * radius + 0.7, place, WALK * LANES)
    reach = 1.35 * radius + 1.9
    number, first = 0, BLOCKS * LANES
    height = int(reach)
    length = WIDE if NARROW < 2 * height + 1 <= WIDE else NARROW
    for v in range(-height, height + 1):
        half = int(math.sqrt(reach * reach - v * v))
        for u in range(-half, half + 1, length):
            place[0, first + number], place[1, first + number] = u, v
            number += 1
    while number % (LANES // length) != 0:
        place[0, first + number], place[1, first + number] = 0, height + 1
        number += 1
    count[BLOCKS] = number
    count[4], count[5] = max(int(1.75 * radius + 2.5), height + 2), length


@njit(cache=True, error_model="numpy")
@no_type_check
def take_plan(radius, place, count, width, channels, offset, sample, pixel):
    """Offsets of a plan's pixels in the flat image, where they lie: `sample` and `pixel` = x, y, inside."""
    for part in range(3):
        for k in range(LANES):
            u, v = place[0, part * LANES + k], place[1, part * LANES + k]
            sample[part * ROWS + DX + k], sample[part * ROWS + DY + k] = u, v
            sample[part * ROWS + USED + k] = 1.0 if k < count[part] else 0.0
            offset[part * LANES + k] = (np.int64(v) * width + u) * channels
    reach = 1.35 * radius + 1.5
    for b in range(count[BLOCKS]):
        u, v = place[0, BLOCKS * LANES + b], place[1, BLOCKS * LANES + b]
        offset[BLOCKS * LANES + b] = (np.int64(v) * width + u) * channels
        for k in range(count[5]):
            i = b * count[5] + k
            pixel[0, i], pixel[1, i] = u + k, v
            pixel[2, i] = 1.0 if (u + k) ** 2 + v * v <= reach * reach else 0.0


@njit(cache=True, error_model="numpy", fastmath=FAST)
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
@no_type_check
def copy_blocks(flat, weights, base, offset, count, length, value):
    """Signed grey levels of blocks of pixels in a row."""
    if weights.shape[0] == 1:
        weight = weights[0]
        for b in range(np.uint64(count)):
            at, to = np.uint64(base + offset[np.uint64(BLOCKS * LANES) + b]), b * np.uint64(length)
            for k in range(np.uint64(length)):
                value[to + k] = np.float32(flat[at + k]) * weight
    else:
        blue, green, red = weights[0], weights[1], weights[2]
        three, one, two = np.uint64(3), np.uint64(1), np.uint64(2)
        for b in range(np.uint64(count)):
            at, to = np.uint64(base + offset[np.uint64(BLOCKS * LANES) + b]), b * np.uint64(length)
            for k in range(np.uint64(length)):
                i = at + three * k
                grey = np.float32(flat[i]) * blue + np.float32(flat[i + one]) * green
                value[to + k] = grey + np.float32(flat[i + two]) * red


@njit(cache=True, error_model="numpy", fastmath=FAST)
@no_type_check
def pull(sample):
    """Centroid of what is lighter than the middle of the extremes of the walk's pixels: x, y."""
    f, at = np.float32, np.uint64(WALK * ROWS)
    low, high = f(1e9), f(-1e9)
    for i in range(ALL):
        is_used, value = sample[at + USED + i] > f(0.0), sample[at + VALUE + i]
        under, over = value if is_used else f(1e9), value if is_used else f(-1e9)
        low = under if under < low else low
        high = over if over > high else high
    middle = f(0.5) * (low + high)
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _extent(sample, at):
    """Least, largest and mean value of the samples that count."""
    f = np.float32
    low, high, number, total = f(1e9), f(-1e9), f(0.0), f(0.0)
    for i in range(ALL):
        used, value = sample[at + USED + i], sample[at + VALUE + i]
        under, over = value if used > f(0.0) else f(1e9), value if used > f(0.0) else f(-1e9)
        low = under if under < low else low
        high = over if over > high else high
        number += used
        total += used * value
    return float(low), float(high), float(total / number)


@njit(cache=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _quantile(sample, at, quantile, halvings):
    """Mean of the samples that lie next to a quantile: within the range, halved so many times."""
    f = np.float32
    low, high, number = f(1e9), f(-1e9), f(0.0)
    for i in range(ALL):
        is_used, value = sample[at + USED + i] > f(0.0), sample[at + VALUE + i]
        under, over = value if is_used else f(1e9), value if is_used else f(-1e9)
        low = under if under < low else low
        high = over if over > high else high
        number += sample[at + USED + i]
    rank = f(min(int(number) - 1, int(quantile * number)))
    high += f(1.0)
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _number_low(sample, at, least):
    """How many of the used samples are darker than `least`?"""
    f = np.float32
    count, least = f(0.0), f(least)
    for i in range(ALL):
        count += sample[at + USED + i] if sample[at + VALUE + i] < least else f(0.0)
    return count


@njit(cache=True, error_model="numpy")
@no_type_check
def fit_light(sample, count, radius, part_x, part_y, noise, light):
    """`light` as `light.fit_light` gives it, about the middle pixel; the dot is at (part_x, part_y) from it.

    Returns 1; 0 where there is no dot; -1 where the dot is not plain.
    """
    ring, core = np.uint64(RING * ROWS), np.uint64(CORE * ROWS)
    low, high, ground = _extent(sample, ring)
    is_even = high - low < 8.0 * noise
    if not is_even:
        ground = _quantile(sample, ring, 0.4, 5)
    if radius < PLANE_RADIUS:
        if _keep_near(sample, core, part_x, part_y, max(0.5 * radius, 0.9), count[CORE]) < 1.0:
            return 0
        level, extent = _quantile(sample, core, 0.55, 8), 0.0
        contrast = level - ground
        if not contrast > 0.0:
            return 0
    else:
        low, high, level = _extent(sample, core)
        contrast, extent = level - ground, high - low
        if not contrast > 0.0:
            return -1
    margin = max(0.3 * contrast, 2.5 * noise)
    ga, gb, gc, _, variance, ground_spread = _plane(sample, ring, ground, 0.0, 0.0, margin)
    if not is_even:
        ga, gb, gc, _, variance, ground_spread = _plane(sample, ring, ga, gb, gc, margin)
    ka, kb, kc, core_spread = level, gb, gc, 0.0
    if radius >= PLANE_RADIUS:
        margin = max(0.2 * contrast, 3.0 * noise)
        if extent > margin:
            ka, kb, kc, _, _, _ = _plane(sample, core, level, 0.0, 0.0, 1e6)
        ka, kb, kc, used, _, core_spread = _plane(sample, core, ka, kb, kc, margin)
        if used < 0.9 * count[CORE] or abs(kb - gb) + abs(kc - gc) > 0.12 / radius * (ka - ga):
            return -1
        # light seldom changes by more than EVEN over a dot's radius: slopes that noise makes are shrunk
        expected = EVEN * (ka - ga) / radius
        share = core_spread * expected * expected
        share /= share + 2.0 * noise * noise
        kb, kc = gb + share * (kb - gb), gc + share * (kc - gc)
        core_spread /= share * share
    elif radius >= 3.0:
        _keep_near(sample, core, part_x, part_y, radius - 1.0, count[CORE])
        if _number_low(sample, core, ground + 0.7 * contrast) > 0.0:
            return -1
    light[0], light[1], light[2] = ga, gb, gc
    light[3], light[4], light[5] = ka - ga, kb - gb, kc - gc
    light[6], light[7], light[8] = variance, ground_spread, core_spread
    return 1 if ka > ga else 0


@njit(cache=True, error_model="numpy", fastmath=FAST)
@no_type_check
def moments(pixel, count, light, low, gain, sums):
    """As `kernels._moments`, about the middle pixel, with the share of dot computed on the way."""
    f = np.float32
    below, slope_x, slope_y = f(light[0]), f(light[1]), f(light[2])
    # w = gain (value - ground) / height - gain low; 1 / height as a series in the small slopes of the dot
    inverse, start = f(gain / light[3]), f(gain * low)
    rise_x, rise_y = f(light[4] / light[3]), f(light[5] / light[3])
    zero, one = f(0.0), f(1.0)
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = f(0.0)
    for i in range(np.uint64(count)):
        x, y = pixel[0, i], pixel[1, i]
        more = rise_x * x + rise_y * y
        brightness = inverse - inverse * more * (one - more)
        weight = (pixel[3, i] - (below + slope_x * x + slope_y * y)) * brightness - start
        weight = weight if weight > zero else zero
        weight = weight if weight < one else one
        weight *= pixel[2, i]
        edge = one if zero < weight < one else zero
        ex = edge * x
        ey = edge * y
        s0 += weight
        s1 += weight * x
        s2 += weight * y
        s3 += edge
        s4 += ex
        s5 += ey
        s6 += ex * x
        s7 += ex * y
        s8 += ey * y
    sums[0], sums[1], sums[2], sums[3], sums[4] = s0, s1, s2, s3, s4
    sums[5], sums[6], sums[7], sums[8] = s5, s6, s7, s8
    return s0 > zero
