"""How near markers may stand: equation 1 of the paper, derived.

Two neighbouring markers of radius r and height h stand on a sheet whose slope is θ under the first one
and θ + Δθ under the second. With the tangent t = (cos θ, sin θ) and the normal n = (-sin θ, cos θ), the
near edge of the first tip lies at h n + r t from its foot, that of the second at h n' - r t'. Their
distance along the undeformed sheet, as the camera sees it, is

    S = d cos(θ + Δθ) + h sin θ - r cos θ - h sin(θ + Δθ) - r cos(θ + Δθ)

where the paper prints h cos(θ + Δθ) in the fourth term, which is not even 0 for a flat sheet. The
distance of the feet is taken as d cos(θ + Δθ), as the paper does: a lower bound where the sheet steepens.
"""

import math


def gap_mm(
    *, pitch_mm: float, radius_mm: float, height_mm: float, slope_rad: float, turn_rad: float
) -> float:
    """Free distance of the tips of two neighbouring markers, seen from straight below (equation 1).

    Args:
        pitch_mm: d, their distance on the undeformed sheet.
        radius_mm, height_mm: r and h of the markers.
        slope_rad: θ, slope of the sheet under the first one.
        turn_rad: Δθ, how much steeper it is under the second; positive where tips lean to each other.
    """
    steeper = slope_rad + turn_rad
    return (
        (pitch_mm - radius_mm) * math.cos(steeper)
        - radius_mm * math.cos(slope_rad)
        + height_mm * (math.sin(slope_rad) - math.sin(steeper))
    )


def least_pitch_mm(
    *, gap_mm: float, radius_mm: float, height_mm: float, slope_rad: float, turn_rad: float
) -> float:
    """The pitch that leaves a free distance between neighbouring tips: equation 1, solved for d."""
    steeper = slope_rad + turn_rad
    held = radius_mm * (math.cos(slope_rad) + math.cos(steeper))
    leaning = height_mm * (math.sin(steeper) - math.sin(slope_rad))
    return (gap_mm + held + leaning) / math.cos(steeper)


def most_radius_mm(
    *, pitch_mm: float, gap_mm: float, height_mm: float, slope_rad: float, turn_rad: float
) -> float:
    """The radius that leaves a free distance between neighbouring tips: equation 1, solved for r."""
    steeper = slope_rad + turn_rad
    leaning = height_mm * (math.sin(steeper) - math.sin(slope_rad))
    held = math.cos(slope_rad) + math.cos(steeper)
    return max((pitch_mm * math.cos(steeper) - leaning - gap_mm) / held, 0.0)


def most_height_mm(
    *, pitch_mm: float, radius_mm: float, gap_mm: float, slope_rad: float, turn_rad: float
) -> float:
    """The height at which tips come as near as a free distance; infinite where they lean apart."""
    steeper = slope_rad + turn_rad
    leaning = math.sin(steeper) - math.sin(slope_rad)
    if leaning <= 0:
        return math.inf
    room = (pitch_mm - radius_mm) * math.cos(steeper) - radius_mm * math.cos(slope_rad) - gap_mm
    return max(room / leaning, 0.0)
