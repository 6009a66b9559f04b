"""Solids as a tree of a few primitives: one description, from which meshes and STEP files are made.

Millimetres; each part has a frame of its own with z up as it lies on the printer's bed.
"""

from dataclasses import dataclass

import numpy as np

from manytouch.values.arrays import Points2

Extent = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """All points whose x, y and z lie within spans."""

    x_mm: tuple[float, float]
    y_mm: tuple[float, float]
    z_mm: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Taper:
    """A block whose rectangle, centred on the axis, changes evenly from z to z.

    Attributes:
        lower_mm, upper_mm: full width along x and y at both ends.
        z_mm: of both ends.
    """

    lower_mm: tuple[float, float]
    upper_mm: tuple[float, float]
    z_mm: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pins:
    """Equal upright cylinders, or cones cut off.

    Attributes:
        centre_mm: (n, 2) of their axes.
        radius_mm: at the lower end.
        upper_radius_mm: at the upper end.
        z_mm: of both ends.
    """

    centre_mm: Points2
    radius_mm: float
    upper_radius_mm: float
    z_mm: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bore:
    """A cylinder that lies along y.

    Attributes:
        x_mm, z_mm: of its axis.
        y_mm: of both ends.
        radius_mm: of it.
    """

    x_mm: float
    z_mm: float
    y_mm: tuple[float, float]
    radius_mm: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solid:
    """Primitives joined, and others taken away from them.

    Attributes:
        joined: at least one.
        removed: from all of them.
    """

    joined: tuple["Primitive", ...]
    removed: tuple["Primitive", ...] = ()


Primitive = Box | Taper | Pins | Bore


def pins(
    centre_mm: Points2, radius_mm: float, z_mm: tuple[float, float], *, upper_radius_mm: float | None = None
) -> Pins:
    """Upright cylinders; cones with another radius at the upper end."""
    upper = radius_mm if upper_radius_mm is None else upper_radius_mm
    return Pins(centre_mm=np.asarray(centre_mm), radius_mm=radius_mm, upper_radius_mm=upper, z_mm=z_mm)


def block(size_mm: tuple[float, float], z_mm: tuple[float, float]) -> Box:
    """An upright block centred on the axis."""
    half_x, half_y = 0.5 * size_mm[0], 0.5 * size_mm[1]
    return Box(x_mm=(-half_x, half_x), y_mm=(-half_y, half_y), z_mm=z_mm)
