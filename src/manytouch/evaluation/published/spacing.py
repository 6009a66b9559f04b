"""Figure 3 and equation 1: the free gap between the tips of neighbouring markers on the bent sheet.

Printed:  S = d cos(t + dt) + h sin t - r cos t - h cos(t + dt) - r cos(t + dt)
Corrected:   S = d cos(t + dt) + h sin t - r cos t - h sin(t + dt) - r cos(t + dt)

d foot to foot, r radius and h height of a marker, t the sheet's inclination under the first and t + dt
under the second. On a flat sheet the gap is d - 2 r, which the printed one misses by h.
"""

from dataclasses import dataclass

import numpy as np

from manytouch.simulation.fem.state import SheetState
from manytouch.values.arrays import Scalars

PITCH_MM, RADIUS_MM = 4.0, 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gaps:
    """The narrowest place of a row of markers through the middle of a press.

    Attributes:
        height_mm: how far the markers stand off the sheet.
        steepest_deg: largest inclination of the sheet under a marker.
        true_mm: the gap there on the solved sheet.
        corrected_mm, printed_mm: equation 1 there.
        off_mm: largest error of the corrected equation in the whole row.
    """

    height_mm: float
    steepest_deg: float
    true_mm: float
    corrected_mm: float
    printed_mm: float
    off_mm: float


def corrected_gap_mm(foot_mm: Scalars, height_mm: float, first: Scalars, second: Scalars) -> Scalars:
    """Equation 1 with its fourth term put right; angles in rad."""
    tips = height_mm * (np.sin(first) - np.sin(second))
    return np.asarray(foot_mm * np.cos(second) + tips - RADIUS_MM * (np.cos(first) + np.cos(second)))


def printed_gap_mm(foot_mm: Scalars, height_mm: float, first: Scalars, second: Scalars) -> Scalars:
    """Equation 1 letter by letter."""
    tips = height_mm * (np.sin(first) - np.cos(second))
    return np.asarray(foot_mm * np.cos(second) + tips - RADIUS_MM * (np.cos(first) + np.cos(second)))


def gaps(state: SheetState, height_mm: float) -> Gaps:
    """The gaps of a row of markers along x through the middle of a solved sheet."""
    half = 0.5 * float(np.ptp(state.mesh.lines_mm[0])) - PITCH_MM
    x_mm = np.arange(-half, half + 1e-9, PITCH_MM)
    row_mm = np.column_stack([x_mm, np.zeros_like(x_mm)])
    moved_mm, gradient = state.camera_side(row_mm)
    # seen from below, where the markers hang: a flank that rises towards the camera along x is positive
    angle = np.arctan2(-gradient[:, 2, 0], gradient[:, 0, 0])
    foot_mm = row_mm + moved_mm[:, :2]
    tip_mm = foot_mm[:, 0] - height_mm * np.sin(angle)
    true_mm = np.diff(tip_mm) - RADIUS_MM * (np.cos(angle[:-1]) + np.cos(angle[1:]))
    along_mm = np.hypot(np.diff(foot_mm[:, 0]), np.diff(moved_mm[:, 2]))
    corrected = corrected_gap_mm(along_mm, height_mm, angle[:-1], angle[1:])
    printed = printed_gap_mm(along_mm, height_mm, angle[:-1], angle[1:])
    narrow = int(np.argmin(true_mm))
    return Gaps(
        height_mm=height_mm,
        steepest_deg=float(np.degrees(np.abs(angle).max())),
        true_mm=float(true_mm[narrow]),
        corrected_mm=float(corrected[narrow]),
        printed_mm=float(printed[narrow]),
        off_mm=float(np.abs(corrected - true_mm).max()),
    )
