"""Second derivatives of the energy of the shell at a Gauss point, as factors of its tangent, compiled.

Derivation: docs/derivations/mechanics.md. Derivatives of b are those of `kernels.Tables`, in its order.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float64

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.mechanics.shell.kernels import LOCAL, Stiffness, Tables, squared_cosine, strain
from manytouch.mechanics.shell.material import stress_and_tangent


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


class Slopes(NamedTuple):
    """Slopes at a Gauss point.

    Attributes:
        fibre, deflection: `squared_cosine` of the slopes of b and of the deflection.
        shear: a; the slope of b is that of the deflection and a grad lap b.
    """

    fibre: float
    deflection: float
    shear: float


@kernel()
@no_type_check
def new_state() -> PointState:
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
def set_plane_factors(at: int, state: PointState, curved: float, factors: Factors) -> None:
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
def _set_fibre_factors(at: int, side: int, state: PointState, slopes: Slopes, factors: Factors) -> None:
    """Set the factors of lx or ly that are due to the slope of b.

    A unit of lx is a of the slope of b, which changes the curvatures of the strain. What these do to forces
    and moments is left in `state.work`, for a unit of the slope.
    """
    a1, a2, curvature, fibre = state.a1, state.a2, state.curvature, state.fibre
    coupling, deflection, c, a = factors.coupling, factors.deflection, slopes.fibre, slopes.shear
    force, couple = state.work[1], state.work[2]
    turn, bent = -2.0 * c * c * fibre[side], 0.0
    for k in range(3):
        force[k] = couple[k] = 0.0
        for m in range(3):
            force[k] += state.mixed[k, m] * turn * curvature[m]
            couple[k] += state.bending[k, m] * turn * curvature[m]
        bent += couple[k] * curvature[k]
        double = 2.0 * a if k == 2 else a
        deflection[at, 5 + side, 2 + k] = double * (c * couple[k] + turn * state.bending_moment[k])
    for k in range(2):
        deflection[at, 5 + side, 5 + k] = -2.0 * a * a * c * c * fibre[k] * bent
    for i in range(2):
        coupling[at, i, 0, 5 + side] = a * (a1[i] * force[0] + a2[i] * force[2])
        coupling[at, i, 1, 5 + side] = a * (a2[i] * force[1] + a1[i] * force[2])


@inlined_kernel(fastmath=True)
@no_type_check
def _set_slope_factors(at: int, side: int, state: PointState, slopes: Slopes, factors: Factors) -> None:
    """Set the factors of wx or wy; after `_set_fibre_factors`, whose results in `state.work` it uses."""
    a1, a2, curvature, fibre = state.a1, state.a2, state.curvature, state.fibre
    coupling, deflection, c, a = factors.coupling, factors.deflection, slopes.fibre, slopes.shear
    strain, force, couple = state.work[0], state.work[1], state.work[2]
    turn, slope = -2.0 * c * c * fibre[side], a1[2] if side == 0 else a2[2]
    strain[0] = a1[2] if side == 0 else 0.0
    strain[1] = a2[2] if side == 1 else 0.0
    strain[2] = a2[2] if side == 0 else a1[2]
    bent = 0.0
    for k in range(3):
        for m in range(3):
            force[k] += state.membrane[k, m] * strain[m]
            couple[k] += state.mixed[k, m] * strain[m]
        bent += couple[k] * curvature[k]
        double = 2.0 if k == 2 else 1.0
        deflection[at, side, 2 + k] = double * (c * couple[k] + turn * state.bending_moment[k])
    deflection[at, side, 0] = a1[2] * force[0] + a2[2] * force[2]
    deflection[at, side, 1] = a2[2] * force[1] + a1[2] * force[2]
    for k in range(2):
        turned = -2.0 * c * c * fibre[k] * bent
        deflection[at, side, k] += turned + state.stretch[k if side == k else 2]
        deflection[at, side, 5 + k] = a * turned - 2.0 * slopes.deflection * slope * state.push[k]
    for i in range(2):
        coupling[at, i, 0, side] = a1[i] * force[0] + a2[i] * force[2]
        coupling[at, i, 1, side] = a2[i] * force[1] + a1[i] * force[2]


@inlined_kernel(fastmath=True)
@no_type_check
def _add_second_derivatives(at: int, state: PointState, slopes: Slopes, factors: Factors) -> None:
    """Add what is due to the second derivatives of both cosines by the slopes."""
    deflection, fibre = factors.deflection, state.fibre
    c, g, a = slopes
    w = (state.a1[2], state.a2[2])
    work = pushed = 0.0
    for k in range(3):
        work += state.bending_moment[k] * state.curvature[k]
    for k in range(2):
        pushed += state.push[k] * state.bend[k]
    for i in range(2):
        for k in range(2):
            same = 1.0 if i == k else 0.0
            turned = 2.0 * c * c * work * (4.0 * c * fibre[i] * fibre[k] - same)
            deflection[at, i, k] += turned + g * pushed * (4.0 * g * w[i] * w[k] - same)
            deflection[at, i, 5 + k] += a * turned
            deflection[at, 5 + i, 5 + k] += a * a * turned


@inlined_kernel(fastmath=True)
@no_type_check
def set_deflection_factors(
    at: int, state: PointState, slopes: Slopes, sheared: float, factors: Factors
) -> None:
    """Set the factors of the derivatives of b at a point, and their coupling with the other displacements.

    Args:
        at: the point.
        state: of the sheet there.
        slopes: see `Slopes`.
        sheared: stiffness of the gradient of the Laplacian times the weight of the point.
        factors: result.
    """
    deflection, c = factors.deflection, slopes.fibre
    for side in range(2):
        _set_fibre_factors(at, side, state, slopes, factors)
        _set_slope_factors(at, side, state, slopes, factors)
    _add_second_derivatives(at, state, slopes, factors)
    for k in range(3):
        for m in range(3):
            double = (2.0 if k == 2 else 1.0) * (2.0 if m == 2 else 1.0)
            deflection[at, 2 + k, 2 + m] = double * c * c * state.bending[k, m]
    for side in range(2):
        deflection[at, 5 + side, 5 + side] += slopes.deflection * sheared
        for row in range(2, 7):
            deflection[at, row, side] = deflection[at, side, row]
        for row in range(2, 5):
            deflection[at, row, 5 + side] = deflection[at, 5 + side, row]


@inlined_kernel(fastmath=True)
@no_type_check
def evaluate(
    element: tuple[Float64[np.ndarray, "3 16"], Tables],
    at: int,
    weight: float,
    stiffness: Stiffness,
    state: PointState,
) -> Slopes:
    """Set the state at Gauss point `at` of an element, whose coefficients and tables are given."""
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
    return Slopes(c, g, shear)


@inlined_kernel(fastmath=True)
@no_type_check
def add_force(
    state: PointState,
    tables: Tables,
    at: int,
    slopes: Slopes,
    element: Float64[np.ndarray, "3 16"],
) -> None:
    """Add the nodal forces of a Gauss point to those of its element."""
    nx, ny, wx, wy, nxx, nyy, nxy, lx, ly = tables
    a1, a2, bending_moment, push, fibre = state.a1, state.a2, state.bending_moment, state.push, state.fibre
    s1, s2, s3 = state.stretch[0], state.stretch[1], state.stretch[2]
    c, g, a = slopes
    shift, turn = -g * (push[0] * state.bend[0] + push[1] * state.bend[1]), 0.0
    for k in range(3):
        turn += bending_moment[k] * state.curvature[k]
    turn *= -2.0 * c * c
    push_x, push_y = push[0] + turn * a * fibre[0], push[1] + turn * a * fibre[1]
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
