"""Tangent of the shell, element by element, compiled.

Derivation and symbols: docs/derivations/mechanics.md. The tangent of an element is a sum over its Gauss
points of products of two derivatives of displacements; `SecondDerivatives` has the factor of each product.
"""

import numpy as np
from jaxtyping import Float

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.mechanics.banded.tile import COLUMNS, ROWS, At, add_product
from manytouch.mechanics.shell.kernels import (
    LOCAL,
    POINTS,
    Elements,
    Stiffness,
    gather,
    new_tables,
    scatter_force,
    tabulate,
)
from manytouch.mechanics.shell.point_derivatives import (
    SecondDerivatives,
    add_force,
    evaluate,
    new_state,
    set_deflection_derivatives,
    set_plane_derivatives,
)
from manytouch.mechanics.shell.tangent_kernels import REACH, ROW, STRIP, Coefficients, Tangent, clear_outside


@inlined_kernel(fastmath=True)
@no_type_check
def _scatter_tangent(
    matrix: Float[np.ndarray, "16 16"],
    component: tuple[int, int],
    first: tuple[int, int],
    shape: tuple[int, int],
    tangent: Float[np.ndarray, " k"],
) -> None:
    """Add the block of components (i, j) of the matrix of the element at node `first` to the tangent."""
    i, j = component
    s0, f0 = first
    for a in range(max(-s0, 0), min(4, shape[0] - s0)):
        for b in range(max(-f0, 0), min(4, shape[1] - f0)):
            node = (s0 + a) * shape[1] + f0 + b
            begin = (9 * node + 3 * i + j) * ROW * STRIP + (REACH - a) * STRIP + REACH - b
            for c in range(4):
                for d in range(4):
                    # unsigned: numba then knows that the place is not counted from the end
                    tangent[np.uintp(begin + STRIP * c + d)] += matrix[4 * a + b, 4 * c + d]


@inlined_kernel(fastmath=True)
@no_type_check
def _transpose(matrix: Float[np.ndarray, "16 16"], turned: Float[np.ndarray, "16 16"]) -> None:
    """The transpose of a matrix, into `turned`."""
    for row in range(LOCAL):
        for column in range(LOCAL):
            turned[row, column] = matrix[column, row]


@inlined_kernel(fastmath=True)
@no_type_check
def _sum_plane(
    factor: Float[np.ndarray, "9 2 2"],
    plane: Float[np.ndarray, "18 16"],
    left: Float[np.ndarray, "63 16"],
) -> None:
    """Sums over the derivatives of the displacement along x or y, for both derivatives of another one."""
    for at in range(POINTS):
        by_x, by_y = plane[at], plane[POINTS + at]
        for column in range(2):
            to, x, y = left[column * POINTS + at], factor[at, 0, column], factor[at, 1, column]
            for k in range(LOCAL):
                to[k] = x * by_x[k] + y * by_y[k]


@inlined_kernel(fastmath=True)
@no_type_check
def _sum_deflection(
    factor: Float[np.ndarray, "9 c 7"],
    deflection: Float[np.ndarray, "63 16"],
    left: Float[np.ndarray, "63 16"],
) -> None:
    """Sums over the derivatives of b, for the c derivatives of another displacement."""
    for at in range(POINTS):
        d0, d1, d2 = deflection[at], deflection[POINTS + at], deflection[2 * POINTS + at]
        d3, d4 = deflection[3 * POINTS + at], deflection[4 * POINTS + at]
        d5, d6 = deflection[5 * POINTS + at], deflection[6 * POINTS + at]
        for column in range(factor.shape[1]):
            to = left[column * POINTS + at]
            f0, f1, f2 = factor[at, column, 0], factor[at, column, 1], factor[at, column, 2]
            f3, f4 = factor[at, column, 3], factor[at, column, 4]
            f5, f6 = factor[at, column, 5], factor[at, column, 6]
            for k in range(LOCAL):
                first = f0 * d0[k] + f1 * d1[k] + f2 * d2[k] + f3 * d3[k]
                to[k] = first + f4 * d4[k] + f5 * d5[k] + f6 * d6[k]


@inlined_kernel(fastmath=True)
@no_type_check
def _sum_derivatives(
    component: tuple[int, int],
    derivatives: SecondDerivatives,
    plane: Float[np.ndarray, "18 16"],
    deflection: Float[np.ndarray, "63 16"],
    left: Float[np.ndarray, "63 16"],
) -> int:
    """Sums over the derivatives of component i, one row for each derivative of component j at each point.

    j is at most i. They are written to `left`; returns the number of rows.
    """
    i, j = component
    if i < 2:
        _sum_plane(derivatives.plane[:, i, j], plane, left)
        return 2 * POINTS
    if j < 2:
        _sum_deflection(derivatives.coupling[:, j], deflection, left)
        return 2 * POINTS
    _sum_deflection(derivatives.deflection, deflection, left)
    return 7 * POINTS


@kernel(fastmath=True)
@no_type_check
def forces_and_tangent(
    coefficient: Coefficients, elements: Elements, stiffness: Stiffness, force: Coefficients, tangent: Tangent
) -> None:
    """`kernels.forces`, and their derivative into `tangent` in its precision, mm.

    tangent[p, i, j, a, b] = d force[p, i] / d coefficient[q, j], where node q is a - 3 nodes further along
    the slow and b - 3 nodes further along the fast axis than p.
    """
    kind, tables, local = tangent.dtype, new_tables(), np.empty((3, LOCAL))
    nx, ny, wx, wy, nxx, nyy, nxy, lx, ly = tables
    element = np.empty((3, LOCAL))
    matrix, turned = np.empty((LOCAL, LOCAL), kind), np.empty((LOCAL, LOCAL), kind)
    left = np.empty((7 * POINTS, LOCAL), kind)
    plane, deflection = np.empty((2 * POINTS, LOCAL), kind), np.empty((7 * POINTS, LOCAL), kind)
    flat, flat_left, flat_tangent = matrix.reshape(-1), left.reshape(-1), tangent.reshape(-1)
    flat_plane, flat_deflection = plane.reshape(-1), deflection.reshape(-1)
    derivatives = SecondDerivatives(
        np.empty((POINTS, 2, 2, 2, 2), kind),
        np.empty((POINTS, 2, 2, 7), kind),
        np.empty((POINTS, 7, 7), kind),
    )
    state = new_state()
    force[:] = 0.0
    tangent[:] = 0.0
    for es in range(elements.slow.shape[0]):
        for ef in range(elements.fast.shape[0]):
            gather(coefficient, elements, es, ef, local)
            tabulate(elements, es, ef, stiffness.shear, tables)
            element[:] = 0.0
            for at in range(POINTS):
                weight = elements.weight[at]
                slopes = evaluate((local, tables), at, weight, stiffness, state)
                add_force(state, tables, at, slopes, element)
                set_plane_derivatives(at, state, slopes.fibre_cos2, derivatives)
                sheared = weight * stiffness.shear_stiffness
                set_deflection_derivatives(at, state, slopes, sheared, derivatives)
            for row, table in enumerate((nx, ny)):
                plane[row * POINTS : (row + 1) * POINTS] = table
            for row, table in enumerate((wx, wy, nxx, nyy, nxy, lx, ly)):
                deflection[row * POINTS : (row + 1) * POINTS] = table
            first = (es - elements.dropped, ef - elements.dropped)
            for i in range(3):
                for j in range(i + 1):  # the tangent is symmetric
                    count = _sum_derivatives((i, j), derivatives, plane, deflection, left)
                    right = flat_deflection if j == 2 else flat_plane
                    matrix[:] = 0.0
                    for row in range(0, LOCAL, ROWS):
                        for column in range(0, LOCAL, COLUMNS):
                            to, from_row = At(row * LOCAL + column, LOCAL), At(row, LOCAL)
                            add_product(flat, to, flat_left, from_row, right, At(column, LOCAL), count)
                    _scatter_tangent(matrix, (i, j), first, elements.shape, flat_tangent)
                    if j < i:
                        _transpose(matrix, turned)
                        _scatter_tangent(turned, (j, i), first, elements.shape, flat_tangent)
            scatter_force(element, elements, es, ef, force)
    clear_outside(elements.shape, tangent)
