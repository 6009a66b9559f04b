"""Region and outline of a pressure: the smallest set that carries 95 % of the force after smoothing.

The smoothing is a Gaussian with a standard deviation of half a pitch. A pressure is given by points with
equal forces, so that its smoothed density is a sum of Gaussians.
"""

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.values import ContactShape
from manytouch.values.arrays import Points2

SHARE = 0.95
"""Share of the force that a region carries."""

POINT_STDS = float(np.sqrt(-2.0 * np.log(1.0 - SHARE)))
"""Radius of the region of a point, in standard deviations of the smoothing."""

_GRID = 45
_ANGLES = 48
_RADII = 64
_REACH = 3.2  # of the grid beyond the points, in standard deviations
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
_COUNT = 160
_SUNFLOWER = np.sqrt((np.arange(_COUNT) + 0.5) / _COUNT)[:, None] * np.column_stack(
    [np.cos(_GOLDEN * np.arange(_COUNT)), np.sin(_GOLDEN * np.arange(_COUNT))]
)
_CIRCLE = np.column_stack([np.cos(2 * np.pi * np.arange(48) / 48), np.sin(2 * np.pi * np.arange(48) / 48)])
_SEGMENT = np.column_stack([(2.0 * np.arange(48) + 1.0) / 48 - 1.0, np.zeros(48)])


def shape_points(shape: ContactShape, half_axes_mm: Float64[np.ndarray, "2"]) -> Points2:
    """(k, 2) points of a pressure with these half axes (2,), in its own axes, around its centre.

    The half axes are those of the uniform ellipse with the same second moments.
    """
    match shape:
        case ContactShape.POINT:
            return np.zeros((1, 2))
        case (
            ContactShape.LINE
        ):  # a segment of half length L has the second moment L^2 / 3, an ellipse a^2 / 4
            return np.asarray(_SEGMENT * np.sqrt(0.75) * half_axes_mm[0])
        case ContactShape.PATCH:
            return np.asarray(_SUNFLOWER * half_axes_mm)
    return np.asarray(_CIRCLE * np.sqrt(0.5) * half_axes_mm)


def region_of(point_mm: Points2, std_mm: float) -> tuple[float, tuple[Float64[np.ndarray, "_ 2"], ...]]:
    """Area of the region of a pressure, and its outline around the origin, then that of its hole, if any.

    Args:
        point_mm: (k, 2) points with equal forces, around the origin; the region is star-shaped around it.
        std_mm: of the smoothing.
    """
    reach_mm = np.abs(point_mm).max(axis=0) + _REACH * std_mm
    along_x, along_y = _bells(point_mm, reach_mm, std_mm)
    density = along_x.T @ along_y
    falling = np.sort(density.ravel())[::-1]
    carried = np.cumsum(falling)
    threshold = float(falling[np.searchsorted(carried, SHARE * carried[-1])])
    outer = np.empty((_ANGLES, 2))
    _crossings(density, reach_mm, threshold, False, outer)
    area_mm2 = polygon_area(outer)
    if density[_GRID // 2, _GRID // 2] >= threshold:
        return area_mm2, (outer,)
    inner = np.empty((_ANGLES, 2))
    _crossings(density, reach_mm, threshold, True, inner)
    return area_mm2 - polygon_area(inner), (outer, inner[::-1].copy())


@kernel(fastmath=True)
@no_type_check
def _bells(
    point_mm: Points2, reach_mm: Float64[np.ndarray, "2"], std_mm: float
) -> Float64[np.ndarray, "2 k g"]:
    """(2, k, 45) Gaussians around points along both axes, without their factor.

    They are those at the places of a grid of half size `reach_mm`. The ratio of a Gaussian at adjacent places
    changes by one factor.
    """
    bells = np.empty((2, len(point_mm), _GRID))
    for axis in range(2):
        step = 2.0 * reach_mm[axis] / (_GRID - 1) / std_mm
        factor = np.exp(-step * step)
        for k in range(len(point_mm)):
            bell = bells[axis, k]
            nearest = int(np.floor((point_mm[k, axis] + reach_mm[axis]) / (step * std_mm) + 0.5))
            nearest = min(max(nearest, 0), _GRID - 1)
            away = (nearest * step * std_mm - reach_mm[axis] - point_mm[k, axis]) / std_mm
            bell[nearest] = np.exp(-0.5 * away * away)
            for side in (-1, 1):
                value, ratio = bell[nearest], np.exp(-step * (side * away + 0.5 * step))
                for g in range(nearest + side, -1 if side < 0 else _GRID, side):
                    value *= ratio
                    ratio *= factor
                    bell[g] = value
    return bells


@kernel()
@no_type_check
def _crossings(
    density: Float64[np.ndarray, "g g"],
    reach_mm: Float64[np.ndarray, "2"],
    threshold: float,
    is_inner: bool,
    crossing_mm: Float64[np.ndarray, "_ 2"],
) -> None:
    """Where rays from the middle of a grid last (or first) cross a threshold of its density.

    The density is interpolated linearly, at `_RADII` places of each ray.
    """
    half, last = 0.5 * (_GRID - 1), _RADII - 1
    for ray in range(_ANGLES):
        angle = 2.0 * np.pi * ray / _ANGLES
        x, y = np.cos(angle), np.sin(angle)
        end_mm = 1.0 / max(abs(x) / reach_mm[0], abs(y) / reach_mm[1])  # at the border of the grid
        step_x, step_y = half * end_mm * x / reach_mm[0] / last, half * end_mm * y / reach_mm[1] / last
        low = high = 0.0
        after = 0
        for number in range(_RADII):
            radius = number if is_inner else last - number
            across = min(max(half + radius * step_x, 0.0), _GRID - 1.0)
            along = min(max(half + radius * step_y, 0.0), _GRID - 1.0)
            i, j = min(int(across), _GRID - 2), min(int(along), _GRID - 2)
            u, v = across - i, along - j
            value = (1.0 - u) * ((1.0 - v) * density[i, j] + v * density[i, j + 1])
            value += u * ((1.0 - v) * density[i + 1, j] + v * density[i + 1, j + 1])
            if is_inner:
                low, high, after = high, value, radius
                if value >= threshold and radius > 0:
                    break
            else:
                low, high, after = value, low, radius + 1
                if value >= threshold and radius < last:
                    break
        share = 0.0 if high == low else min(max((threshold - low) / (high - low), 0.0), 1.0)
        radius_mm = (after - 1 + share) * end_mm / last
        crossing_mm[ray, 0], crossing_mm[ray, 1] = radius_mm * x, radius_mm * y


def polygon_area(corner_mm: Points2) -> float:
    """Area of a polygon (k, 2), positive if it runs from x to y."""
    x, y = corner_mm.T
    inner = x[:-1] @ y[1:] - x[1:] @ y[:-1]
    return 0.5 * float(inner + x[-1] * y[0] - x[0] * y[-1])


def within_rectangle(
    corner_mm: Float64[np.ndarray, "k 2"], low_mm: Float64[np.ndarray, "2"], high_mm: Float64[np.ndarray, "2"]
) -> Points2:
    """The part (n, 2) of a polygon (k, 2) in the rectangle between corners (2,) low and high; may be empty.

    One half-plane after the other (I. E. Sutherland, G. W. Hodgman 1974, doi:10.1145/360767.360802).
    """
    kept = corner_mm
    for axis in range(2):
        for sign, limit_mm in ((1.0, high_mm[axis]), (-1.0, -low_mm[axis])):
            beyond_mm = sign * kept[:, axis] - limit_mm
            points = []
            for number, point in enumerate(kept):
                before, own = beyond_mm[number - 1], beyond_mm[number]
                if (before > 0.0) != (own > 0.0):
                    points.append(kept[number - 1] + before / (before - own) * (point - kept[number - 1]))
                if own <= 0.0:
                    points.append(point)
            kept = np.array(points).reshape(-1, 2)
    return kept
