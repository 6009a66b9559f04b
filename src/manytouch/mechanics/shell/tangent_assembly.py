"""Tangent of the shell, element by element, compiled.

Derivation and symbols: docs/derivations/mechanics.md. The tangent of an element is a sum over its Gauss
points of products of two derivatives of displacements; `Factors` has the factor of each product.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float64

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.mechanics.banded.tile import ROWS, At, add_product_16
from manytouch.mechanics.shell.kernels import (
    LOCAL,
    POINTS,
    Elements,
    Stiffness,
    Tables,
    gather,
    new_tables,
    scatter_force,
    squared_cosine,
    strain,
    tabulate,
)
from manytouch.mechanics.shell.material import stress_and_tangent
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


class Factors(NamedTuple):
    """Second derivatives of the energy at the Gauss points of an element, times their weight.

    Attributes:
        plane: (9, 2, 2, 2, 2) by x and y derivatives of the displacements along x and y: point, both
            components, both derivatives.
        coupling: (9, 2, 2, 7) by those and by the derivatives of b: point, component, derivative.
        deflection: (9, 7, 7) by all derivatives of b in `Tables`.
    """

    plane: Float[np.ndarray, "9 2 2 2 2"]
    coupling: Float[np.ndarray, "9 2 2 7"]
    deflection: Float[np.ndarray, "9 7 7"]


class PointState(NamedTuple):
    """State of the sheet at a Gauss point.

    Attributes:
        a1, a2: base vectors of the middle surface.
        curvature: (3,) second derivatives of b: xx, yy and twice xy.
        bend: (2,) gradient of the Laplacian of b.
        fibre: (2,) slope of b.
        stretch: (3,) membrane forces 11, 22, 12 times the weight of the point.
        bending_moment: (3,) derivatives of the energy by the curvatures of the strain, times that weight.
        push: (2,) derivatives of the energy by the gradient of the Laplacian, times that weight.
        membrane, mixed, bending: (3, 3) moduli of the membrane, of the coupling and of bending, in the order
            11, 22, 12, times that weight.
        work: (3, 3) work space.
    """

    a1: Float64[np.ndarray, "3"]
    a2: Float64[np.ndarray, "3"]
    curvature: Float64[np.ndarray, "3"]
    bend: Float64[np.ndarray, "2"]
    fibre: Float64[np.ndarray, "2"]
    stretch: Float64[np.ndarray, "3"]
    bending_moment: Float64[np.ndarray, "3"]
    push: Float64[np.ndarray, "2"]
    membrane: Float64[np.ndarray, "3 3"]
    mixed: Float64[np.ndarray, "3 3"]
    bending: Float64[np.ndarray, "3 3"]
    work: Float64[np.ndarray, "3 3"]


@kernel()
@no_type_check
def _new_state() -> PointState:
    return PointState(
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(2),
        np.empty(2),
        np.empty(3),
        np.empty(3),
        np.empty(2),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, 3)),
    )


@inlined_kernel(fastmath=True)
@no_type_check
def _set_moduli(
    out: Float64[np.ndarray, "3 3"],
    scale: float,
    sign: float,
    first: tuple[float, float, float, float, float, float],
    second: tuple[float, float, float, float, float, float],
) -> None:
    """scale (first + sign second) as a matrix, from components 11, 22, 33, 12, 13, 23."""
    out[0, 0] = scale * (first[0] + sign * second[0])
    out[1, 1] = scale * (first[1] + sign * second[1])
    out[2, 2] = scale * (first[2] + sign * second[2])
    out[0, 1] = out[1, 0] = scale * (first[3] + sign * second[3])
    out[0, 2] = out[2, 0] = scale * (first[4] + sign * second[4])
    out[1, 2] = out[2, 1] = scale * (first[5] + sign * second[5])


@inlined_kernel(fastmath=True)
@no_type_check
def _set_plane_factors(at: int, state: PointState, curved: float, factors: Factors) -> None:
    """Set the factors of the displacements along x and y, and their coupling with curvatures, at a point."""
    a1, a2, c, d, stretch = state.a1, state.a2, state.membrane, state.mixed, state.stretch
    plane, coupling = factors.plane, factors.coupling
    for i in range(2):
        for j in range(2):
            p, q, r, s = a1[i] * a1[j], a1[i] * a2[j], a2[i] * a1[j], a2[i] * a2[j]
            same = 1.0 if i == j else 0.0
            plane[at, i, j, 0, 0] = c[0, 0] * p + c[0, 2] * (q + r) + c[2, 2] * s + same * stretch[0]
            plane[at, i, j, 0, 1] = c[0, 1] * q + c[0, 2] * p + c[1, 2] * s + c[2, 2] * r + same * stretch[2]
            plane[at, i, j, 1, 0] = c[0, 1] * r + c[0, 2] * p + c[1, 2] * s + c[2, 2] * q + same * stretch[2]
            plane[at, i, j, 1, 1] = c[1, 1] * s + c[1, 2] * (q + r) + c[2, 2] * p + same * stretch[1]
        for k in range(3):
            scale = 2.0 * curved if k == 2 else curved
            coupling[at, i, 0, 2 + k] = scale * (a1[i] * d[0, k] + a2[i] * d[2, k])
            coupling[at, i, 1, 2 + k] = scale * (a2[i] * d[1, k] + a1[i] * d[2, k])


@inlined_kernel(fastmath=True)
@no_type_check
def _set_deflection_factors(
    at: int, state: PointState, cosines: tuple[float, float], shear: tuple[float, float], factors: Factors
) -> None:
    """Set the factors of the derivatives of b at a point, and their coupling with the other displacements.

    The slope of b is that of the deflection and a grad lap b.

    Args:
        at: the point.
        state: of the sheet there.
        cosines: squared, of the slopes of b and of the deflection.
        shear: a, and the stiffness of the gradient of the Laplacian times the weight of the point.
        factors: result.
    """
    a1, a2, curvature, bend, fibre = state.a1, state.a2, state.curvature, state.bend, state.fibre
    bending_moment, push, coupling, deflection = (
        state.bending_moment,
        state.push,
        factors.coupling,
        factors.deflection,
    )
    (c, g), (a, stiffness) = cosines, shear
    strain, force, couple = state.work[0], state.work[1], state.work[2]
    work = pushed = 0.0
    for k in range(3):
        work += bending_moment[k] * curvature[k]
    for k in range(2):
        pushed += push[k] * bend[k]
    # second derivatives of the energy by the slope of b that are due to those of its cosine, and by that of w
    turned, turned_both = -2.0 * c * c * work, 8.0 * c * c * c * work
    shifted, shifted_both = -g * pushed, 4.0 * g * g * pushed
    for side in range(2):
        turn, shift = -2.0 * c * c * fibre[side], -2.0 * g * (a1[2] if side == 0 else a2[2])
        strain[0] = a1[2] if side == 0 else 0.0
        strain[1] = a2[2] if side == 1 else 0.0
        strain[2] = a2[2] if side == 0 else a1[2]
        # first, a unit of lx or ly, over a: only the curvatures of the strain change
        bent = 0.0
        for k in range(3):
            force[k] = couple[k] = 0.0
            for m in range(3):
                force[k] += state.mixed[k, m] * turn * curvature[m]
                couple[k] += state.bending[k, m] * turn * curvature[m]
            bent += couple[k] * curvature[k]
            double = 2.0 if k == 2 else 1.0
            deflection[at, 5 + side, 2 + k] = a * double * (c * couple[k] + turn * bending_moment[k])
        for k in range(2):
            other = -2.0 * c * c * fibre[k]
            deflection[at, 5 + side, 5 + k] = a * a * (other * bent + turned_both * fibre[side] * fibre[k])
        deflection[at, 5 + side, 5 + side] += a * a * turned + g * stiffness
        for i in range(2):
            coupling[at, i, 0, 5 + side] = a * (a1[i] * force[0] + a2[i] * force[2])
            coupling[at, i, 1, 5 + side] = a * (a2[i] * force[1] + a1[i] * force[2])
        # then a unit of wx or wy: also the strain of the middle surface
        bent = 0.0
        for k in range(3):
            for m in range(3):
                force[k] += state.membrane[k, m] * strain[m]
                couple[k] += state.mixed[k, m] * strain[m]
            bent += couple[k] * curvature[k]
            double = 2.0 if k == 2 else 1.0
            deflection[at, side, 2 + k] = double * (c * couple[k] + turn * bending_moment[k])
        for k in range(2):
            other = -2.0 * c * c * fibre[k]
            both = other * bent + turned_both * fibre[side] * fibre[k]
            own, across = (a1[2], a2[2]) if k == 0 else (a2[2], a1[2])
            deflection[at, side, k] = (
                own * force[k]
                + across * force[2]
                + both
                + shifted_both * (a1[2] if side == 0 else a2[2]) * own
                + state.stretch[k if side == k else 2]
            )
            deflection[at, side, 5 + k] = a * both + shift * push[k]
        deflection[at, side, side] += turned + shifted
        deflection[at, side, 5 + side] += a * turned
        for i in range(2):
            coupling[at, i, 0, side] = a1[i] * force[0] + a2[i] * force[2]
            coupling[at, i, 1, side] = a2[i] * force[1] + a1[i] * force[2]
    for k in range(3):
        for m in range(3):
            double = (2.0 if k == 2 else 1.0) * (2.0 if m == 2 else 1.0)
            deflection[at, 2 + k, 2 + m] = double * c * c * state.bending[k, m]
    for side in range(2):
        for row in range(2, 7):
            deflection[at, row, side] = deflection[at, side, row]
        for row in range(2, 5):
            deflection[at, row, 5 + side] = deflection[at, 5 + side, row]


@inlined_kernel(fastmath=True)
@no_type_check
def _sum_plane(
    factor: Float[np.ndarray, "9 2 c"],
    count: int,
    plane: Float[np.ndarray, "18 16"],
    left: Float[np.ndarray, "63 16"],
) -> None:
    """Sums over the derivatives of the displacement along x or y, for `count` derivatives of another one."""
    for at in range(POINTS):
        by_x, by_y = plane[at], plane[POINTS + at]
        for column in range(count):
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
def _evaluate(
    element: tuple[Float64[np.ndarray, "3 16"], Tables],
    at: int,
    weight: float,
    stiffness: Stiffness,
    state: PointState,
) -> tuple[float, float]:
    """Set the state at Gauss point `at` of an element, whose coefficients and tables are given.

    Returns:
        `squared_cosine` of the slopes of b and of the deflection.
    """
    local, tables = element
    t, mu, bulk, tension, lever, shear, shear_stiffness = stiffness
    a1, a2, curvature, bend, fibre, stretch, bending_moment, push, membrane, mixed, bending, _ = state
    a1[0], a1[1], a1[2], a2[0], a2[1], a2[2], k1, k2, k3, l1, l2 = strain(local, tables, at)
    e1 = 0.5 * (a1[0] * a1[0] + a1[1] * a1[1] + a1[2] * a1[2] - 1.0)
    e2 = 0.5 * (a2[0] * a2[0] + a2[1] * a2[1] + a2[2] * a2[2] - 1.0)
    e3 = a1[0] * a2[0] + a1[1] * a2[1] + a1[2] * a2[2]
    fibre[0], fibre[1] = a1[2] + shear * l1, a2[2] + shear * l2
    c, g = squared_cosine(fibre[0], fibre[1]), squared_cosine(a1[2], a2[2])
    z, half = lever * c, 0.5 * t * weight
    p = stress_and_tangent(e1 + z * k1, e2 + z * k2, e3 + z * k3, mu, bulk)
    q = stress_and_tangent(e1 - z * k1, e2 - z * k2, e3 - z * k3, mu, bulk)
    arm, sheared = half * lever, weight * shear_stiffness
    curvature[0], curvature[1], curvature[2], bend[0], bend[1] = k1, k2, k3, l1, l2
    for k in range(3):
        stretch[k] = half * (p[k] + q[k]) + (weight * tension if k < 2 else 0.0)
        bending_moment[k] = arm * (p[k] - q[k])
    push[0], push[1] = sheared * g * l1, sheared * g * l2
    _set_moduli(membrane, half, 1.0, p[3:], q[3:])
    _set_moduli(mixed, arm, -1.0, p[3:], q[3:])
    _set_moduli(bending, arm * lever, 1.0, p[3:], q[3:])
    return c, g


@inlined_kernel(fastmath=True)
@no_type_check
def _add_force(
    state: PointState,
    tables: Tables,
    at: int,
    cosines: tuple[float, float],
    shear: float,
    element: Float64[np.ndarray, "3 16"],
) -> None:
    """Add the nodal forces of a Gauss point to those of its element; a is `shear`, see `_evaluate`."""
    nx, ny, wx, wy, nxx, nyy, nxy, lx, ly = tables
    a1, a2, bending_moment, push, fibre = state.a1, state.a2, state.bending_moment, state.push, state.fibre
    s1, s2, s3 = state.stretch[0], state.stretch[1], state.stretch[2]
    c, g = cosines
    shift, turn = -g * (push[0] * state.bend[0] + push[1] * state.bend[1]), 0.0
    for k in range(3):
        turn += bending_moment[k] * state.curvature[k]
    turn *= -2.0 * c * c
    push_x, push_y = push[0] + turn * shear * fibre[0], push[1] + turn * shear * fibre[1]
    by_wx = s1 * a1[2] + s3 * a2[2] + shift * a1[2] + turn * fibre[0]
    by_wy = s3 * a1[2] + s2 * a2[2] + shift * a2[2] + turn * fibre[1]
    for k in range(LOCAL):
        by_x, by_y = nx[at, k], ny[at, k]
        element[0, k] += (s1 * a1[0] + s3 * a2[0]) * by_x + (s3 * a1[0] + s2 * a2[0]) * by_y
        element[1, k] += (s1 * a1[1] + s3 * a2[1]) * by_x + (s3 * a1[1] + s2 * a2[1]) * by_y
        element[2, k] += by_wx * wx[at, k] + by_wy * wy[at, k]
        bent = (
            bending_moment[0] * nxx[at, k]
            + bending_moment[1] * nyy[at, k]
            + 2.0 * bending_moment[2] * nxy[at, k]
        )
        element[2, k] += c * bent + push_x * lx[at, k] + push_y * ly[at, k]


@inlined_kernel(fastmath=True)
@no_type_check
def _sum_factors(
    component: tuple[int, int],
    factors: Factors,
    plane: Float[np.ndarray, "18 16"],
    deflection: Float[np.ndarray, "63 16"],
    left: Float[np.ndarray, "63 16"],
) -> int:
    """Sums over the derivatives of component i, one row for each derivative of component j at each point.

    They are written to `left`; returns the number of rows.
    """
    i, j = component
    if i < 2 and j < 2:
        _sum_plane(factors.plane[:, i, j], 2, plane, left)
        return 2 * POINTS
    if i < 2:
        _sum_plane(factors.coupling[:, i], 7, plane, left)
        return 7 * POINTS
    if j < 2:
        _sum_deflection(factors.coupling[:, j], deflection, left)
        return 2 * POINTS
    _sum_deflection(factors.deflection, deflection, left)
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
    element, matrix = np.empty((3, LOCAL)), np.empty((LOCAL, LOCAL), kind)
    left = np.empty((7 * POINTS, LOCAL), kind)
    plane, deflection = np.empty((2 * POINTS, LOCAL), kind), np.empty((7 * POINTS, LOCAL), kind)
    flat, flat_left, flat_tangent = matrix.reshape(-1), left.reshape(-1), tangent.reshape(-1)
    flat_plane, flat_deflection = plane.reshape(-1), deflection.reshape(-1)
    factors = Factors(
        np.empty((POINTS, 2, 2, 2, 2), kind),
        np.empty((POINTS, 2, 2, 7), kind),
        np.empty((POINTS, 7, 7), kind),
    )
    state = _new_state()
    force[:] = 0.0
    tangent[:] = 0.0
    for es in range(elements.slow.shape[0]):
        for ef in range(elements.fast.shape[0]):
            gather(coefficient, elements, es, ef, local)
            tabulate(elements, es, ef, stiffness.shear, tables)
            element[:] = 0.0
            for at in range(POINTS):
                weight = elements.weight[at]
                cosines = _evaluate((local, tables), at, weight, stiffness, state)
                _add_force(state, tables, at, cosines, stiffness.shear, element)
                _set_plane_factors(at, state, cosines[0], factors)
                shear = (stiffness.shear, weight * stiffness.shear_stiffness)
                _set_deflection_factors(at, state, cosines, shear, factors)
            for row, table in enumerate((nx, ny)):
                plane[row * POINTS : (row + 1) * POINTS] = table
            for row, table in enumerate((wx, wy, nxx, nyy, nxy, lx, ly)):
                deflection[row * POINTS : (row + 1) * POINTS] = table
            first = (es - elements.dropped, ef - elements.dropped)
            for i in range(3):
                for j in range(3):
                    count = _sum_factors((i, j), factors, plane, deflection, left)
                    right = flat_deflection if j == 2 else flat_plane
                    matrix[:] = 0.0
                    for row in range(0, LOCAL, ROWS):
                        to = At(row * LOCAL, LOCAL)
                        add_product_16(flat, to, flat_left, At(row, LOCAL), right, At(0, LOCAL), count)
                    _scatter_tangent(matrix, (i, j), first, elements.shape, flat_tangent)
            scatter_force(element, elements, es, ef, force)
    clear_outside(elements.shape, tangent)
