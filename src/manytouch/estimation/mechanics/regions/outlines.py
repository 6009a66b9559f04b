"""Region and outline of a pressure: the smallest set that carries 95 % of the force after smoothing.

The smoothing is a Gaussian with a standard deviation of half a pitch. A pressure is given by points with
equal forces, so that its smoothed density is a sum of Gaussians.
"""

import numpy as np
from jaxtyping import Float64
from scipy.ndimage import map_coordinates

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
    along_x, along_y = (
        _bells(np.linspace(-reach_mm[axis], reach_mm[axis], _GRID), point_mm[:, axis], std_mm)
        for axis in (0, 1)
    )
    density = along_x @ along_y.T
    falling = np.sort(density.ravel())[::-1]
    carried = np.cumsum(falling)
    threshold = float(falling[np.searchsorted(carried, SHARE * carried[-1])])
    outer = _crossings(density, reach_mm, threshold)
    area_mm2 = polygon_area(outer)
    if density[_GRID // 2, _GRID // 2] >= threshold:
        return area_mm2, (outer,)
    inner = _crossings(density, reach_mm, threshold, is_inner=True)
    return area_mm2 - polygon_area(inner), (outer, inner[::-1].copy())


def _bells(place_mm: np.ndarray, centre_mm: np.ndarray, std_mm: float) -> Float64[np.ndarray, "g k"]:
    return np.asarray(np.exp(-0.5 * ((place_mm[:, None] - centre_mm) / std_mm) ** 2))


def _crossings(
    density: Float64[np.ndarray, "g g"],
    reach_mm: Float64[np.ndarray, "2"],
    threshold: float,
    *,
    is_inner: bool = False,
) -> Float64[np.ndarray, "_ 2"]:
    """Where rays from the middle of a grid last (or first) cross a threshold of its density, (k, 2)."""
    angle = 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    end_mm = 1.0 / (np.abs(direction) / reach_mm).max(axis=1)  # at the border of the grid
    radius_mm = np.linspace(0.0, 1.0, _RADII)[:, None] * end_mm
    place = (radius_mm[:, :, None] * direction / reach_mm + 1.0) * (0.5 * (_GRID - 1))
    sampled = map_coordinates(density, np.moveaxis(place, 2, 0), order=1, mode="nearest")
    above = sampled >= threshold
    if is_inner:
        after = np.maximum(above.argmax(axis=0), 1)
        before = after - 1
    else:
        before = np.minimum(_RADII - 1 - above[::-1].argmax(axis=0), _RADII - 2)
        after = before + 1
    ray = np.arange(_ANGLES)
    low, high = sampled[before, ray], sampled[after, ray]
    share = np.clip((threshold - low) / np.where(high == low, 1.0, high - low), 0.0, 1.0)
    crossing_mm = radius_mm[before, ray] + share * (radius_mm[after, ray] - radius_mm[before, ray])
    return np.asarray(crossing_mm[:, None] * direction)


def polygon_area(corner_mm: Points2) -> float:
    """Area of a polygon (k, 2), positive if it runs from x to y."""
    x, y = corner_mm.T
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
