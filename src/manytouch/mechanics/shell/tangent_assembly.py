"""Tangent of the shell, element by element, compiled.

Derivation and symbols: docs/derivations/mechanics.md. The tangent of an element is a sum over its Gauss
points of products of two derivatives of displacements; `SecondDerivatives` are their factors.
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
    tabulate,
)
from manytouch.mechanics.shell.point_derivatives import FIRST, SecondDerivatives, set_derivatives
from manytouch.mechanics.shell.point_state import evaluate, new_state
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
    factor: Float[np.ndarray, "9 m n"],
    plane: Float[np.ndarray, "45 16"],
    left: Float[np.ndarray, "63 16"],
) -> None:
    """Sums over the derivatives of u or v, for each of the five of another one of them."""
    for at in range(POINTS):
        d0, d1, d2 = plane[at], plane[POINTS + at], plane[2 * POINTS + at]
        d3, d4 = plane[3 * POINTS + at], plane[4 * POINTS + at]
        for column in range(5):
            to = left[column * POINTS + at]
            f0, f1, f2 = factor[at, 0, column], factor[at, 1, column], factor[at, 2, column]
            f3, f4 = factor[at, 3, column], factor[at, 4, column]
            for k in range(LOCAL):
                to[k] = f0 * d0[k] + f1 * d1[k] + f2 * d2[k] + f3 * d3[k] + f4 * d4[k]


@inlined_kernel(fastmath=True)
@no_type_check
def _sum_deflection(
    factor: Float[np.ndarray, "9 m n"],
    count: int,
    deflection: Float[np.ndarray, "63 16"],
    left: Float[np.ndarray, "63 16"],
) -> None:
    """Sums over the derivatives of b, for each of the first `count` ones of another displacement."""
    for at in range(POINTS):
        d0, d1, d2 = deflection[at], deflection[POINTS + at], deflection[2 * POINTS + at]
        d3, d4 = deflection[3 * POINTS + at], deflection[4 * POINTS + at]
        d5, d6 = deflection[5 * POINTS + at], deflection[6 * POINTS + at]
        for column in range(count):
            to = left[column * POINTS + at]
            f0, f1, f2 = factor[at, 0, column], factor[at, 1, column], factor[at, 2, column]
            f3, f4 = factor[at, 3, column], factor[at, 4, column]
            f5, f6 = factor[at, 5, column], factor[at, 6, column]
            for k in range(LOCAL):
                first = f0 * d0[k] + f1 * d1[k] + f2 * d2[k] + f3 * d3[k]
                to[k] = first + f4 * d4[k] + f5 * d5[k] + f6 * d6[k]


@inlined_kernel(fastmath=True)
@no_type_check
def _sum_derivatives(
    component: tuple[int, int],
    second: SecondDerivatives,
    plane: Float[np.ndarray, "45 16"],
    deflection: Float[np.ndarray, "63 16"],
    left: Float[np.ndarray, "63 16"],
) -> int:
    """Sums over the derivatives of component i, one row for each derivative of component j at each point.

    j is at most i. They are written to `left`; returns the number of rows.
    """
    i, j = component
    factor, count = second[:, FIRST[i] :, FIRST[j] :], 5 if j < 2 else 7
    if i < 2:
        _sum_plane(factor, plane, left)
    else:
        _sum_deflection(factor, count, deflection, left)
    return count * POINTS


@kernel(fastmath=True)
@no_type_check
def assemble(coefficient: Coefficients, elements: Elements, stiffness: Stiffness, tangent: Tangent) -> None:
    """The tangent in its precision, mm.

    tangent[p, i, j, a, b] = d force[p, i] / d coefficient[q, j], where node q is a - 3 nodes further along
    the slow and b - 3 nodes further along the fast axis than p.
    """
    kind, tables, local = tangent.dtype, new_tables(), np.empty((3, LOCAL))
    nx, ny, wx, wy, nxx, nyy, nxy, lx, ly, uxx, uyy, uxy = tables
    matrix, turned = np.empty((LOCAL, LOCAL), kind), np.empty((LOCAL, LOCAL), kind)
    left = np.empty((7 * POINTS, LOCAL), kind)
    plane, deflection = np.empty((5 * POINTS, LOCAL), kind), np.empty((7 * POINTS, LOCAL), kind)
    flat, flat_left, flat_tangent = matrix.reshape(-1), left.reshape(-1), tangent.reshape(-1)
    flat_plane, flat_deflection = plane.reshape(-1), deflection.reshape(-1)
    second = np.empty((POINTS, 17, 17), kind)
    state = new_state()
    tangent[:] = 0.0
    for es in range(elements.slow.shape[0]):
        for ef in range(elements.fast.shape[0]):
            gather(coefficient, elements, es, ef, local)
            tabulate(elements, es, ef, stiffness.shear, tables)
            for at in range(POINTS):
                sheared = evaluate((local, tables), at, elements.weight[at], stiffness, state)
                set_derivatives(state, stiffness.shear, sheared, second[at])
            for row, table in enumerate((nx, ny, uxx, uyy, uxy)):
                plane[row * POINTS : (row + 1) * POINTS] = table
            for row, table in enumerate((wx, wy, nxx, nyy, nxy, lx, ly)):
                deflection[row * POINTS : (row + 1) * POINTS] = table
            first = (es - elements.dropped, ef - elements.dropped)
            for i in range(3):
                for j in range(i + 1):  # the tangent is symmetric
                    count = _sum_derivatives((i, j), second, plane, deflection, left)
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
    clear_outside(elements.shape, tangent)
