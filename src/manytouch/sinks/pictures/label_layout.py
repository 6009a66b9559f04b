"""Positions of labels next to circles in an image, such that they stay inside and do not overlap."""

from collections.abc import Sequence
from typing import NamedTuple

STEPS = (0, 1, 2, 3, -1, -2, -3)  # label heights away from the preferred positions
MARGIN_PX = 4


class Rectangle(NamedTuple):
    """A rectangle in pixels."""

    left: float
    top: float
    width: float
    height: float

    def overlaps(self, other: "Rectangle") -> bool:
        """Whether the two have an area in common."""
        apart_x = self.left >= other.left + other.width or other.left >= self.left + self.width
        apart_y = self.top >= other.top + other.height or other.top >= self.top + self.height
        return not (apart_x or apart_y)


def place_label(
    circle: tuple[float, float, float],
    size: tuple[float, float],
    image_size: tuple[int, int],
    occupied: Sequence[Rectangle],
) -> Rectangle:
    """The position of a label above or below a circle.

    Args:
        circle: x, y of its centre and its radius, px.
        size: width and height of the label.
        image_size: width and height of the image, which the label does not leave if it fits.
        occupied: labels that it does not overlap if there is space.
    """
    (x, y, radius), (width, height) = circle, size
    left = min(max(x - width / 2, 0.0), max(image_size[0] - width, 0.0))
    preferred = (y - radius - height - MARGIN_PX, y + radius + MARGIN_PX)
    tops = [top + step * height for step in STEPS for top in preferred]
    tops += [row * height for row in range(int(image_size[1] // height))]
    inside = [Rectangle(left, top, width, height) for top in tops if 0 <= top <= image_size[1] - height] or [
        Rectangle(left, 0.0, width, height)
    ]
    free = [label for label in inside if not any(label.overlaps(other) for other in occupied)]
    return (free or inside)[0]
