"""Robust planes and centroids of samples, compiled; the loops run in SIMD lanes."""

from manytouch.compilation import REORDER, f32, f64, inlined_kernel, no_type_check, u64
from manytouch.detection.measurement.records import Plane, Samples

FEWEST = 6.0  # samples of a plane with a slope
ROUNDNESS = 0.0125  # determinant over squared trace of the second moments, below which a slope is not known


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
