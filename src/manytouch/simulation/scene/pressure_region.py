"""Region and second moments of a pressure that is known point by point, and faces that press evenly.

The region is the smallest set that carries 95 % of the normal force after smoothing by a Gaussian whose
standard deviation is half a pitch, all in undeformed coordinates.
"""

from typing import assert_never

import numpy as np
from jaxtyping import Float64
from scipy.ndimage import gaussian_filter

from manytouch.simulation.fem.contact.indenters import (
    ConvexBody,
    Fingertip,
    Indenter,
    LyingCylinder,
    Ring,
    RoundPunch,
    Sphere,
    SquarePunch,
)
from manytouch.values.arrays import Points2, Scalars

LEVEL_RAD = 1e-3
"""A flat face that is tilted by less than this is level."""
SHARE = 0.95
SMOOTHING_PITCHES = 0.5
CELLS_PER_STD = 6.0
REACH_STDS = 4.0


def region_area(place_mm: Points2, force_N: Scalars, pitch_mm: float) -> float:
    """Area in mm2 of the region of forces (n,) at places (n, 2); NaN without force."""
    pressing = force_N > 0.0
    if not pressing.any():
        return float("nan")
    place_mm, force_N = place_mm[pressing], force_N[pressing]
    std_mm = SMOOTHING_PITCHES * pitch_mm
    cell_mm = std_mm / CELLS_PER_STD
    start_mm = place_mm.min(axis=0) - REACH_STDS * std_mm
    counts = np.ceil((np.ptp(place_mm, axis=0) + 2.0 * REACH_STDS * std_mm) / cell_mm).astype(np.int64)
    cell = (place_mm - start_mm) / cell_mm - 0.5
    density = np.zeros(counts + 1)
    first = np.floor(cell).astype(np.int64)
    share = cell - first
    for i in (0, 1):
        for j in (0, 1):
            weight = np.abs(1 - i - share[:, 0]) * np.abs(1 - j - share[:, 1])
            np.add.at(density, (first[:, 0] + i, first[:, 1] + j), weight * force_N)
    falling = np.sort(gaussian_filter(density, CELLS_PER_STD, truncate=REACH_STDS).ravel())[::-1]
    carried = np.cumsum(falling)
    return float((np.searchsorted(carried, SHARE * carried[-1]) + 1) * cell_mm**2)


def second_moments(place_mm: Points2, force_N: Scalars) -> tuple[float, float, float]:
    """Second moments xx, yy, xy in mm2 of forces (n,) at places (n, 2) about their centroid; NaN without."""
    total_N = float(force_N.sum())
    if not total_N > 0.0:
        return float("nan"), float("nan"), float("nan")
    off_mm = place_mm - force_N @ place_mm / total_N
    moments: Float64[np.ndarray, "2 2"] = (off_mm * force_N[:, None]).T @ off_mm / total_N
    return float(moments[0, 0]), float(moments[1, 1]), float(moments[0, 1])


def level_face_mm2(indenter: Indenter, rotation_vector: np.ndarray) -> float | None:
    """Area of a flat face that is level; None of other bodies."""
    if np.abs(rotation_vector[:2]).max() >= LEVEL_RAD:
        return None
    match indenter:
        case RoundPunch(radius_mm=radius_mm):
            return float(np.pi * radius_mm**2)
        case SquarePunch(side_mm=side_mm):
            return float(np.prod(side_mm))
        case Sphere() | Fingertip() | LyingCylinder() | ConvexBody() | Ring():
            return None
    assert_never(indenter)
