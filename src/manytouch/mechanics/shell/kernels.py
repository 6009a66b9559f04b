"""Energy, forces and tangent of the shell, element by element, compiled.

Derivation and symbols: docs/derivations/mechanics.md. Local nodes are numbered 4 a + b with a along the slow
and b along the fast axis. Nodes outside the grid were dropped; their coefficients are 0.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.mechanics.banded.tile import ROWS, At, add_product_16
from manytouch.mechanics.shell.material import energy_density, stress, stress_and_tangent
from manytouch.mechanics.shell.tangent_kernels import REACH, ROW, STRIP, Coefficients, Tangent, clear_outside

POINTS = 9  # of 3 x 3 Gauss
LOCAL = 16

Local = Float64[np.ndarray, "3 16"]
Table = Float64[np.ndarray, "9 16"]


class Elements(NamedTuple):
    """The elements of a patch.

    Attributes:
        slow, fast: (elements along the axis, 3 points, 3, 4) value and two derivatives of 4 basis functions.
        weight: (9,) of the Gauss points, mm^2.
        shape: number of nodes along the slow and the fast axis.
        dropped: number of coefficients along each side that are 0 and not nodes.
        is_x_slow: whether x is the slow axis.
    """

    slow: Float64[np.ndarray, "slow 3 3 4"]
    fast: Float64[np.ndarray, "fast 3 3 4"]
    weight: Float64[np.ndarray, "9"]
    shape: tuple[int, int]
    dropped: int
    is_x_slow: bool


class Stiffness(NamedTuple):
    """Properties of a sheet, all but the thickness divided by E.

    Attributes:
        thickness: mm.
        mu, bulk: shear and bulk modulus.
        tension: membrane force at rest, mm.
        d11, d12, d33: bending stiffnesses, mm^3.
    """

    thickness: float
    mu: float
    bulk: float
    tension: float
    d11: float
    d12: float
    d33: float


class Tables(NamedTuple):
    """Derivatives (9, 16) of the basis functions of an element at its Gauss points."""

    x: Table
    y: Table
    xx: Table
    yy: Table
    xy: Table


@kernel(fastmath=True)
@no_type_check
def _new_tables() -> Tables:
    return Tables(
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
    )


@kernel(fastmath=True)
@no_type_check
def _gather(coefficient: Coefficients, elements: Elements, es: int, ef: int, local: Local) -> None:
    """Coefficients of the 16 nodes of element (es, ef), into `local`."""
    shape = elements.shape
    for a in range(4):
        s = es + a - elements.dropped
        for b in range(4):
            f = ef + b - elements.dropped
            inside = 0 <= s < shape[0] and 0 <= f < shape[1]
            for i in range(3):
                local[i, 4 * a + b] = coefficient[s * shape[1] + f, i] if inside else 0.0


@kernel(fastmath=True)
@no_type_check
def _tabulate(elements: Elements, es: int, ef: int, tables: Tables) -> None:
    """Derivatives of the 16 functions at the 9 points of element (es, ef), into `tables`."""
    slow, fast, is_x_slow = elements.slow[es], elements.fast[ef], elements.is_x_slow
    nx, ny, nxx, nyy, nxy = tables.x, tables.y, tables.xx, tables.yy, tables.xy
    for p in range(3):
        for q in range(3):
            at = 3 * p + q
            for a in range(4):
                s0, s1, s2 = slow[p, 0, a], slow[p, 1, a], slow[p, 2, a]
                for b in range(4):
                    f0, f1, f2 = fast[q, 0, b], fast[q, 1, b], fast[q, 2, b]
                    k = 4 * a + b
                    if is_x_slow:
                        nx[at, k], ny[at, k], nxx[at, k], nyy[at, k] = s1 * f0, s0 * f1, s2 * f0, s0 * f2
                    else:
                        nx[at, k], ny[at, k], nxx[at, k], nyy[at, k] = s0 * f1, s1 * f0, s0 * f2, s2 * f0
                    nxy[at, k] = s1 * f1


@kernel(fastmath=True, inline="always")
@no_type_check
def _strain(
    local: Local, tables: Tables, at: int
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Components of a1 and a2, and the curvatures xx, yy and twice xy, at Gauss point `at`."""
    nx, ny, nxx, nyy, nxy = tables
    a10, a11, a12, a20, a21, a22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0
    k1, k2, k3 = 0.0, 0.0, 0.0
    for k in range(LOCAL):
        u, v, w = local[0, k], local[1, k], local[2, k]
        a10 += nx[at, k] * u
        a11 += nx[at, k] * v
        a12 += nx[at, k] * w
        a20 += ny[at, k] * u
        a21 += ny[at, k] * v
        a22 += ny[at, k] * w
        k1 += nxx[at, k] * w
        k2 += nyy[at, k] * w
        k3 += 2.0 * nxy[at, k] * w
    return a10, a11, a12, a20, a21, a22, k1, k2, k3


@kernel(fastmath=True)
@no_type_check
def energy(coefficient: Coefficients, elements: Elements, stiffness: Stiffness) -> float:
    """Energy over E, mm^3."""
    t, mu, bulk, tension, d11, d12, d33 = stiffness
    weight, tables, local = elements.weight, _new_tables(), np.empty((3, LOCAL))
    total = 0.0
    for es in range(elements.slow.shape[0]):
        for ef in range(elements.fast.shape[0]):
            _gather(coefficient, elements, es, ef, local)
            _tabulate(elements, es, ef, tables)
            for at in range(POINTS):
                a10, a11, a12, a20, a21, a22, k1, k2, k3 = _strain(local, tables, at)
                e1 = 0.5 * (a10 * a10 + a11 * a11 + a12 * a12 - 1.0)
                e2 = 0.5 * (a20 * a20 + a21 * a21 + a22 * a22 - 1.0)
                e3 = a10 * a20 + a11 * a21 + a12 * a22
                bending = 0.5 * (d11 * (k1 * k1 + k2 * k2) + d33 * k3 * k3) + d12 * k1 * k2
                total += weight[at] * (
                    t * energy_density(e1, e2, e3, mu, bulk) + tension * (e1 + e2) + bending
                )
    return total


@kernel(fastmath=True)
@no_type_check
def forces(coefficient: Coefficients, elements: Elements, stiffness: Stiffness, force: Coefficients) -> None:
    """Derivative of `energy` by the coefficients (mm^2), into `force`."""
    t, mu, bulk, tension, d11, d12, d33 = stiffness
    weight, tables, local = elements.weight, _new_tables(), np.empty((3, LOCAL))
    nx, ny, nxx, nyy, nxy = tables
    element = np.empty((3, LOCAL))
    force[:] = 0.0
    for es in range(elements.slow.shape[0]):
        for ef in range(elements.fast.shape[0]):
            _gather(coefficient, elements, es, ef, local)
            _tabulate(elements, es, ef, tables)
            element[:] = 0.0
            for at in range(POINTS):
                a10, a11, a12, a20, a21, a22, k1, k2, k3 = _strain(local, tables, at)
                s1, s2, s3 = stress(
                    0.5 * (a10 * a10 + a11 * a11 + a12 * a12 - 1.0),
                    0.5 * (a20 * a20 + a21 * a21 + a22 * a22 - 1.0),
                    a10 * a20 + a11 * a21 + a12 * a22,
                    mu,
                    bulk,
                )
                s1, s2, s3 = (
                    weight[at] * (t * s1 + tension),
                    weight[at] * (t * s2 + tension),
                    weight[at] * t * s3,
                )
                px, qx, rx = s1 * a10 + s3 * a20, s1 * a11 + s3 * a21, s1 * a12 + s3 * a22
                py, qy, ry = s3 * a10 + s2 * a20, s3 * a11 + s2 * a21, s3 * a12 + s2 * a22
                m1 = weight[at] * (d11 * k1 + d12 * k2)
                m2 = weight[at] * (d12 * k1 + d11 * k2)
                m3 = weight[at] * 2.0 * d33 * k3
                for k in range(LOCAL):
                    element[0, k] += px * nx[at, k] + py * ny[at, k]
                    element[1, k] += qx * nx[at, k] + qy * ny[at, k]
                    element[2, k] += (
                        rx * nx[at, k] + ry * ny[at, k] + m1 * nxx[at, k] + m2 * nyy[at, k] + m3 * nxy[at, k]
                    )
            _scatter_force(element, elements, es, ef, force)


@kernel(fastmath=True)
@no_type_check
def _scatter_force(element: Local, elements: Elements, es: int, ef: int, force: Coefficients) -> None:
    """Add the nodal forces of element (es, ef) to `force`."""
    shape = elements.shape
    for a in range(4):
        s = es + a - elements.dropped
        if 0 <= s < shape[0]:
            for b in range(4):
                f = ef + b - elements.dropped
                if 0 <= f < shape[1]:
                    for i in range(3):
                        force[s * shape[1] + f, i] += element[i, 4 * a + b]


@kernel(fastmath=True)
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


@kernel(fastmath=True)
@no_type_check
def _membrane_factors(
    factor: Float[np.ndarray, "9 4"], right: Float[np.ndarray, "45 16"], left: Float[np.ndarray, "45 16"]
) -> None:
    """Factors of nx[l] (first 9 rows of `left`) and ny[l] (next 9 rows) in an element's matrix."""
    for at in range(POINTS):
        xx, xy, yx, yy = factor[at, 0], factor[at, 1], factor[at, 2], factor[at, 3]
        nx, ny, first, second = right[at], right[POINTS + at], left[at], left[POINTS + at]
        for k in range(LOCAL):
            first[k] = xx * nx[k] + yx * ny[k]
            second[k] = xy * nx[k] + yy * ny[k]


@kernel(fastmath=True)
@no_type_check
def _bending_factors(
    weight: Float64[np.ndarray, "9"],
    stiffness: Stiffness,
    tables: Tables,
    left: Float[np.ndarray, "45 16"],
) -> None:
    """Factors of nxx[l], nyy[l] and nxy[l] there (last 27 rows of `left`)."""
    d11, d12, d33 = stiffness.d11, stiffness.d12, stiffness.d33
    nxx, nyy, nxy = tables.xx, tables.yy, tables.xy
    for at in range(POINTS):
        w = weight[at]
        for k in range(LOCAL):
            left[2 * POINTS + at, k] = w * (d11 * nxx[at, k] + d12 * nyy[at, k])
            left[3 * POINTS + at, k] = w * (d12 * nxx[at, k] + d11 * nyy[at, k])
            left[4 * POINTS + at, k] = w * 4.0 * d33 * nxy[at, k]


@kernel(fastmath=True)
@no_type_check
def forces_and_tangent(
    coefficient: Coefficients, elements: Elements, stiffness: Stiffness, force: Coefficients, tangent: Tangent
) -> None:
    """`forces`, and their derivative into `tangent` in its precision, mm.

    tangent[p, i, j, a, b] = d force[p, i] / d coefficient[q, j], where node q is a - 3 nodes further along
    the slow and b - 3 nodes further along the fast axis than p.
    """
    t, mu, bulk, tension, d11, d12, d33 = stiffness
    kind, shape = tangent.dtype, elements.shape
    weight, tables, local = elements.weight, _new_tables(), np.empty((3, LOCAL))
    nx, ny, nxx, nyy, nxy = tables
    element, matrix = np.empty((3, LOCAL)), np.empty((LOCAL, LOCAL), kind)
    left, right = np.empty((5 * POINTS, LOCAL), kind), np.empty((5 * POINTS, LOCAL), kind)
    flat, flat_left, flat_right = matrix.reshape(-1), left.reshape(-1), right.reshape(-1)
    flat_tangent = tangent.reshape(-1)
    factor = np.empty((3, 3, POINTS, 4), kind)
    a1, a2 = np.empty(3), np.empty(3)
    force[:] = 0.0
    tangent[:] = 0.0
    for es in range(elements.slow.shape[0]):
        for ef in range(elements.fast.shape[0]):
            _gather(coefficient, elements, es, ef, local)
            _tabulate(elements, es, ef, tables)
            element[:] = 0.0
            for at in range(POINTS):
                a1[0], a1[1], a1[2], a2[0], a2[1], a2[2], k1, k2, k3 = _strain(local, tables, at)
                s1, s2, s3, c11, c22, c33, c12, c13, c23 = stress_and_tangent(
                    0.5 * (a1[0] * a1[0] + a1[1] * a1[1] + a1[2] * a1[2] - 1.0),
                    0.5 * (a2[0] * a2[0] + a2[1] * a2[1] + a2[2] * a2[2] - 1.0),
                    a1[0] * a2[0] + a1[1] * a2[1] + a1[2] * a2[2],
                    mu,
                    bulk,
                )
                w = weight[at]
                s1, s2, s3 = w * (t * s1 + tension), w * (t * s2 + tension), w * t * s3
                for i in range(3):
                    px, py = s1 * a1[i] + s3 * a2[i], s3 * a1[i] + s2 * a2[i]
                    for k in range(LOCAL):
                        element[i, k] += px * nx[at, k] + py * ny[at, k]
                m1, m2, m3 = w * (d11 * k1 + d12 * k2), w * (d12 * k1 + d11 * k2), w * 2.0 * d33 * k3
                for k in range(LOCAL):
                    element[2, k] += m1 * nxx[at, k] + m2 * nyy[at, k] + m3 * nxy[at, k]
                w *= t
                for i in range(3):
                    for j in range(3):
                        p, q, r, s = a1[i] * a1[j], a1[i] * a2[j], a2[i] * a1[j], a2[i] * a2[j]
                        same = 1.0 if i == j else 0.0
                        factor[i, j, at, 0] = w * (c11 * p + c13 * (q + r) + c33 * s) + same * s1
                        factor[i, j, at, 1] = w * (c12 * q + c13 * p + c23 * s + c33 * r) + same * s3
                        factor[i, j, at, 2] = w * (c12 * r + c13 * p + c23 * s + c33 * q) + same * s3
                        factor[i, j, at, 3] = w * (c22 * s + c23 * (q + r) + c33 * p) + same * s2
            for row, table in enumerate((nx, ny, nxx, nyy, nxy)):
                right[row * POINTS : (row + 1) * POINTS] = table
            _bending_factors(weight, stiffness, tables, left)
            first = (es - elements.dropped, ef - elements.dropped)
            for i in range(3):
                for j in range(3):
                    _membrane_factors(factor[i, j], right, left)
                    count = 5 * POINTS if i == 2 and j == 2 else 2 * POINTS
                    matrix[:] = 0.0
                    for row in range(0, LOCAL, ROWS):
                        add_product_16(
                            flat,
                            At(row * LOCAL, LOCAL),
                            flat_left,
                            At(row, LOCAL),
                            flat_right,
                            At(0, LOCAL),
                            count,
                        )
                    _scatter_tangent(matrix, (i, j), first, shape, flat_tangent)
            _scatter_force(element, elements, es, ef, force)
    clear_outside(elements.shape, tangent)
