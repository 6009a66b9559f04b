"""Solids as trees of a few primitives, from which both meshes and STEP files are made.

All lengths are in mm; each part has its own frame with z up from the bed of the printer.
"""

from dataclasses import dataclass

import numpy as np

from manytouch.values.arrays import Points2


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A block with axis-parallel edges.

    Attributes:
        x_mm, y_mm, z_mm: (low, high) along each axis.
    """

    x_mm: tuple[float, float]
    y_mm: tuple[float, float]
    z_mm: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Taper:
    """A frustum with rectangular ends that are centred on the z axis.

    Attributes:
        lower_mm, upper_mm: full width along x and y of both ends.
        z_mm: of both ends.
    """

    lower_mm: tuple[float, float]
    upper_mm: tuple[float, float]
    z_mm: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pins:
    """Equal upright cylinders or truncated cones.

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
class CrossHole:
    """A cylinder along y.

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
    """The union of primitives, minus others.

    Attributes:
        joined: at least one.
        removed: subtracted from their union.
    """

    joined: tuple["Primitive", ...]
    removed: tuple["Primitive", ...] = ()


Primitive = Box | Taper | Pins | CrossHole


def pins(
    centre_mm: Points2, radius_mm: float, z_mm: tuple[float, float], *, upper_radius_mm: float | None = None
) -> Pins:
    """Upright cylinders, or truncated cones if the upper radius is given."""
    upper = radius_mm if upper_radius_mm is None else upper_radius_mm
    return Pins(centre_mm=np.asarray(centre_mm), radius_mm=radius_mm, upper_radius_mm=upper, z_mm=z_mm)


def block(size_mm: tuple[float, float], z_mm: tuple[float, float]) -> Box:
    """A block centred on the z axis."""
    half_x, half_y = 0.5 * size_mm[0], 0.5 * size_mm[1]
    return Box(x_mm=(-half_x, half_x), y_mm=(-half_y, half_y), z_mm=z_mm)
