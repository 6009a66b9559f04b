"""Nodal forces of loads that are known exactly."""

import numpy as np
from scipy.interpolate import BSpline

from manytouch.estimation.mechanics.force_clusters import ForceLattice

ELEMENT_MM = (4.0, 5.0)
COUNT = (22, 15)


def knots(axis: int) -> np.ndarray:
    half = 0.5 * COUNT[axis] * ELEMENT_MM[axis]
    inner = np.linspace(-half, half, COUNT[axis] + 1)
    return np.concatenate([np.full(3, -half), inner, np.full(3, half)])


def greville(axis: int) -> np.ndarray:
    knot = knots(axis)
    return (knot[1:-3] + knot[2:-2] + knot[3:-1]) / 3.0


SHAPE = (COUNT[0] + 3, COUNT[1] + 3)
LATTICE = ForceLattice(
    shape=SHAPE,
    place_mm=np.stack(np.meshgrid(greville(0), greville(1), indexing="ij"), axis=-1).reshape(-1, 2),
    element_mm=np.array(ELEMENT_MM),
    inner_mm=0.5 * np.array(COUNT) * ELEMENT_MM - 6.0,
    force_unit_mm2=12.0,
)


def pressed(*discs: tuple[float, float, float, float], shear: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Nodal forces of discs x, y, radius, force over E under even pressure."""
    force = np.zeros((*SHAPE, 3))
    for x, y, radius, press in discs:
        ring = radius * np.sqrt((np.arange(40) + 0.5) / 40)
        angle = 2 * np.pi * np.arange(60) / 60
        at_x = (x + ring[:, None] * np.cos(angle)).ravel()
        at_y = (y + ring[:, None] * np.sin(angle)).ravel()
        along_x = BSpline.design_matrix(at_x, knots(0), 3).toarray()
        along_y = BSpline.design_matrix(at_y, knots(1), 3).toarray()
        nodal = along_x.T @ along_y * press / len(at_x)
        force += nodal[..., None] * [*shear, -1.0]
    return force.reshape(-1, 3)
