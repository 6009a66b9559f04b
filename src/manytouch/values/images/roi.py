"""The part of an image that is processed."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from numbers import Integral
from types import NoneType

from manytouch.errors import SourceError, require_type


@dataclass(frozen=True, slots=True)
class Roi:
    """Region of interest: a rectangle of whole pixels in an image.

    Iterating gives x, y, width, height.

    Attributes:
        x_px, y_px: its first column and row, from 0.
        width_px, height_px: its size, at least 1.

    Raises:
        SourceError: the rectangle is empty or begins outside every image.
        ArgumentError: a number is not whole.
    """

    x_px: int
    y_px: int
    width_px: int
    height_px: int

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            require_type(each.name, value, Integral, "a whole number of pixels")
            object.__setattr__(self, each.name, int(value))  # results are stored with numbers of Python
        if min(self.x_px, self.y_px) < 0 or min(self.width_px, self.height_px) < 1:
            raise SourceError(
                f"the region of interest {self} (x,y,width,height) is not a part of an image: x and y must "
                "be at least 0, width and height at least 1"
            )

    def __iter__(self) -> Iterator[int]:
        return iter((self.x_px, self.y_px, self.width_px, self.height_px))

    def __str__(self) -> str:
        return f"{self.x_px},{self.y_px},{self.width_px},{self.height_px}"

    def require_inside(self, width_px: int, height_px: int, name: str) -> None:
        """Check that the region lies inside an image.

        Args:
            width_px, height_px: size of the image.
            name: of the input, for the message.

        Raises:
            SourceError: it does not.
        """
        if self.x_px + self.width_px > width_px or self.y_px + self.height_px > height_px:
            raise SourceError(
                f"the region of interest {self} (x,y,width,height) does not lie inside the image of {name}, "
                f"which has {width_px} x {height_px} px: give one that does, or none"
            )


def require_roi(roi_px: object) -> None:
    """Check that a region of interest is one, or None.

    Raises:
        ArgumentError: it is not.
    """
    require_type("roi_px", roi_px, (Roi, NoneType), "manytouch.Roi(x_px, y_px, width_px, height_px)")
