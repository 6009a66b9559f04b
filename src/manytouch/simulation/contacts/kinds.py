"""Contacts that can be simulated, and what is refused of them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from manytouch.errors import ContactError
from manytouch.values import Sheet
from manytouch.values.arrays import Points2

STEEPEST = 0.5
"""Largest depth, in shares of the distance from the clamped outline."""
RASTER = 12
"""A patch is a lattice of so many forces along its length and width."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ball:
    """A rigid ball without friction, pressed straight down.

    Attributes:
        x_mm, y_mm: of its lowest point, sheet frame.
        depth_mm: of its lowest point below the undeformed touched face; negative above it.
        radius_mm: at least the spacing of the grid (2.5 mm on a sheet of 120 x 80 mm).
    """

    x_mm: float
    y_mm: float
    depth_mm: float
    radius_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """A force that is spread evenly over material of the touched face; its direction stays.

    Attributes:
        x_mm, y_mm: its middle on the undeformed sheet, sheet frame.
        force_N: x, y, z on the sheet; a press has z < 0.
        size_mm: extent along x and y.
        outline: an ellipse in that extent, or the rectangle.
    """

    x_mm: float
    y_mm: float
    force_N: tuple[float, float, float]
    size_mm: tuple[float, float]
    outline: Literal["ellipse", "rectangle"] = "ellipse"

    def places_mm(self) -> Points2:
        """(n, 2) undeformed places that carry equal parts of the force."""
        line = (np.arange(RASTER) + 0.5) / RASTER - 0.5
        place = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
        if self.outline == "ellipse":
            place = place[(place**2).sum(axis=1) <= 0.25]
        return np.asarray([self.x_mm, self.y_mm] + place * self.size_mm)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointForces:
    """A field of forces on the touched face, which is one contact; their directions stay.

    Attributes:
        place_mm: (n, 2) x, y on the undeformed sheet, sheet frame.
        force_N: (n, 3) on the sheet; a press has z < 0.
    """

    place_mm: Float64[np.ndarray, "n 2"]
    force_N: Float64[np.ndarray, "n 3"]


SimulatedContact = Ball | Patch | PointForces


def require_possible(contact: object, where: str, sheet: Sheet, spacing_mm: float) -> None:
    """Check a contact.

    Args:
        contact: as given.
        where: which one it is, such as "contact 2 of press 5".
        sheet: that is touched.
        spacing_mm: of the grid on which it is solved.

    Raises:
        ContactError: it cannot be simulated.
    """
    match contact:
        case Ball():
            for name in ("x_mm", "y_mm", "depth_mm", "radius_mm"):
                _numbers(where, name, getattr(contact, name), ())
            _require_inside(where, np.array([[contact.x_mm, contact.y_mm]]), sheet)
            _require_ball(where, contact, sheet, spacing_mm)
        case Patch():
            shapes = {"x_mm": (), "y_mm": (), "force_N": (3,), "size_mm": (2,)}
            for name, shape in shapes.items():
                _numbers(where, name, getattr(contact, name), shape)
            if min(contact.size_mm) <= 0.0:
                raise ContactError(f"{where} has the size {contact.size_mm} mm: give two positive lengths")
            if contact.outline not in ("ellipse", "rectangle"):
                raise ContactError(f"{where} has the outline {contact.outline!r}: give ellipse or rectangle")
            _require_inside(where, contact.places_mm(), sheet)
        case PointForces():
            force_N = _numbers(where, "force_N", contact.force_N, (None, 3))
            place_mm = _numbers(where, "place_mm", contact.place_mm, (len(force_N), 2))
            _require_inside(where, place_mm, sheet)
        case _:
            raise ContactError(
                f"{where} is of type {type(contact).__name__}: give a Ball, a Patch or PointForces, in a "
                "list of contacts for one press or a list of such lists for a batch"
            )


def _numbers(where: str, name: str, value: object, shape: tuple[int | None, ...]) -> np.ndarray:
    """A value as an array of finite numbers; None in the shape is any length."""
    wanted = f"finite numbers of shape {shape}".replace("None", "n") if shape else "a finite number"
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        raise ContactError(f"{where} has a {name} of type {type(value).__name__}: give {wanted}")
    array = array.astype(np.float64)
    fits = array.ndim == len(shape) and all(
        length in {None, count} for length, count in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ContactError(f"{where} has a {name} of shape {array.shape}: give {wanted}")
    if not np.isfinite(array).all():
        raise ContactError(f"{where} has a {name} that is not finite: give {wanted}")
    return array


def _require_inside(where: str, place_mm: Points2, sheet: Sheet) -> None:
    half_mm = 0.5 * sheet.size_mm
    is_outside = (np.abs(place_mm) >= half_mm).any(axis=1)
    if is_outside.any():
        x_mm, y_mm = place_mm[is_outside][0]
        raise ContactError(
            f"{where} reaches ({x_mm:.4g}, {y_mm:.4g}) mm, outside of the sheet, which ends at "
            f"x = ±{half_mm[0]:.4g} mm and y = ±{half_mm[1]:.4g} mm: move it inside"
        )


def _require_ball(where: str, ball: Ball, sheet: Sheet, spacing_mm: float) -> None:
    if ball.radius_mm < spacing_mm:
        raise ContactError(
            f"{where} is a ball with a radius of {ball.radius_mm:.4g} mm, too small for the grid of this "
            f"sheet: give at least {spacing_mm:.3g} mm, or a Patch"
        )
    distance_mm = float((0.5 * sheet.size_mm - np.abs([ball.x_mm, ball.y_mm])).min())
    if ball.depth_mm > STEEPEST * distance_mm:
        raise ContactError(
            f"{where} is {ball.depth_mm:.4g} mm deep at {distance_mm:.4g} mm from the clamped outline: "
            f"give at most {STEEPEST * distance_mm:.4g} mm there, {STEEPEST:g} of the distance"
        )
