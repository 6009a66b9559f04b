"""Gap between markers on a bent sheet: equation 1 of the paper, derived.

Two neighbouring markers of radius r and height h stand on a sheet whose slope is θ under the first one
and θ + Δθ under the second. With the tangent t = (cos θ, sin θ) and the normal n = (-sin θ, cos θ), the
near edge of the first tip lies at h n + r t from its foot, that of the second at h n' - r t'. Their
distance along the undeformed sheet, as the camera sees it, is

    S = d cos(θ + Δθ) + h sin θ - r cos θ - h sin(θ + Δθ) - r cos(θ + Δθ)

The paper prints h cos(θ + Δθ) in the fourth term, which is not 0 for a flat sheet. The distance of the
feet is d cos(θ + Δθ), as in the paper: a lower bound where the slope increases.
"""

import math


def gap_mm(
    *, pitch_mm: float, radius_mm: float, height_mm: float, slope_rad: float, turn_rad: float
) -> float:
    """Gap between the tips of two neighbouring markers, seen along the optical axis (equation 1).

    Args:
        pitch_mm: d, their distance on the undeformed sheet.
        radius_mm, height_mm: r and h of the markers.
        slope_rad: θ, slope of the sheet under the first one.
        turn_rad: Δθ, increase of the slope from the first to the second; positive where the tips lean
            together.
    """
    steeper = slope_rad + turn_rad
    return (
        (pitch_mm - radius_mm) * math.cos(steeper)
        - radius_mm * math.cos(slope_rad)
        + height_mm * (math.sin(slope_rad) - math.sin(steeper))
    )


def smallest_pitch_mm(
    *, gap_mm: float, radius_mm: float, height_mm: float, slope_rad: float, turn_rad: float
) -> float:
    """The pitch at which the gap has a given size: equation 1, solved for d."""
    steeper = slope_rad + turn_rad
    radii = radius_mm * (math.cos(slope_rad) + math.cos(steeper))
    leaning = height_mm * (math.sin(steeper) - math.sin(slope_rad))
    return (gap_mm + radii + leaning) / math.cos(steeper)


def largest_radius_mm(
    *, pitch_mm: float, gap_mm: float, height_mm: float, slope_rad: float, turn_rad: float
) -> float:
    """The radius at which the gap has a given size: equation 1, solved for r; at least 0."""
    steeper = slope_rad + turn_rad
    leaning = height_mm * (math.sin(steeper) - math.sin(slope_rad))
    radii = math.cos(slope_rad) + math.cos(steeper)
    return max((pitch_mm * math.cos(steeper) - leaning - gap_mm) / radii, 0.0)


def largest_height_mm(
    *, pitch_mm: float, radius_mm: float, gap_mm: float, slope_rad: float, turn_rad: float
) -> float:
    """The height at which the gap has a given size: equation 1, solved for h; infinite if tips lean apart."""
    steeper = slope_rad + turn_rad
    leaning = math.sin(steeper) - math.sin(slope_rad)
    if leaning <= 0:
        return math.inf
    room = (pitch_mm - radius_mm) * math.cos(steeper) - radius_mm * math.cos(slope_rad) - gap_mm
    return max(room / leaning, 0.0)
