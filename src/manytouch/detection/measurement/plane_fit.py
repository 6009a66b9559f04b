"""Robust planes, steps and centroids of samples, compiled; the loops run in SIMD lanes."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32

from manytouch.compilation import REORDER, f32, f64, inlined_kernel, kernel, no_type_check, u64
from manytouch.detection.measurement.records import NO_STEP, Plane, Samples, Step

FEWEST = 6.0  # samples of a plane with a slope
ROUNDNESS = 0.0125  # determinant over squared trace of the second moments, below which a slope is not known
EVERYTHING = 1e9  # grey levels: a margin that leaves no sample out
ROUGH = 2.0  # times the variance of a pixel, which the residuals of a background with a step exceed
LOW_STEP = 0.1  # of the contrast of a dot: lower steps hardly move its centre
ONE_SIDED = 0.35  # least distance of the mean of the squared residuals over that of all pixels from the dot
UNEVEN = 0.25  # of the variance of all pixels of the ring: those before a step have less
UNUSUAL = 3.0  # deviations of the background before a step, which pixels beyond it differ by
FEWEST_UNUSUAL, LEAST_SHARE = 4.0, 0.1  # of these pixels, and of all pixels of the ring
MOST_OTHERS = 0.25  # share of the pixels beyond a step that may look like the background before it
HIGH = 8.0
"""Deviations of the background before a step, which the mean height of the step exceeds.

Smooth shading, a quadratic, has 5 to 7 around dots from 3 px on (docs/decisions/0159-steps-of-brightness.md).
"""
BLUR = 1.0  # px before the nearest pixel that is recognised to be beyond a step: its blurred edge reaches it
CLEAR = 0.5  # px beyond the edge of a dot, which no step is nearer than
FAR_AWAY = 1e6  # px


@inlined_kernel(fastmath=REORDER)
@no_type_check
def fit_plane(samples: Samples, number: int, start: Plane, margin: float) -> Plane:
    """Least-squares plane of the first `number` samples that are within `margin` of the plane `start`."""
    a, b, c, limit = f32(start.a), f32(start.b), f32(start.c), f32(margin)
    s1 = sx = sy = sxx = sxy = syy = sv = svx = svy = svv = f32(0.0)
    for i in range(u64(number)):
        dx, dy = samples.dx[i], samples.dy[i]
        residual = samples.value[i] - (a + b * dx + c * dy)
        weight = samples.used[i] if abs(residual) <= limit else f32(0.0)
        x, y, v = weight * dx, weight * dy, weight * residual
        s1 += weight
        sx += x
        sy += y
        sxx += x * dx
        sxy += x * dy
        syy += y * dy
        sv += v
        svx += v * dx
        svy += v * dy
        svv += v * residual
    if s1 < f32(1.0):
        return Plane(start.a, start.b, start.c, 0.0, 0.0, 0.0)
    each = f32(1.0) / s1
    mx, my, mv = sx * each, sy * each, sv * each
    cxx, cxy, cyy = sxx - sx * mx, sxy - sx * my, syy - sy * my
    cxv, cyv = svx - sx * mv, svy - sy * mv
    determinant, spread = cxx * cyy - cxy * cxy, cxx + cyy
    db = dc = f32(0.0)
    if s1 >= f32(FEWEST) and determinant > f32(ROUNDNESS) * spread * spread:
        each = f32(1.0) / determinant
        db, dc = (cyy * cxv - cxy * cyv) * each, (cxx * cyv - cxy * cxv) * each
    variance = f32(0.0)
    if s1 > f32(FEWEST):
        variance = max(svv - sv * mv - db * cxv - dc * cyv, f32(0.0)) / (s1 - f32(3.0))
    # in double precision from here on
    level = start.a + mv - db * mx - dc * my
    return Plane(level, start.b + db, start.c + dc, f64(s1), f64(variance), f64(spread))


@inlined_kernel(fastmath=REORDER)
@no_type_check
def centroid_above(samples: Samples, number: int, threshold: float) -> tuple[float, float]:
    """Centroid of the first `number` samples, weighted by their level above a threshold.

    0 if none is above.
    """
    total = sum_x = sum_y = f32(0.0)
    for i in range(u64(number)):
        weight = samples.value[i] - threshold
        weight = weight if weight > f32(0.0) else f32(0.0)
        weight *= samples.used[i]
        total += weight
        sum_x += weight * samples.dx[i]
        sum_y += weight * samples.dy[i]
    if total <= f32(0.0):
        return 0.0, 0.0
    return f64(sum_x / total), f64(sum_y / total)


@inlined_kernel(fastmath=REORDER)
@no_type_check
def _side_of_residuals(samples: Samples, number: int, plane: Plane) -> tuple[float, float, float]:
    """Direction in which the squared residuals of a plane are, and how much so: 1 if all are at one place."""
    a, b, c = f32(plane.a), f32(plane.b), f32(plane.c)
    total = sx = sy = spread = f32(0.0)
    for i in range(u64(number)):
        dx, dy = samples.dx[i], samples.dy[i]
        residual = samples.value[i] - (a + b * dx + c * dy)
        square = samples.used[i] * residual * residual
        total += square
        sx += square * dx
        sy += square * dy
        spread += square * (dx * dx + dy * dy)
    length = math.hypot(f64(sx), f64(sy)) + 1e-9
    return f64(sx) / length, f64(sy) / length, length / (math.sqrt(f64(total) * f64(spread)) + 1e-9)


@inlined_kernel(fastmath=REORDER)
@no_type_check
def use_before(samples: Samples, number: int, step: Step, used: Float32[np.ndarray, " n"]) -> None:
    """Writes which samples are used and not beyond a step; `used` may be that of the samples."""
    x, y, limit = f32(step.x), f32(step.y), f32(step.limit)
    for i in range(u64(number)):
        is_before = samples.dx[i] * x + samples.dy[i] * y <= limit
        used[i] = samples.used[i] if is_before else f32(0.0)


class _Beyond(NamedTuple):
    """Samples beyond a line.

    Attributes:
        number: of them.
        unusual: how many of them differ from the background.
        x, y: sums of the offsets of these.
        nearest: least distance of these along the normal of the line, px.
        excess: sum of how far these are above or below the plane, grey levels.
    """

    number: float
    unusual: float
    x: float
    y: float
    nearest: float
    excess: float


@kernel()
@no_type_check
def _look_beyond(samples: Samples, number: int, plane: Plane, line: Step, margin: float) -> _Beyond:
    """Samples beyond a line; unusual ones are more than a margin above the plane, or below if it is < 0."""
    total = count = sx = sy = excess = 0.0
    nearest, sign = FAR_AWAY, 1.0 if margin > 0.0 else -1.0
    for i in range(u64(number)):
        dx, dy = f64(samples.dx[i]), f64(samples.dy[i])
        away = dx * line.x + dy * line.y
        if samples.used[i] > f32(0.0) and away > line.limit:
            total += 1.0
            residual = f64(samples.value[i]) - (plane.a + plane.b * dx + plane.c * dy)
            if sign * residual > sign * margin:
                count += 1.0
                sx += dx
                sy += dy
                excess += sign * residual
                nearest = min(nearest, away)
    return _Beyond(total, count, sx, sy, nearest, excess)


@kernel()
@no_type_check
def find_step(
    samples: Samples, number: int, plane: Plane, radius: float, contrast: float, noise: float,
    used: Float32[np.ndarray, " n"],
) -> Step:  # fmt: skip
    """Finds a straight step of brightness that crosses the ring around a dot, as at the edge of a pad.

    A plane is fitted to the pixels before a line next to the dot, on the side where the residuals are; the
    pixels beyond it that differ from this plane are the other side of the step, three times.

    Args:
        samples: of the ring.
        number: of samples.
        plane: of all of them.
        radius, contrast: of the dot, px and grey levels.
        noise: deviation of a pixel, grey levels.
        used: (n,) memory.
    """
    if plane.variance <= ROUGH * noise * noise:
        return NO_STEP
    before, least = (
        Samples(samples.dx, samples.dy, samples.value, used),
        max(LOW_STEP * contrast, 2.5 * noise),
    )
    x, y, share = _side_of_residuals(samples, number, plane)
    if share < ONE_SIDED:
        return NO_STEP
    clear, nearest, margin = radius + CLEAR, 0.0, 0.0
    most, fewest = UNEVEN * plane.variance, max(LEAST_SHARE * plane.number, FEWEST_UNUSUAL)
    step = line = Step(x, y, clear)
    for _ in range(3):
        line = Step(step.x, step.y, clear)
        use_before(samples, number, step, used)
        plane = fit_plane(before, number, plane, EVERYTHING)
        if plane.variance > most:
            return NO_STEP
        margin = max(UNUSUAL * math.sqrt(plane.variance), least)
        found = _look_beyond(samples, number, plane, line, margin)
        below = _look_beyond(samples, number, plane, line, -margin)
        if below.unusual > found.unusual:
            found, margin = below, -margin
        length = math.hypot(found.x, found.y)
        if found.unusual < fewest or length < 1e-3:
            return NO_STEP
        nearest = found.nearest
        step = Step(found.x / length, found.y / length, max(nearest - BLUR, clear))
    # blur aside, all pixels beyond a straight step are beyond it; those of another dot end at its sides
    beyond = _look_beyond(samples, number, plane, Step(line.x, line.y, nearest + 0.5), margin)
    is_high = beyond.excess > HIGH * math.sqrt(plane.variance) * beyond.unusual
    is_straight = beyond.unusual >= (1.0 - MOST_OTHERS) * beyond.number
    return step if is_high and is_straight else NO_STEP
