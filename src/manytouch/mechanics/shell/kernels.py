"""Energy, forces and tangent of the shell, element by element, compiled.

Derivation and symbols: docs/derivations/mechanics.md. Local nodes are numbered 4 a + b with a along the
slow, b along the fast axis; nodes outside the grid were dropped, their coefficients are 0.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments
# no_type_check keeps checkers of annotations, which numba cannot compile, out of them

from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.mechanics.shell.material import energy_density, stress, stress_and_tangent
from manytouch.mechanics.solver.tile import ROWS, add_product_16

REACH = 3  # nodes that share an element are at most so far apart along each axis
ROW = 2 * REACH + 1
STRIP = 8  # numbers kept per row of 7 nodes; one more than needed fills whole lanes
POINTS = 9  # of 3 x 3 Gauss
LOCAL = 16


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _gather(coefficient, es, ef, shape, dropped, local):
    for a in range(4):
        s = es + a - dropped
        for b in range(4):
            f = ef + b - dropped
            inside = 0 <= s < shape[0] and 0 <= f < shape[1]
            for i in range(3):
                local[i, 4 * a + b] = coefficient[s * shape[1] + f, i] if inside else 0.0


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _tabulate(slow, fast, x_is_slow, nx, ny, nxx, nyy, nxy):
    """Derivatives of the 16 functions at the 9 points of an element."""
    for p in range(3):
        for q in range(3):
            at = 3 * p + q
            for a in range(4):
                s0, s1, s2 = slow[p, 0, a], slow[p, 1, a], slow[p, 2, a]
                for b in range(4):
                    f0, f1, f2 = fast[q, 0, b], fast[q, 1, b], fast[q, 2, b]
                    k = 4 * a + b
                    if x_is_slow:
                        nx[at, k], ny[at, k], nxx[at, k], nyy[at, k] = s1 * f0, s0 * f1, s2 * f0, s0 * f2
                    else:
                        nx[at, k], ny[at, k], nxx[at, k], nyy[at, k] = s0 * f1, s1 * f0, s0 * f2, s2 * f0
                    nxy[at, k] = s1 * f1


@njit(cache=True, nogil=True, fastmath=True, inline="always")
@no_type_check
def _strain(local, nx, ny, nxx, nyy, nxy):
    """Components of a1 and a2, and the curvatures, at one point."""
    a10, a11, a12, a20, a21, a22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0
    k1, k2, k3 = 0.0, 0.0, 0.0
    for k in range(LOCAL):
        u, v, w = local[0, k], local[1, k], local[2, k]
        a10 += nx[k] * u
        a11 += nx[k] * v
        a12 += nx[k] * w
        a20 += ny[k] * u
        a21 += ny[k] * v
        a22 += ny[k] * w
        k1 += nxx[k] * w
        k2 += nyy[k] * w
        k3 += 2.0 * nxy[k] * w
    return a10, a11, a12, a20, a21, a22, k1, k2, k3


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def energy(coefficient, slow, fast, weight, shape, dropped, x_is_slow, sheet):
    """Energy divided by E. `sheet`: t, mu, bulk, N0, D11, D12, D33 (all divided by E)."""
    t, mu, bulk, tension, d11, d12, d33 = sheet
    nx, ny, nxx = np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL))
    nyy, nxy, local = np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL)), np.empty((3, LOCAL))
    total = 0.0
    for es in range(slow.shape[0]):
        for ef in range(fast.shape[0]):
            _gather(coefficient, es, ef, shape, dropped, local)
            _tabulate(slow[es], fast[ef], x_is_slow, nx, ny, nxx, nyy, nxy)
            for at in range(POINTS):
                a10, a11, a12, a20, a21, a22, k1, k2, k3 = _strain(
                    local, nx[at], ny[at], nxx[at], nyy[at], nxy[at]
                )
                e1 = 0.5 * (a10 * a10 + a11 * a11 + a12 * a12 - 1.0)
                e2 = 0.5 * (a20 * a20 + a21 * a21 + a22 * a22 - 1.0)
                e3 = a10 * a20 + a11 * a21 + a12 * a22
                bending = 0.5 * (d11 * (k1 * k1 + k2 * k2) + d33 * k3 * k3) + d12 * k1 * k2
                total += weight[at] * (
                    t * energy_density(e1, e2, e3, mu, bulk) + tension * (e1 + e2) + bending
                )
    return total


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def forces(coefficient, slow, fast, weight, shape, dropped, x_is_slow, sheet, force):
    """Derivative of `energy` with respect to the coefficients, into `force`."""
    t, mu, bulk, tension, d11, d12, d33 = sheet
    nx, ny, nxx = np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL))
    nyy, nxy, local = np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL)), np.empty((3, LOCAL))
    element = np.empty((3, LOCAL))
    force[:] = 0.0
    for es in range(slow.shape[0]):
        for ef in range(fast.shape[0]):
            _gather(coefficient, es, ef, shape, dropped, local)
            _tabulate(slow[es], fast[ef], x_is_slow, nx, ny, nxx, nyy, nxy)
            element[:] = 0.0
            for at in range(POINTS):
                a10, a11, a12, a20, a21, a22, k1, k2, k3 = _strain(
                    local, nx[at], ny[at], nxx[at], nyy[at], nxy[at]
                )
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
            _scatter_force(element, es, ef, shape, dropped, force)


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _scatter_force(element, es, ef, shape, dropped, force):
    for a in range(4):
        s = es + a - dropped
        if 0 <= s < shape[0]:
            for b in range(4):
                f = ef + b - dropped
                if 0 <= f < shape[1]:
                    for i in range(3):
                        force[s * shape[1] + f, i] += element[i, 4 * a + b]


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _scatter_tangent(matrix, i, j, es, ef, shape, dropped, tangent):
    """Add a part of an element's matrix to the flat tangent."""
    for a in range(max(dropped - es, 0), min(4, shape[0] - es + dropped)):
        for b in range(max(dropped - ef, 0), min(4, shape[1] - ef + dropped)):
            node = (es + a - dropped) * shape[1] + ef + b - dropped
            begin = (9 * node + 3 * i + j) * ROW * STRIP + (REACH - a) * STRIP + REACH - b
            for c in range(4):
                for d in range(4):
                    # unsigned: numba then knows that the place is not counted from the end
                    tangent[np.uintp(begin + STRIP * c + d)] += matrix[4 * a + b, 4 * c + d]


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _clear_outside(shape, tangent):
    """Elements at the outline have nodes outside the grid; what these would get is removed."""
    for node in range(len(tangent)):
        s0, f0 = node // shape[1], node % shape[1]
        for a in range(ROW):
            for b in range(ROW):
                if not (0 <= s0 + a - REACH < shape[0] and 0 <= f0 + b - REACH < shape[1]):
                    for i in range(3):
                        for j in range(3):
                            tangent[node, i, j, a, b] = 0.0


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _membrane_factors(factor, right, left):
    """What multiplies nx[l] (first 9 rows of `left`) and ny[l] (next 9) in an element's matrix."""
    for at in range(POINTS):
        xx, xy, yx, yy = factor[at, 0], factor[at, 1], factor[at, 2], factor[at, 3]
        nx, ny, first, second = right[at], right[POINTS + at], left[at], left[POINTS + at]
        for k in range(LOCAL):
            first[k] = xx * nx[k] + yx * ny[k]
            second[k] = xy * nx[k] + yy * ny[k]


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _bending_factors(weight, d11, d12, d33, nxx, nyy, nxy, left):
    """What multiplies nxx[l], nyy[l] and nxy[l] there (the last 27 rows)."""
    for at in range(POINTS):
        w = weight[at]
        for k in range(LOCAL):
            left[2 * POINTS + at, k] = w * (d11 * nxx[at, k] + d12 * nyy[at, k])
            left[3 * POINTS + at, k] = w * (d12 * nxx[at, k] + d11 * nyy[at, k])
            left[4 * POINTS + at, k] = w * 4.0 * d33 * nxy[at, k]


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def forces_and_tangent(coefficient, slow, fast, weight, shape, dropped, x_is_slow, sheet, force, tangent):
    """`forces`, and their derivative into `tangent` (nodes, 3, 3, 7, 8), in the precision of `tangent`.

    tangent[p, i, j, a, b] = d force[p, i] / d coefficient[q, j], where q is a - 3 further along the slow
    and b - 3 further along the fast axis.
    """
    t, mu, bulk, tension, d11, d12, d33 = sheet
    kind = tangent.dtype
    nx, ny, nxx = np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL))
    nyy, nxy, local = np.empty((POINTS, LOCAL)), np.empty((POINTS, LOCAL)), np.empty((3, LOCAL))
    element, matrix = np.empty((3, LOCAL)), np.empty((LOCAL, LOCAL), kind)
    left, right = np.empty((5 * POINTS, LOCAL), kind), np.empty((5 * POINTS, LOCAL), kind)
    flat, flat_left, flat_right = matrix.reshape(-1), left.reshape(-1), right.reshape(-1)
    flat_tangent = tangent.reshape(-1)
    factor = np.empty((3, 3, POINTS, 4), kind)
    a1, a2 = np.empty(3), np.empty(3)
    force[:] = 0.0
    tangent[:] = 0.0
    for es in range(slow.shape[0]):
        for ef in range(fast.shape[0]):
            _gather(coefficient, es, ef, shape, dropped, local)
            _tabulate(slow[es], fast[ef], x_is_slow, nx, ny, nxx, nyy, nxy)
            element[:] = 0.0
            for at in range(POINTS):
                a1[0], a1[1], a1[2], a2[0], a2[1], a2[2], k1, k2, k3 = _strain(
                    local, nx[at], ny[at], nxx[at], nyy[at], nxy[at]
                )
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
            _bending_factors(weight, d11, d12, d33, nxx, nyy, nxy, left)
            for i in range(3):
                for j in range(3):
                    _membrane_factors(factor[i, j], right, left)
                    count = 5 * POINTS if i == 2 and j == 2 else 2 * POINTS
                    matrix[:] = 0.0
                    for row in range(0, LOCAL, ROWS):
                        add_product_16(
                            flat, row * LOCAL, LOCAL, flat_left, row, LOCAL, flat_right, 0, LOCAL, count
                        )
                    _scatter_tangent(matrix, i, j, es, ef, shape, dropped, flat_tangent)
            _scatter_force(element, es, ef, shape, dropped, force)
    _clear_outside(shape, tangent)


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def hold(is_free, shape, force, tangent):
    """Remove what acts on and comes from unknowns that are held."""
    for node in range(len(is_free)):
        s0, f0 = node // shape[1], node % shape[1]
        for i in range(3):
            if is_free[node, i]:
                continue
            force[node, i] = 0.0
            for j in range(3):
                tangent[node, i, j] = 0.0
            for a in range(ROW):
                s = s0 + a - REACH
                if not 0 <= s < shape[0]:
                    continue
                for b in range(ROW):
                    f = f0 + b - REACH
                    if 0 <= f < shape[1]:
                        other = s * shape[1] + f
                        for j in range(3):
                            tangent[other, j, i, ROW - 1 - a, ROW - 1 - b] = 0.0


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def product(tangent, shape, vector, result):
    """result = tangent times vector, both (nodes, 3)."""
    for node in range(len(vector)):
        s0, f0 = node // shape[1], node % shape[1]
        low, high = max(f0 - REACH, 0), min(f0 + REACH + 1, shape[1])
        for i in range(3):
            total = 0.0
            for a in range(max(REACH - s0, 0), min(ROW, shape[0] - s0 + REACH)):
                start = (s0 + a - REACH) * shape[1]
                for f in range(low, high):
                    for j in range(3):
                        total += tangent[node, i, j, a, f - f0 + REACH] * vector[start + f, j]
            result[node, i] = total


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def row_sum(tangent, shape, share, component, result):
    """Add the sum over nodes of share times the tangent's row of one component to `result` (nodes, 3)."""
    for node in np.flatnonzero(share):
        s0, f0 = node // shape[1], node % shape[1]
        low, high = max(f0 - REACH, 0), min(f0 + REACH + 1, shape[1])
        for a in range(max(REACH - s0, 0), min(ROW, shape[0] - s0 + REACH)):
            start = (s0 + a - REACH) * shape[1]
            for f in range(low, high):
                for j in range(3):
                    result[start + f, j] += share[node] * tangent[node, component, j, a, f - f0 + REACH]


@njit(cache=True, nogil=True)
@no_type_check
def band_of(tangent, shape, is_free, band):
    """A tangent as a band: row p of `band` holds K[p, p], K[p, p + 1], ...; held unknowns get 1."""
    for node in range(len(is_free)):
        s0, f0 = node // shape[1], node % shape[1]
        for i in range(3):
            p = 3 * node + i
            if not is_free[node, i]:
                band[p, 0] = 1.0
                continue
            for a in range(REACH, min(ROW, shape[0] - s0 + REACH)):
                start = 3 * ((s0 + a - REACH) * shape[1] + f0 - REACH)
                for b in range(max(REACH - f0, 0), min(ROW, shape[1] - f0 + REACH)):
                    for j in range(3):
                        q = start + 3 * b + j
                        if q >= p:
                            band[p, q - p] = tangent[node, i, j, a, b]
