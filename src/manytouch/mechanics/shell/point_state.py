"""State of the shell at a Gauss point: forces and moments, and their derivatives, compiled.

Derivation and symbols: docs/derivations/mechanics.md. b is the bending deflection, mm, and w = b - a lap b
the deflection. Forces and moments are functions of six slopes, those of u, v and b along x and y: slope
2 i + s is that of component i along direction s. Of b, the strains depend on the slopes of w, and the
curvatures on those of b, which the slopes of w and grad lap b change.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.mechanics.shell.kernels import (
    Stiffness,
    Tables,
    curvatures,
    fibre_normal,
    plane_second_derivatives,
    shear_ratio,
    strain,
    stretch_by_curvature,
)
from manytouch.mechanics.shell.material import stress_and_tangent


class PointState(NamedTuple):
    """State of the sheet at a Gauss point. W is its energy over E, mm^3: that per area times its weight.

    Attributes:
        second: (3, 3) second derivatives xx, yy and twice xy (columns) of u, v and b (rows), 1/mm.
        normal: (3,) cross product of the base vectors with slopes of b, over its squared length.
        by_slope: (6, 3) its numerator by the slopes.
        stretch_by: (6,) its squared length by the slopes, over it.
        turn: (6, 3) derivatives of the curvatures of the strain by slope g and a second derivative of
            component c: those by second derivatives are `normal`.
        strain_by, curvature_by: (3, 6) derivatives of the strains E11, E22, 2 E12 and of the curvatures 11,
            22 and twice 12 of the strain by the slopes.
        force_by, bending_moment_by: (3, 6) of `force` and `bending_moment`.
        force, bending_moment: (3,) derivatives of W by the strains and by the curvatures of the strain.
        shear_force: (2,) derivatives of W by grad lap b.
        membrane, mixed, bending: (3, 3) derivatives of `force` by the strains and by the curvatures of the
            strain, and of `bending_moment` by the latter.
        shear_by_strain: (2, 3) derivatives of `shear_force` by the strains.
        slopes: (6, 6) second derivatives of W by the slopes at constant strains: what is due to those of the
            curvatures of the strain.
        work: (3, 3) work space.
    """

    second: Float64[np.ndarray, "3 3"]
    normal: Float64[np.ndarray, "3"]
    by_slope: Float64[np.ndarray, "6 3"]
    stretch_by: Float64[np.ndarray, "6"]
    turn: Float64[np.ndarray, "6 3"]
    strain_by: Float64[np.ndarray, "3 6"]
    curvature_by: Float64[np.ndarray, "3 6"]
    force_by: Float64[np.ndarray, "3 6"]
    bending_moment_by: Float64[np.ndarray, "3 6"]
    force: Float64[np.ndarray, "3"]
    bending_moment: Float64[np.ndarray, "3"]
    shear_force: Float64[np.ndarray, "2"]
    membrane: Float64[np.ndarray, "3 3"]
    mixed: Float64[np.ndarray, "3 3"]
    bending: Float64[np.ndarray, "3 3"]
    shear_by_strain: Float64[np.ndarray, "2 3"]
    slopes: Float64[np.ndarray, "6 6"]
    work: Float64[np.ndarray, "3 3"]


@kernel()
@no_type_check
def new_state() -> PointState:
    return PointState(
        np.empty((3, 3)),
        np.empty(3),
        np.empty((6, 3)),
        np.empty(6),
        np.empty((6, 3)),
        np.empty((3, 6)),
        np.empty((3, 6)),
        np.empty((3, 6)),
        np.empty((3, 6)),
        np.empty(3),
        np.empty(3),
        np.empty(2),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((2, 3)),
        np.empty((6, 6)),
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
def evaluate(
    element: tuple[Float64[np.ndarray, "3 16"], Tables],
    at: int,
    weight: float,
    stiffness: Stiffness,
    state: PointState,
) -> float:
    """Set the state at Gauss point `at` of an element, whose coefficients and tables are given.

    Returns:
        The derivative of the shear force by grad lap b.
    """
    local, tables = element
    t, mu, bulk, tension, lever, stretch, shear, shear_stiffness = stiffness
    a10, a11, a12, a20, a21, a22, w1, w2, w3, l1, l2 = strain(local, tables, at)
    e1 = 0.5 * (a10 * a10 + a11 * a11 + a12 * a12 - 1.0)
    e2 = 0.5 * (a20 * a20 + a21 * a21 + a22 * a22 - 1.0)
    e3 = a10 * a20 + a11 * a21 + a12 * a22
    first, last = (a10, a11, a12 + shear * l1), (a20, a21, a22 + shear * l2)
    normal = fibre_normal(first, last)
    in_plane = plane_second_derivatives(local, tables, at)
    k1, k2, k3, c = curvatures(normal, (w1, w2, w3), in_plane)
    for k in range(3):
        state.second[0, k], state.second[1, k] = in_plane[0][k], in_plane[1][k]
        state.normal[k] = c * normal[k]
    state.second[2, 0], state.second[2, 1], state.second[2, 2] = w1, w2, w3
    g, half = shear_ratio(e1, e2, e3), 0.5 * t * weight
    arm, sheared = half * lever, weight * shear_stiffness * g
    h1, h2, h3 = stretch_by_curvature(k1, k2, k3, stretch)
    f1, f2, f3 = e1 + h1, e2 + h2, e3 + h3
    z1, z2, z3 = lever * k1, lever * k2, lever * k3
    p = stress_and_tangent(f1 + z1, f2 + z2, f3 + z3, mu, bulk)
    q = stress_and_tangent(f1 - z1, f2 - z2, f3 - z3, mu, bulk)
    for k in range(3):
        state.force[k] = half * (p[k] + q[k]) + (weight * tension if k < 2 else 0.0)
        state.bending_moment[k] = arm * (p[k] - q[k])
    _set_moduli(state.membrane, half, 1.0, p[3:], q[3:])
    _set_moduli(state.mixed, arm, -1.0, p[3:], q[3:])
    _set_moduli(state.bending, arm * lever, 1.0, p[3:], q[3:])
    _add_stretch(state, stretch, (k1, k2, k3))
    state.shear_force[0], state.shear_force[1] = sheared * l1, sheared * l2
    _add_shear(state, (e1, e2, e3), g, 0.5 * sheared * (l1 * l1 + l2 * l2))
    _set_strain_derivatives(state, (a10, a11, a12), (a20, a21, a22))
    _set_curvature_derivatives(state, first, last, c, (k1, k2, k3))
    _set_force_derivatives(state)
    return sheared


@inlined_kernel(fastmath=True)
@no_type_check
def _set_strain_derivatives(
    state: PointState, a1: tuple[float, float, float], a2: tuple[float, float, float]
) -> None:
    """Set derivatives of the strains by the slopes, with base vectors that have slopes of w."""
    for i in range(3):
        state.strain_by[0, 2 * i], state.strain_by[0, 2 * i + 1] = a1[i], 0.0
        state.strain_by[1, 2 * i], state.strain_by[1, 2 * i + 1] = 0.0, a2[i]
        state.strain_by[2, 2 * i], state.strain_by[2, 2 * i + 1] = a2[i], a1[i]


@inlined_kernel(fastmath=True)
@no_type_check
def _set_curvature_derivatives(
    state: PointState,
    a1: tuple[float, float, float],
    a2: tuple[float, float, float],
    c: float,
    curvature: tuple[float, float, float],
) -> None:
    """Set derivatives of the curvatures of the strain, and second ones of W that are due to them.

    Args:
        state: with `second`, `normal` and `bending_moment`.
        a1, a2: base vectors with slopes of b.
        c: 1 over the squared length of their cross product.
        curvature: of the strain: 11, 22 and twice 12.
    """
    by, second, normal, bending_moment = state.by_slope, state.second, state.normal, state.bending_moment
    # e_i x a2 and a1 x e_i
    by[0, 0], by[0, 1], by[0, 2] = 0.0, -a2[2], a2[1]
    by[1, 0], by[1, 1], by[1, 2] = 0.0, a1[2], -a1[1]
    by[2, 0], by[2, 1], by[2, 2] = a2[2], 0.0, -a2[0]
    by[3, 0], by[3, 1], by[3, 2] = -a1[2], 0.0, a1[0]
    by[4, 0], by[4, 1], by[4, 2] = -a2[1], a2[0], 0.0
    by[5, 0], by[5, 1], by[5, 2] = a1[1], -a1[0], 0.0
    bent = (
        bending_moment[0] * curvature[0] + bending_moment[1] * curvature[1] + bending_moment[2] * curvature[2]
    )
    m0, m1, m2 = c * bending_moment[0], c * bending_moment[1], c * bending_moment[2]
    pull0 = m0 * second[0, 0] + m1 * second[0, 1] + m2 * second[0, 2]
    pull1 = m0 * second[1, 0] + m1 * second[1, 1] + m2 * second[1, 2]
    pull2 = m0 * second[2, 0] + m1 * second[2, 1] + m2 * second[2, 2]
    for g in range(6):
        b0, b1, b2 = by[g, 0], by[g, 1], by[g, 2]
        grow = 2.0 * (normal[0] * b0 + normal[1] * b1 + normal[2] * b2)
        state.stretch_by[g] = grow
        for i in range(3):
            state.turn[g, i] = c * by[g, i] - grow * normal[i]
        for k in range(3):
            turned = b0 * second[0, k] + b1 * second[1, k] + b2 * second[2, k]
            state.curvature_by[k, g] = c * turned - curvature[k] * grow
        pulled = pull0 * b0 + pull1 * b1 + pull2 * b2 - bent * grow
        twice = 2.0 * bent * c
        for h in range(g + 1):
            other = state.stretch_by[h]
            o0, o1, o2 = by[h, 0], by[h, 1], by[h, 2]
            pulled_h = pull0 * o0 + pull1 * o1 + pull2 * o2
            product = b0 * o0 + b1 * o1 + b2 * o2
            total = -pulled * other - pulled_h * grow + bent * grow * other - twice * product
            state.slopes[g, h] = state.slopes[h, g] = total
    v0, v1, v2 = (
        pull0 - 2.0 * bent * normal[0],
        pull1 - 2.0 * bent * normal[1],
        pull2 - 2.0 * bent * normal[2],
    )
    # second derivatives of the cross product by slopes of two components, one along x and one along y
    _add_both(state.slopes, 2, 5, v0)
    _add_both(state.slopes, 4, 3, -v0)
    _add_both(state.slopes, 4, 1, v1)
    _add_both(state.slopes, 0, 5, -v1)
    _add_both(state.slopes, 0, 3, v2)
    _add_both(state.slopes, 2, 1, -v2)


@inlined_kernel(fastmath=True)
@no_type_check
def _add_both(matrix: Float64[np.ndarray, "6 6"], g: int, h: int, value: float) -> None:
    matrix[g, h] += value
    matrix[h, g] += value


@inlined_kernel(fastmath=True)
@no_type_check
def _set_force_derivatives(state: PointState) -> None:
    """Set derivatives of forces and moments by the slopes."""
    strain_by, curvature_by, mixed = state.strain_by, state.curvature_by, state.mixed
    for k in range(3):
        for g in range(6):
            force = bending_moment = 0.0
            for m in range(3):
                force += state.membrane[k, m] * strain_by[m, g] + mixed[k, m] * curvature_by[m, g]
                bending_moment += mixed[m, k] * strain_by[m, g] + state.bending[k, m] * curvature_by[m, g]
            state.force_by[k, g], state.bending_moment_by[k, g] = force, bending_moment


@inlined_kernel(fastmath=True)
@no_type_check
def _add_shear(state: PointState, strains: tuple[float, float, float], g: float, energy: float) -> None:
    """Add what is due to the change of the energy of shear by the strains of the middle surface.

    Args:
        state: with `shear_force`.
        strains: E11, E22, 2 E12, without those by curvature.
        g: `kernels.shear_ratio`.
        energy: of shear.
    """
    e1, e2, e3 = strains
    by1, by2, by3 = 2.0 * g * (1.0 + 2.0 * e2), 2.0 * g * (1.0 + 2.0 * e1), -2.0 * g * e3
    force, membrane = state.force, state.membrane
    force[0], force[1], force[2] = force[0] - energy * by1, force[1] - energy * by2, force[2] - energy * by3
    for side in range(2):
        pull, by_strain = state.shear_force[side], state.shear_by_strain[side]
        by_strain[0], by_strain[1], by_strain[2] = -pull * by1, -pull * by2, -pull * by3
    twice = 2.0 * energy
    membrane[0, 0] += twice * by1 * by1
    membrane[1, 1] += twice * by2 * by2
    membrane[2, 2] += twice * (by3 * by3 + g)
    membrane[0, 1] += twice * (by1 * by2 - 2.0 * g)
    membrane[0, 2] += twice * by1 * by3
    membrane[1, 2] += twice * by2 * by3
    membrane[1, 0], membrane[2, 0], membrane[2, 1] = membrane[0, 1], membrane[0, 2], membrane[1, 2]


@inlined_kernel(fastmath=True)
@no_type_check
def _add_stretch(state: PointState, stretch: float, curvature: tuple[float, float, float]) -> None:
    """Add what is due to the strain by the squared curvature, `kernels.stretch_by_curvature`.

    Args:
        state: with `bending_moment`, `mixed` and `bending` without it.
        stretch: Q.
        curvature: of the strain: 11, 22 and twice 12.
    """
    force, by_curvature = state.force, state.work
    membrane, mixed, bending = state.membrane, state.mixed, state.bending
    k1, k2, k3 = stretch * curvature[0], stretch * curvature[1], stretch * curvature[2]
    # of the strains (rows) by the curvatures of the strain
    by_curvature[0, 0], by_curvature[0, 1], by_curvature[0, 2] = k1, 0.0, 0.25 * k3
    by_curvature[1, 0], by_curvature[1, 1], by_curvature[1, 2] = 0.0, k2, 0.25 * k3
    by_curvature[2, 0], by_curvature[2, 1], by_curvature[2, 2] = 0.5 * k3, 0.5 * k3, 0.5 * (k1 + k2)
    for m in range(3):
        for n in range(3):
            # `mixed` still lacks what is added to it below
            for i in range(3):
                change = mixed[i, m] * by_curvature[i, n] + mixed[i, n] * by_curvature[i, m]
                for j in range(3):
                    change += by_curvature[i, m] * membrane[i, j] * by_curvature[j, n]
                bending[m, n] += change
    for m in range(3):
        for j in range(3):
            state.bending_moment[m] += force[j] * by_curvature[j, m]
            for i in range(3):
                mixed[i, m] += membrane[i, j] * by_curvature[j, m]
    bending[0, 0] += stretch * force[0]
    bending[1, 1] += stretch * force[1]
    bending[2, 2] += 0.25 * stretch * (force[0] + force[1])
    for m in range(2):
        bending[m, 2] += 0.5 * stretch * force[2]
        bending[2, m] += 0.5 * stretch * force[2]
