"""Lower faces of the indenters of the FEATS deck as heights over the plane, from its sizes.

https://github.com/feats-ai/feats, `src/calculix/obj/indenters`: spheres; flat faces whose edges are rounded
by 1 mm (the ring: 0.7 mm); a block whose face slopes by 10 degrees; a pyramid whose sides rise by 30 degrees,
its tip and ridges rounded by 1 mm. Each flat or sloping body is a face over which a ball rolls.
"""

import math
from collections.abc import Callable

import numpy as np

from manytouch.evaluation.suite.pads.calculix import Shape
from manytouch.values.arrays import Points2, Scalars

EDGE_MM, RING_EDGE_MM = 1.0, 0.7
STEEPEST = 0.9
"""Share of the radius of an edge from where on its slope stays the same."""
SLOPE, RISE = math.tan(math.radians(10.0)), math.tan(math.radians(30.0))

Height = Callable[[Points2], Scalars]


def sphere(radius_mm: float) -> Height:
    """Lowest point in the origin."""
    return lambda place_mm: _ball(np.linalg.norm(place_mm, axis=1), radius_mm)


def disc(radius_mm: float) -> Height:
    """The flat end of a cylinder, radius of the cylinder."""
    flat_mm = radius_mm - EDGE_MM
    return lambda place_mm: _ball(np.maximum(np.linalg.norm(place_mm, axis=1) - flat_mm, 0.0), EDGE_MM)


def ring(outer_mm: float, inner_mm: float) -> Height:
    """The flat end of a tube, outer and inner radius."""

    def height_mm(place_mm: Points2) -> Scalars:
        away_mm = np.linalg.norm(place_mm, axis=1)
        off_mm = np.maximum(inner_mm + RING_EDGE_MM - away_mm, away_mm - outer_mm + RING_EDGE_MM)
        return _ball(np.maximum(off_mm, 0.0), RING_EDGE_MM)

    return height_mm


def polygon(corners: int, inradius_mm: float, first_deg: float) -> Height:
    """The flat end of a regular prism: distance of its sides from the middle, direction of a corner."""
    reach_mm = (inradius_mm - EDGE_MM) / math.cos(math.pi / corners)
    angle = math.radians(first_deg) + 2.0 * math.pi * np.arange(corners) / corners
    corner_mm = reach_mm * np.column_stack([np.cos(angle), np.sin(angle)])
    return lambda place_mm: _ball(_outside(place_mm, corner_mm), EDGE_MM)


def sloping(half_mm: float) -> Height:
    """A face of half a width that slopes along y; its lowest line, before the edge is rounded, is on +y.

    The origin is the middle of the face; the height is that over the lowest point of the body.
    """
    flat_mm = half_mm - EDGE_MM

    def height_mm(place_mm: Points2) -> Scalars:
        across_mm = np.maximum(np.abs(place_mm[:, 0]) - flat_mm, 0.0)
        left_mm = np.sqrt(np.maximum(EDGE_MM**2 - across_mm**2, (1.0 - STEEPEST**2) * EDGE_MM**2))
        contact_mm = np.clip(place_mm[:, 1] + left_mm * SLOPE / math.hypot(1.0, SLOPE), -flat_mm, flat_mm)
        return SLOPE * (flat_mm - contact_mm) + _ball(
            np.hypot(across_mm, place_mm[:, 1] - contact_mm), EDGE_MM
        )

    return height_mm


def pyramid() -> Height:
    """Tip in the origin, sides along the axes."""

    def height_mm(place_mm: Points2) -> Scalars:
        large_mm, small_mm = np.sort(np.abs(place_mm), axis=1)[:, ::-1].T
        on_side_mm = large_mm - EDGE_MM * RISE / math.hypot(1.0, RISE)  # what the ball touches
        middle_mm, half_mm = 0.5 * (large_mm + small_mm), 0.5 * (large_mm - small_mm)
        left_mm = np.sqrt(np.maximum(EDGE_MM**2 - 2.0 * half_mm**2, 0.0))
        on_ridge_mm = np.maximum(middle_mm - left_mm * 0.5 * RISE / math.sqrt(1.0 + 0.5 * RISE**2), 0.0)
        is_side = on_side_mm >= small_mm
        touch_mm = np.where(is_side, on_side_mm, on_ridge_mm)
        off_mm = np.where(
            is_side, large_mm - on_side_mm, np.hypot(large_mm - on_ridge_mm, small_mm - on_ridge_mm)
        )
        return RISE * touch_mm + _ball(off_mm, EDGE_MM)

    return height_mm


SHAPES: dict[Shape, tuple[Height, float, float]] = {
    "sphere_10": (sphere(5.0), 5.0, 0.35),
    "sphere_15": (sphere(7.5), 7.5, 0.4),
    "sphere_20": (sphere(10.0), 10.0, 0.4),
    "cylinder_8": (disc(4.0), 4.2, 0.5),
    "cylinder_10_7": (ring(5.0, 3.5), 5.2, 0.35),
    "cuboid_7": (polygon(4, 3.5, 45.0), 3.7, 0.5),
    "polygon_6_10": (polygon(6, 5.0, 0.0), 6.0, 0.5),
    "triangle_8": (polygon(3, 4.0 / math.sqrt(3.0), 90.0), 4.9, 0.4),
    "sloping_cuboid_10": (sloping(5.0), 5.2, 0.5),
    "pyramid_10": (pyramid(), 4.5, 0.35),
}
"""Height, half a width of the square around it, and width of its elements, mm."""


def _ball(off_mm: Scalars, radius_mm: float) -> Scalars:
    """Height over its lowest point of a ball whose middle is so far away; at last with constant slope."""
    last_mm = STEEPEST * radius_mm
    inside_mm = np.minimum(off_mm, last_mm)
    slope = STEEPEST / math.sqrt(1.0 - STEEPEST**2)
    height_mm: Scalars = radius_mm - np.sqrt(radius_mm**2 - inside_mm**2) + slope * (off_mm - inside_mm)
    return height_mm


def _outside(place_mm: Points2, corner_mm: Points2) -> Scalars:
    """Distance (n,) of places (n, 2) from a convex polygon, corners against the clock; 0 inside."""
    nearest_mm, inside = np.full(len(place_mm), np.inf), np.ones(len(place_mm), dtype=bool)
    for begin_mm, end_mm in zip(corner_mm, np.roll(corner_mm, -1, axis=0), strict=True):
        side_mm, off_mm = end_mm - begin_mm, place_mm - begin_mm
        share = np.clip(off_mm @ side_mm / (side_mm @ side_mm), 0.0, 1.0)
        nearest_mm = np.minimum(nearest_mm, np.linalg.norm(off_mm - share[:, None] * side_mm, axis=1))
        inside &= side_mm[0] * off_mm[:, 1] - side_mm[1] * off_mm[:, 0] >= 0.0
    return np.where(inside, 0.0, nearest_mm)
