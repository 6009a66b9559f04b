"""Forces and second derivatives of the energy of the shell at a Gauss point, compiled.

Derivation and symbols: docs/derivations/mechanics.md. b is the bending deflection, mm, w = b - a lap b the
deflection, c and g the squared cosines of their slopes (`SlopeCosines`). The seven derivatives of b on which
the energy depends are in the order of `kernels.Tables`: wx, wy, xx, yy, xy, lx, ly.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float64

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.mechanics.shell.kernels import (
    LOCAL,
    Stiffness,
    Tables,
    squared_cosine,
    strain,
    stretch_by_curvature,
)
from manytouch.mechanics.shell.material import stress_and_tangent


class SecondDerivatives(NamedTuple):
    """Second derivatives of the energy W per area over E, mm, at the Gauss points p of an element, weighted.

    They are the A of the derivation, from which the tangent is assembled. i, j are components x, y of the
    displacement u in the plane, s, t directions x, y of its derivatives, and m, n derivatives of b.

    Attributes:
        plane: (9, 2, 2, 2, 2) plane[p, i, j, s, t] = weight d2W / d(u_i,s) d(u_j,t).
        coupling: (9, 2, 2, 7) coupling[p, i, s, m] = weight d2W / d(u_i,s) d(b_m).
        deflection: (9, 7, 7) deflection[p, m, n] = weight d2W / d(b_m) d(b_n).
    """

    plane: Float[np.ndarray, "9 2 2 2 2"]
    coupling: Float[np.ndarray, "9 2 2 7"]
    deflection: Float[np.ndarray, "9 7 7"]


class PointState(NamedTuple):
    """State of the sheet at a Gauss point. W is its energy over E, mm^3: that per area times its weight.

    Attributes:
        a1, a2: (3,) base vectors of the middle surface.
        curvature: (3,) second derivatives of b: xx, yy and twice xy, 1/mm.
        laplacian_gradient: (2,) grad lap b, 1/mm^2.
        b_slope: (2,) grad b, on which fibres stand.
        membrane_force: (3,) derivatives of W by the strains E11, E22 and 2 E12.
        bending_moment: (3,) derivatives of W by the curvatures of the strain, c times `curvature`.
        shear_force: (2,) derivatives of W by `laplacian_gradient`.
        membrane, mixed, bending: (3, 3) derivatives of `membrane_force` by the strains and by the curvatures
            of the strain, and of `bending_moment` by the latter, in the order 11, 22, 12.
        work: (3, 3) work space.
    """

    a1: Float64[np.ndarray, "3"]
    a2: Float64[np.ndarray, "3"]
    curvature: Float64[np.ndarray, "3"]
    laplacian_gradient: Float64[np.ndarray, "2"]
    b_slope: Float64[np.ndarray, "2"]
    membrane_force: Float64[np.ndarray, "3"]
    bending_moment: Float64[np.ndarray, "3"]
    shear_force: Float64[np.ndarray, "2"]
    membrane: Float64[np.ndarray, "3 3"]
    mixed: Float64[np.ndarray, "3 3"]
    bending: Float64[np.ndarray, "3 3"]
    work: Float64[np.ndarray, "3 3"]


class SlopeCosines(NamedTuple):
    """Squared cosines of slopes at a Gauss point, and what relates both slopes.

    Attributes:
        fibre_cos2: c, that of the slope of b, on which fibres stand (`squared_cosine`).
        deflection_cos2: g, that of the slope of the deflection w.
        shear_mm2: a; the slope of b is that of w plus a grad lap b.
    """

    fibre_cos2: float
    deflection_cos2: float
    shear_mm2: float


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
def set_plane_derivatives(
    at: int, state: PointState, fibre_cos2: float, derivatives: SecondDerivatives
) -> None:
    """Set those by the displacements along x and y, and by these and second derivatives of b, at a point.

    Args:
        at: the point.
        state: of the sheet there.
        fibre_cos2: as in `SlopeCosines`.
        derivatives: result.
    """
    a1, a2, d, force = state.a1, state.a2, state.membrane, state.membrane_force
    mixed, plane, coupling = state.mixed, derivatives.plane, derivatives.coupling
    for i in range(2):
        for j in range(2):
            p, q, r, s = a1[i] * a1[j], a1[i] * a2[j], a2[i] * a1[j], a2[i] * a2[j]
            same = 1.0 if i == j else 0.0
            plane[at, i, j, 0, 0] = d[0, 0] * p + d[0, 2] * (q + r) + d[2, 2] * s + same * force[0]
            plane[at, i, j, 0, 1] = d[0, 1] * q + d[0, 2] * p + d[1, 2] * s + d[2, 2] * r + same * force[2]
            plane[at, i, j, 1, 0] = d[0, 1] * r + d[0, 2] * p + d[1, 2] * s + d[2, 2] * q + same * force[2]
            plane[at, i, j, 1, 1] = d[1, 1] * s + d[1, 2] * (q + r) + d[2, 2] * p + same * force[1]
        for k in range(3):
            scale = 2.0 * fibre_cos2 if k == 2 else fibre_cos2
            coupling[at, i, 0, 2 + k] = scale * (a1[i] * mixed[0, k] + a2[i] * mixed[2, k])
            coupling[at, i, 1, 2 + k] = scale * (a2[i] * mixed[1, k] + a1[i] * mixed[2, k])


@inlined_kernel(fastmath=True)
@no_type_check
def _set_gradient_derivatives(
    at: int, side: int, state: PointState, slopes: SlopeCosines, derivatives: SecondDerivatives
) -> None:
    """Set those by lx or ly that are due to the slope of b.

    A unit of lx changes the slope of b along x by a, and that slope changes the curvatures of the strain. How
    forces and moments change by a unit of the slope is left in `state.work`.
    """
    a1, a2, curvature, b_slope = state.a1, state.a2, state.curvature, state.b_slope
    coupling, deflection = derivatives.coupling, derivatives.deflection
    c, a = slopes.fibre_cos2, slopes.shear_mm2
    force_by_slope, moment_by_slope = state.work[1], state.work[2]
    c_by_slope = -2.0 * c * c * b_slope[side]
    bent = 0.0  # `moment_by_slope` times `curvature`, summed
    for k in range(3):
        force_by_slope[k] = moment_by_slope[k] = 0.0
        for m in range(3):
            force_by_slope[k] += state.mixed[k, m] * c_by_slope * curvature[m]
            moment_by_slope[k] += state.bending[k, m] * c_by_slope * curvature[m]
        bent += moment_by_slope[k] * curvature[k]
        double = 2.0 * a if k == 2 else a
        deflection[at, 5 + side, 2 + k] = double * (
            c * moment_by_slope[k] + c_by_slope * state.bending_moment[k]
        )
    for k in range(2):
        deflection[at, 5 + side, 5 + k] = -2.0 * a * a * c * c * b_slope[k] * bent
    for i in range(2):
        coupling[at, i, 0, 5 + side] = a * (a1[i] * force_by_slope[0] + a2[i] * force_by_slope[2])
        coupling[at, i, 1, 5 + side] = a * (a2[i] * force_by_slope[1] + a1[i] * force_by_slope[2])


@inlined_kernel(fastmath=True)
@no_type_check
def _set_slope_derivatives(
    at: int, side: int, state: PointState, slopes: SlopeCosines, derivatives: SecondDerivatives
) -> None:
    """Set those by wx or wy; after `_set_gradient_derivatives`, whose results in `state.work` it uses."""
    a1, a2, curvature, b_slope = state.a1, state.a2, state.curvature, state.b_slope
    coupling, deflection = derivatives.coupling, derivatives.deflection
    c, a = slopes.fibre_cos2, slopes.shear_mm2
    strain_by_slope, force_by_slope, moment_by_slope = state.work[0], state.work[1], state.work[2]
    c_by_slope, w_slope = -2.0 * c * c * b_slope[side], a1[2] if side == 0 else a2[2]
    strain_by_slope[0] = a1[2] if side == 0 else 0.0
    strain_by_slope[1] = a2[2] if side == 1 else 0.0
    strain_by_slope[2] = a2[2] if side == 0 else a1[2]
    bent = 0.0  # `moment_by_slope` times `curvature`, summed
    for k in range(3):
        for m in range(3):
            force_by_slope[k] += state.membrane[k, m] * strain_by_slope[m]
            moment_by_slope[k] += state.mixed[m, k] * strain_by_slope[m]
        bent += moment_by_slope[k] * curvature[k]
        double = 2.0 if k == 2 else 1.0
        deflection[at, side, 2 + k] = double * (c * moment_by_slope[k] + c_by_slope * state.bending_moment[k])
    deflection[at, side, 0] = a1[2] * force_by_slope[0] + a2[2] * force_by_slope[2]
    deflection[at, side, 1] = a2[2] * force_by_slope[1] + a1[2] * force_by_slope[2]
    for k in range(2):
        by_c = -2.0 * c * c * b_slope[k] * bent  # dc / d(slope of b along k) times `bent`
        deflection[at, side, k] += by_c + state.membrane_force[k if side == k else 2]
        deflection[at, side, 5 + k] = a * by_c - 2.0 * slopes.deflection_cos2 * w_slope * state.shear_force[k]
    for i in range(2):
        coupling[at, i, 0, side] = a1[i] * force_by_slope[0] + a2[i] * force_by_slope[2]
        coupling[at, i, 1, side] = a2[i] * force_by_slope[1] + a1[i] * force_by_slope[2]


@inlined_kernel(fastmath=True)
@no_type_check
def _add_cosine_derivatives(
    at: int, state: PointState, slopes: SlopeCosines, derivatives: SecondDerivatives
) -> None:
    """Add what is due to the second derivatives of c and g by the slopes."""
    deflection, b_slope = derivatives.deflection, state.b_slope
    c, g, a = slopes
    w_slope = (state.a1[2], state.a2[2])
    by_c = by_g = 0.0  # dW/dc, and 2 g dW/dg
    for k in range(3):
        by_c += state.bending_moment[k] * state.curvature[k]
    for k in range(2):
        by_g += state.shear_force[k] * state.laplacian_gradient[k]
    for i in range(2):
        for k in range(2):
            same = 1.0 if i == k else 0.0
            # dW/dc times the second derivative of c by the slopes of b along i and k
            bent = 2.0 * c * c * by_c * (4.0 * c * b_slope[i] * b_slope[k] - same)
            deflection[at, i, k] += bent + g * by_g * (4.0 * g * w_slope[i] * w_slope[k] - same)
            deflection[at, i, 5 + k] += a * bent
            deflection[at, 5 + i, 5 + k] += a * a * bent


@inlined_kernel(fastmath=True)
@no_type_check
def set_deflection_derivatives(
    at: int, state: PointState, slopes: SlopeCosines, sheared: float, derivatives: SecondDerivatives
) -> None:
    """Set those by the derivatives of b at a point, and by these and the other displacements.

    Args:
        at: the point.
        state: of the sheet there.
        slopes: see `SlopeCosines`.
        sheared: stiffness of the gradient of the Laplacian times the weight of the point.
        derivatives: result.
    """
    deflection, c = derivatives.deflection, slopes.fibre_cos2
    for side in range(2):
        _set_gradient_derivatives(at, side, state, slopes, derivatives)
        _set_slope_derivatives(at, side, state, slopes, derivatives)
    _add_cosine_derivatives(at, state, slopes, derivatives)
    for k in range(3):
        for m in range(3):
            double = (2.0 if k == 2 else 1.0) * (2.0 if m == 2 else 1.0)
            deflection[at, 2 + k, 2 + m] = double * c * c * state.bending[k, m]
    for side in range(2):
        deflection[at, 5 + side, 5 + side] += slopes.deflection_cos2 * sheared
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
) -> SlopeCosines:
    """Set the state at Gauss point `at` of an element, whose coefficients and tables are given."""
    local, tables = element
    t, mu, bulk, tension, lever, stretch, shear, shear_stiffness = stiffness
    a1, a2, curvature, gradient, b_slope, force, bending_moment, shear_force, membrane, mixed, bending, _ = (
        state
    )
    a1[0], a1[1], a1[2], a2[0], a2[1], a2[2], k1, k2, k3, l1, l2 = strain(local, tables, at)
    e1 = 0.5 * (a1[0] * a1[0] + a1[1] * a1[1] + a1[2] * a1[2] - 1.0)
    e2 = 0.5 * (a2[0] * a2[0] + a2[1] * a2[1] + a2[2] * a2[2] - 1.0)
    e3 = a1[0] * a2[0] + a1[1] * a2[1] + a1[2] * a2[2]
    b_slope[0], b_slope[1] = a1[2] + shear * l1, a2[2] + shear * l2
    c, g = squared_cosine(b_slope[0], b_slope[1]), squared_cosine(a1[2], a2[2])
    z, half = lever * c, 0.5 * t * weight
    h1, h2, h3 = stretch_by_curvature(c * k1, c * k2, c * k3, stretch)
    e1, e2, e3 = e1 + h1, e2 + h2, e3 + h3
    p = stress_and_tangent(e1 + z * k1, e2 + z * k2, e3 + z * k3, mu, bulk)
    q = stress_and_tangent(e1 - z * k1, e2 - z * k2, e3 - z * k3, mu, bulk)
    arm, sheared = half * lever, weight * shear_stiffness
    curvature[0], curvature[1], curvature[2], gradient[0], gradient[1] = k1, k2, k3, l1, l2
    for k in range(3):
        force[k] = half * (p[k] + q[k]) + (weight * tension if k < 2 else 0.0)
        bending_moment[k] = arm * (p[k] - q[k])
    shear_force[0], shear_force[1] = sheared * g * l1, sheared * g * l2
    _set_moduli(membrane, half, 1.0, p[3:], q[3:])
    _set_moduli(mixed, arm, -1.0, p[3:], q[3:])
    _set_moduli(bending, arm * lever, 1.0, p[3:], q[3:])
    _add_stretch(state, stretch, c)
    return SlopeCosines(c, g, shear)


@inlined_kernel(fastmath=True)
@no_type_check
def _add_stretch(state: PointState, stretch: float, fibre_cos2: float) -> None:
    """Add what is due to the strain by the squared curvature, `kernels.stretch_by_curvature`.

    Args:
        state: with `bending_moment`, `mixed` and `bending` without it.
        stretch: Q.
        fibre_cos2: as in `SlopeCosines`.
    """
    force, by_curvature = state.membrane_force, state.work
    membrane, mixed, bending = state.membrane, state.mixed, state.bending
    bent = stretch * fibre_cos2
    k1, k2, k3 = bent * state.curvature[0], bent * state.curvature[1], bent * state.curvature[2]
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


@inlined_kernel(fastmath=True)
@no_type_check
def add_force(
    state: PointState,
    tables: Tables,
    at: int,
    slopes: SlopeCosines,
    element: Float64[np.ndarray, "3 16"],
) -> None:
    """Add the nodal forces of a Gauss point to those of its element."""
    nx, ny, wx, wy, nxx, nyy, nxy, lx, ly = tables
    a1, a2, b_slope = state.a1, state.a2, state.b_slope
    bending_moment, shear_force = state.bending_moment, state.shear_force
    s1, s2, s3 = state.membrane_force[0], state.membrane_force[1], state.membrane_force[2]
    c, g, a = slopes
    # dW/dg dg/d(slope of w) and dW/dc dc/d(slope of b), both over the slope
    by_w_slope = -g * (
        shear_force[0] * state.laplacian_gradient[0] + shear_force[1] * state.laplacian_gradient[1]
    )
    by_b_slope = 0.0
    for k in range(3):
        by_b_slope += bending_moment[k] * state.curvature[k]
    by_b_slope *= -2.0 * c * c
    by_lx, by_ly = shear_force[0] + by_b_slope * a * b_slope[0], shear_force[1] + by_b_slope * a * b_slope[1]
    by_wx = s1 * a1[2] + s3 * a2[2] + by_w_slope * a1[2] + by_b_slope * b_slope[0]
    by_wy = s3 * a1[2] + s2 * a2[2] + by_w_slope * a2[2] + by_b_slope * b_slope[1]
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
        element[2, k] += c * bent + by_lx * lx[at, k] + by_ly * ly[at, k]
