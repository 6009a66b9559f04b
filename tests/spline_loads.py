"""Nodal forces of loads that are known exactly."""

from dataclasses import replace

import numpy as np

import spline_reference
from manytouch.estimation.mechanics.inversion.force_nodes import ForceNodes
from manytouch.geometry.spline.patch import SplinePatch

ELEMENT_MM = (4.0, 5.0)
COUNT = (22, 15)
SHEAR_MM2 = 1.8
PATCH = SplinePatch(
    size_mm=(COUNT[0] * ELEMENT_MM[0], COUNT[1] * ELEMENT_MM[1]),
    elements=COUNT,
    boundary="soft",
    shear_mm2=SHEAR_MM2,
)
CORNER_MM = -0.5 * np.array(PATCH.size_mm)
SHAPE = (COUNT[0] + 3, COUNT[1] + 3)


def knots(axis: int) -> np.ndarray:
    return np.asarray(spline_reference.spline(PATCH.size_mm[axis], COUNT[axis]).t + CORNER_MM[axis])


def greville(axis: int) -> np.ndarray:
    knot = knots(axis)
    return (knot[1:-3] + knot[2:-2] + knot[3:-1]) / 3.0


NODES = ForceNodes(
    shape=SHAPE,
    place_mm=np.stack(np.meshgrid(greville(0), greville(1), indexing="ij"), axis=-1).reshape(-1, 2),
    element_mm=np.array(ELEMENT_MM),
    inner_mm=0.5 * np.array(COUNT) * ELEMENT_MM - 6.0,
    force_unit_mm2=12.0,
    least_seen_px=5.0,
    seen_mm2_per_px=0.01,
    is_beyond=np.zeros(int(np.prod(SHAPE)), dtype=np.bool_),
    compliance_per_mm=np.ones(int(np.prod(SHAPE))),
    stiffening=0.0,
    own_spread_mm2=np.array(ELEMENT_MM) ** 2 / 3.0,
)
"""Of a thin plate."""
SHEARED = replace(NODES, own_spread_mm2=NODES.own_spread_mm2 - 2.0 * SHEAR_MM2)
"""Of a sheet with a = SHEAR_MM2."""


def nodal_press(place_mm: np.ndarray, force: np.ndarray, shear_mm2: float) -> np.ndarray:
    """(nx, ny) nodal forces of normal forces at places: those of B - a lap B."""
    tables = [
        [
            spline_reference.spline(PATCH.size_mm[axis], COUNT[axis])(
                place_mm[:, axis] - CORNER_MM[axis], order
            )
            for order in (0, 2)
        ]
        for axis in range(2)
    ]
    (x, x2), (y, y2) = tables
    weighted = force[:, None]
    return np.asarray(x.T @ (weighted * (y - shear_mm2 * y2)) - shear_mm2 * x2.T @ (weighted * y))


def pressed(
    *discs: tuple[float, float, float, float],
    shear: tuple[float, float] = (0.0, 0.0),
    shear_mm2: float = 0.0,
) -> np.ndarray:
    """Nodal forces of discs x, y, radius, force over E under even pressure, with a = shear_mm2."""
    force = np.zeros((*SHAPE, 3))
    for x, y, radius, press in discs:
        ring = radius * np.sqrt((np.arange(40) + 0.5) / 40)
        angle = 2 * np.pi * np.arange(60) / 60
        place_mm = np.column_stack(
            [(x + ring[:, None] * np.cos(angle)).ravel(), (y + ring[:, None] * np.sin(angle)).ravel()]
        )
        each = np.full(len(place_mm), press / len(place_mm))
        force[..., 2] -= nodal_press(place_mm, each, shear_mm2)
        force[..., :2] += nodal_press(place_mm, each, 0.0)[..., None] * np.array(shear)
    return force.reshape(-1, 3)
