"""Fields of a spline patch by scipy, from their definition: what the compiled tables are compared with."""

import numpy as np
from scipy.interpolate import BSpline

from manytouch.geometry.spline.patch import SplinePatch


def spline(length_mm: float, elements: int) -> BSpline:
    """All elements + 3 cubic functions on open uniform knots over [0, length]."""
    inner = np.linspace(0.0, length_mm, elements + 1)
    knot = np.concatenate([3 * [0.0], inner, 3 * [length_mm]])
    return BSpline(knot, np.eye(elements + 3), 3)


def on_outline(patch: SplinePatch, axis: int) -> np.ndarray:
    """(2, 2) the outer two coefficients of b by the next two, from the conditions on a clamped outline."""
    functions = spline(patch.size_mm[axis], patch.elements[axis])
    value, slope, second, third = (functions(0.0, order)[:4] for order in range(4))
    e0, e1, e2 = patch.clamped_end
    deflection = value - patch.shear_mm2 * second
    rule = np.stack([slope - e0 * second - e1 * third, deflection + e1 * second - e2 * third])
    return np.asarray(-np.linalg.solve(rule[:, :2], rule[:, 2:]))


def spread_out(patch: SplinePatch, coefficient: np.ndarray, *, is_bending: bool) -> np.ndarray:
    """Coefficients (nodes,) of all functions, (elements along x + 3, along y + 3)."""
    grid = coefficient.reshape(patch.shape)
    grid = grid if patch.is_x_slow else grid.T
    if patch.boundary == "soft":
        return grid
    grid = np.pad(grid, 1)
    if is_bending:
        for axis in range(2):
            moved = np.moveaxis(grid, axis, 0).copy()
            share = on_outline(patch, axis)
            moved[[0, 1]], moved[[-1, -2]] = share @ moved[2:4], share @ moved[[-3, -4]]
            grid = np.moveaxis(moved, 0, axis)
    return grid


def derivative(
    patch: SplinePatch, coefficient: np.ndarray, point_mm: np.ndarray, along_x: int, along_y: int
) -> np.ndarray:
    """(k, 3) derivative of u, v and the bending deflection b at points."""
    place = point_mm - patch.corner_mm
    orders = (along_x, along_y)
    tables = [
        spline(patch.size_mm[axis], patch.elements[axis])(place[:, axis], orders[axis]) for axis in range(2)
    ]
    return np.stack(
        [
            np.einsum(
                "ka,kb,ab->k", *tables, spread_out(patch, coefficient[:, i], is_bending=i == 2), optimize=True
            )
            for i in range(3)
        ],
        axis=1,
    )


def laplacian(
    patch: SplinePatch, coefficient: np.ndarray, point_mm: np.ndarray, along_x: int = 0, along_y: int = 0
) -> np.ndarray:
    """(k,) derivative of the Laplacian of b."""
    by_x = derivative(patch, coefficient, point_mm, along_x + 2, along_y)
    by_y = derivative(patch, coefficient, point_mm, along_x, along_y + 2)
    return np.asarray((by_x + by_y)[:, 2])


def moved(patch: SplinePatch, coefficient: np.ndarray, point_mm: np.ndarray) -> np.ndarray:
    """(k, 3) displacement of the sheet: u, v, and w = b - a lap b."""
    found = derivative(patch, coefficient, point_mm, 0, 0)
    found[:, 2] -= patch.shear_mm2 * laplacian(patch, coefficient, point_mm)
    return found
