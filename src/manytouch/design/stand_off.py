"""Distance between camera and sheet: equations 2 to 4 of the paper.

tan(Q1/2) = (W/2)/d1 and tan(Q2/2) = (H/2)/d2, with the fields of view Q1 (horizontal) and Q2 (vertical),
so d1 = W / (2 tan(Q1/2)), d2 = H / (2 tan(Q2/2)), and d is the largest of both and of the shortest distance
F in focus. (Equation 4 is printed with the opposite sign; the text of the paper requires d > F.)
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class StandOff:
    """Distance of the optical centre from the markers, with its lower limits.

    Attributes:
        width_mm: d1, at which the width of the area fills the image.
        height_mm: d2, at which its height does.
        focus_mm: F, the shortest distance in focus.
    """

    width_mm: float
    height_mm: float
    focus_mm: float

    @property
    def distance_mm(self) -> float:
        """d, the shortest distance that satisfies all three."""
        return max(self.width_mm, self.height_mm, self.focus_mm)

    @property
    def limit(self) -> str:
        """The decisive limit: `width`, `height` or `focus`."""
        if self.distance_mm == self.focus_mm:
            return "focus"
        return "width" if self.width_mm >= self.height_mm else "height"


def stand_off(
    *, view_mm: tuple[float, float], hfov_rad: float, vfov_rad: float, least_focus_mm: float
) -> StandOff:
    """The shortest distance at which an area is in the image and in focus.

    Args:
        view_mm: width and height of the area that must be in the image.
        hfov_rad, vfov_rad: fields of view of the camera along them.
        least_focus_mm: shortest distance in focus.
    """
    return StandOff(
        width_mm=view_mm[0] / (2 * math.tan(hfov_rad / 2)),
        height_mm=view_mm[1] / (2 * math.tan(vfov_rad / 2)),
        focus_mm=least_focus_mm,
    )


def focal_px(width_px: int, hfov_rad: float) -> float:
    """Focal length of a lens without distortion."""
    return width_px / (2 * math.tan(hfov_rad / 2))


def vfov_rad(width_px: int, height_px: int, hfov_rad: float) -> float:
    """Vertical field of view of a camera with square pixels."""
    return 2 * math.atan(height_px / (2 * focal_px(width_px, hfov_rad)))
