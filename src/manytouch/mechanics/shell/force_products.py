"""Internal forces of the shell, eight elements after the other, compiled.

The basis functions are products of functions along the slow and the fast axis, and so are the sums over
elements (sum factorisation; S. A. Orszag 1980, doi:10.1016/0021-9991(80)90005-4). Of each function four are
not 0 at a point. What is computed for eight elements of a row is kept in arrays of constant size: LLVM forms
vectors only where all distances in memory are constants. Symbols are as in `kernels`. An isotropic sheet is
the same with x and y exchanged, so that x is the slow axis here.
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.shell.kernels import (
    Elements,
    Stiffness,
    curvatures,
    fibre_normal,
    shear_ratio,
    stretch_by_curvature,
)
from manytouch.mechanics.shell.material import stress
from manytouch.values.arrays import read_only_view

A10, A11, A12, A20, A21, A22, K1, K2, K3, L1, L2, U1, U2, U3, V1, V2, V3 = range(17)
"""Strains of a group of points. A12 and A22 are those of b; U and V are second derivatives of u and v."""

PX, QX, PY, QY, RX, RY, M1, M2, M3, LX, LY, MU1, MU2, MU3, MV1, MV2, MV3 = range(17)
"""Stresses of a group of points, times their weights."""

GROUP = 8
"""Elements of a row that are computed together, at one place in each."""

STRIDE = 16
"""Distance in memory of the fields at the GROUP + 3 nodes of these elements."""

FUNCTIONS = 28
"""4 functions of 7 kinds: displacements along x and y by order 0 to 2; bending deflection by order 0 to 3."""

P0, P1, P2, B0, B1, B2, B3 = (4 * kind * GROUP for kind in range(7))
"""Where each kind begins among the functions of a group."""

Flat = Float64[np.ndarray, " n"]


class RowTables(NamedTuple):
    """Basis functions at the Gauss points.

    Attributes:
        plane_slow: (rows, 3, 4) value and two derivatives of the functions of the displacements along x and y
            that are not 0 in a row of points.
        bending_slow: (rows, 4, 4) value and three derivatives of those of the bending deflection.
        fast: (groups, 3, FUNCTIONS * GROUP) functions along the fast axis, for each place in an element; 0
            for elements beyond the last one.
        weight: (3, 3) of the points of an element, mm^2.
        dropped: number of functions along each side that are 0 and not nodes.
        order: component of the coefficients along the slow, the fast, and the third axis.
        lanes: GROUP as a variable; LLVM unrolls a loop with a constant of eight, and then forms no vectors.
    """

    plane_slow: Float64[np.ndarray, "rows 3 4"]
    bending_slow: Float64[np.ndarray, "rows 4 4"]
    fast: Float64[np.ndarray, "groups 3 k"]
    weight: Float64[np.ndarray, "3 3"]
    dropped: int
    order: tuple[int, int, int]
    lanes: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ForceProducts:
    """The forces of a patch.

    Attributes:
        tables: basis functions at the Gauss points.
        shape: number of nodes along the slow and the fast axis.
    """

    tables: RowTables
    shape: tuple[int, int]

    @staticmethod
    def of(elements: Elements) -> "ForceProducts":
        """The forces of the elements of a patch."""
        tables = RowTables(
            plane_slow=np.ascontiguousarray(elements.slow.reshape(-1, 4, 4)[:, :3]),
            bending_slow=np.ascontiguousarray(elements.bending_slow.reshape(-1, 4, 4)),
            fast=_in_groups(np.concatenate([elements.fast[:, :, :3], elements.bending_fast], axis=2)),
            weight=np.ascontiguousarray(elements.weight.reshape(3, 3)),
            dropped=elements.dropped,
            order=(0, 1, 2) if elements.is_x_slow else (1, 0, 2),
            lanes=GROUP,
        )
        return ForceProducts(tables=tables, shape=elements.shape)

    def forces(self, coefficient_mm: Nodal, stiffness: Stiffness) -> Nodal:
        """Derivative (nodes, 3) of the energy over E by the coefficients, mm^2."""
        slow, fast = self.shape
        result = np.empty((slow, fast, 3))
        nodal = np.ascontiguousarray(coefficient_mm).reshape(slow, fast, 3)
        add_rows(read_only_view(nodal), self.tables, stiffness, result)
        return result.reshape(-1, 3)


def _in_groups(table: Float64[np.ndarray, "elements 3 7 4"]) -> Float64[np.ndarray, "groups 3 k"]:
    groups = -(-len(table) // GROUP)
    whole = np.zeros((groups * GROUP, *table.shape[1:]))
    whole[: len(table)] = table
    split = whole.reshape(groups, GROUP, 3, FUNCTIONS)
    return np.ascontiguousarray(split.transpose(0, 2, 3, 1).reshape(groups, 3, FUNCTIONS * GROUP))


@kernel(fastmath=True)
@no_type_check
def add_rows(
    coefficient: Float64[np.ndarray, "slow fast 3"],
    tables: RowTables,
    stiffness: Stiffness,
    result: Float64[np.ndarray, "slow fast 3"],
) -> None:
    """Derivative of the energy over E by the coefficients, into `result`."""
    rows, dropped, order = len(tables.plane_slow), tables.dropped, tables.order
    slow, fast = coefficient.shape[:2]
    across, along = rows // 3 + 3, GROUP * len(tables.fast) + 3
    nodal, force = np.zeros((across, 3, along)), np.zeros((across, 3, along))
    for s in range(slow):
        for f in range(fast):
            for i in range(3):
                nodal[s + dropped, i, f + dropped] = coefficient[s, f, order[i]]
    field, back = np.zeros((10, along)), np.zeros((10, along))
    work = np.zeros(10 * STRIDE), np.zeros(10 * STRIDE), np.empty(17 * GROUP), np.empty(17 * GROUP)
    for row in range(rows):
        plane, bending, near = (
            tables.plane_slow[row],
            tables.bending_slow[row],
            nodal[row // 3 : row // 3 + 4],
        )
        for k in range(3):
            add_four(field[k], near[:, 0], plane[k], 0.0)
            add_four(field[3 + k], near[:, 1], plane[k], 0.0)
        for k in range(4):
            add_four(field[6 + k], near[:, 2], bending[k], 0.0)
        forces_of_row(field, tables, row % 3, stiffness, work, back)
        for a in range(4):
            to, p0, p1, p2 = force[row // 3 + a], plane[0, a], plane[1, a], plane[2, a]
            for n in range(along):
                to[0, n] += p0 * back[0, n] + p1 * back[1, n] + p2 * back[2, n]
                to[1, n] += p0 * back[3, n] + p1 * back[4, n] + p2 * back[5, n]
            add_four(to[2], back[6:], bending[:, a], 1.0)
    for s in range(slow):
        for f in range(fast):
            for i in range(3):
                result[s, f, order[i]] = force[s + dropped, i, f + dropped]


@kernel(fastmath=True)
@no_type_check
def forces_of_row(
    field: Float64[np.ndarray, "10 along"],
    tables: RowTables,
    place_slow: int,
    stiffness: Stiffness,
    work: tuple[Flat, Flat, Flat, Flat],
    back: Float64[np.ndarray, "10 along"],
) -> None:
    """What the stresses of a row of points do to the derivatives along the slow axis, into `back`.

    Args:
        field: derivatives along the slow axis at the nodes; rows as in `strains_of_group`.
        tables: basis functions.
        place_slow: number of the row in its elements.
        stiffness: of the sheet.
        work: space for a group: fields at the nodes, and their forces; strains and stresses.
        back: result.
    """
    near, pull, strain, resultant = work
    back[:] = 0.0
    for group in range(len(tables.fast)):
        begin = GROUP * group
        for k in range(10):
            for n in range(GROUP + 3):
                near[k * STRIDE + n] = field[k, begin + n]
                pull[k * STRIDE + n] = 0.0
        for place in range(3):
            functions, weight = tables.fast[group, place], tables.weight[place_slow, place]
            strains_of_group(tables.lanes, near, functions, strain)
            stresses_of_group(tables.lanes, strain, weight, stiffness, resultant)
            add_moments(tables.lanes, resultant, functions, pull)
        for k in range(10):
            for n in range(GROUP + 3):
                back[k, begin + n] += pull[k * STRIDE + n]


@kernel(fastmath=True)
@no_type_check
def add_four(
    to: Flat, rows: Float64[np.ndarray, "4 n"], factor: Float64[np.ndarray, "4"], kept: float
) -> None:
    """Multiply a row by `kept`, 0 or 1, and add four others times their factors."""
    r0, r1, r2, r3 = rows[0], rows[1], rows[2], rows[3]
    f0, f1, f2, f3 = factor[0], factor[1], factor[2], factor[3]
    for n in range(len(to)):
        to[n] = kept * to[n] + (f0 * r0[n] + f1 * r1[n]) + (f2 * r2[n] + f3 * r3[n])


@kernel(fastmath=True)
@no_type_check
def strains_of_group(lanes: int, field: Flat, functions: Flat, strain: Flat) -> None:
    """Strains of GROUP points.

    Args:
        field: (10 * STRIDE,) derivatives along the slow axis at the nodes: of u and v by order 0 to 2 and
            of b by order 0 to 3.
        functions: (FUNCTIONS * GROUP,) along the fast axis.
        strain: (17 * GROUP,) result.
    """
    u0, u1, u2, v0, v1, v2 = 0, STRIDE, 2 * STRIDE, 3 * STRIDE, 4 * STRIDE, 5 * STRIDE
    b0, b1, b2, b3 = 6 * STRIDE, 7 * STRIDE, 8 * STRIDE, 9 * STRIDE
    for n in range(lanes):
        a10 = a11 = a12 = a20 = a21 = a22 = k1 = k2 = k3 = l1 = l2 = 0.0
        u_xx = u_yy = u_xy = v_xx = v_yy = v_xy = 0.0
        for b in range(4):
            at, m = b * GROUP + n, n + b
            p0, p1, p2 = functions[P0 + at], functions[P1 + at], functions[P2 + at]
            d0, d1 = functions[B0 + at], functions[B1 + at]
            d2, d3 = functions[B2 + at], functions[B3 + at]
            w0, w1, w2, w3 = field[b0 + m], field[b1 + m], field[b2 + m], field[b3 + m]
            a10 += p0 * field[u1 + m]
            a20 += p1 * field[u0 + m]
            a11 += p0 * field[v1 + m]
            a21 += p1 * field[v0 + m]
            u_xx += p0 * field[u2 + m]
            u_yy += p2 * field[u0 + m]
            u_xy += p1 * field[u1 + m]
            v_xx += p0 * field[v2 + m]
            v_yy += p2 * field[v0 + m]
            v_xy += p1 * field[v1 + m]
            a12 += d0 * w1
            a22 += d1 * w0
            k1 += d0 * w2
            k2 += d2 * w0
            k3 += d1 * w1
            l1 += d0 * w3 + d2 * w1
            l2 += d1 * w2 + d3 * w0
        strain[A10 * GROUP + n], strain[A11 * GROUP + n], strain[A12 * GROUP + n] = a10, a11, a12
        strain[A20 * GROUP + n], strain[A21 * GROUP + n], strain[A22 * GROUP + n] = a20, a21, a22
        strain[K1 * GROUP + n], strain[K2 * GROUP + n], strain[K3 * GROUP + n] = k1, k2, k3
        strain[L1 * GROUP + n], strain[L2 * GROUP + n] = l1, l2
        strain[U1 * GROUP + n], strain[U2 * GROUP + n], strain[U3 * GROUP + n] = u_xx, u_yy, u_xy
        strain[V1 * GROUP + n], strain[V2 * GROUP + n], strain[V3 * GROUP + n] = v_xx, v_yy, v_xy


@kernel(fastmath=True)
@no_type_check
def add_moments(lanes: int, resultant: Flat, functions: Flat, field: Flat) -> None:
    """Add what the stresses of GROUP points do to the derivatives in `field` of `strains_of_group`."""
    r, g = resultant, functions
    for b in range(4):
        for n in range(lanes):
            at, m = b * GROUP + n, n + b
            p0, p1, p2 = g[P0 + at], g[P1 + at], g[P2 + at]
            field[m] += p1 * r[PY * GROUP + n] + p2 * r[MU2 * GROUP + n]
            field[STRIDE + m] += p0 * r[PX * GROUP + n] + p1 * r[MU3 * GROUP + n]
            field[2 * STRIDE + m] += p0 * r[MU1 * GROUP + n]
            field[3 * STRIDE + m] += p1 * r[QY * GROUP + n] + p2 * r[MV2 * GROUP + n]
            field[4 * STRIDE + m] += p0 * r[QX * GROUP + n] + p1 * r[MV3 * GROUP + n]
            field[5 * STRIDE + m] += p0 * r[MV1 * GROUP + n]
            d0, d1, d2, d3 = g[B0 + at], g[B1 + at], g[B2 + at], g[B3 + at]
            lx, ly = r[LX * GROUP + n], r[LY * GROUP + n]
            field[6 * STRIDE + m] += d1 * r[RY * GROUP + n] + d2 * r[M2 * GROUP + n] + d3 * ly
            field[7 * STRIDE + m] += d0 * r[RX * GROUP + n] + d1 * r[M3 * GROUP + n] + d2 * lx
            field[8 * STRIDE + m] += d0 * r[M1 * GROUP + n] + d1 * ly
            field[9 * STRIDE + m] += d0 * lx


@kernel(fastmath=True)
@no_type_check
def stresses_of_group(lanes: int, strain: Flat, weight: float, stiffness: Stiffness, resultant: Flat) -> None:
    """Stresses of GROUP points of one weight from their strains, rows one after the other."""
    t, mu, bulk, tension, lever, stretch, shear, shear_stiffness = stiffness
    for n in range(lanes):
        a10, a11 = 1.0 + strain[A10 * GROUP + n], strain[A11 * GROUP + n]
        a20, a21 = strain[A20 * GROUP + n], 1.0 + strain[A21 * GROUP + n]
        l1, l2 = strain[L1 * GROUP + n], strain[L2 * GROUP + n]
        b1, b2 = strain[A12 * GROUP + n], strain[A22 * GROUP + n]
        a12, a22 = b1 - shear * l1, b2 - shear * l2
        w1, w2, w3 = strain[K1 * GROUP + n], strain[K2 * GROUP + n], 2.0 * strain[K3 * GROUP + n]
        e1 = 0.5 * (a10 * a10 + a11 * a11 + a12 * a12 - 1.0)
        e2 = 0.5 * (a20 * a20 + a21 * a21 + a22 * a22 - 1.0)
        e3 = a10 * a20 + a11 * a21 + a12 * a22
        g = shear_ratio(e1, e2, e3)
        pull, sheared, half = weight * tension, weight * shear_stiffness * g, 0.5 * t * weight
        across = g * sheared * (l1 * l1 + l2 * l2)
        t1, t2, t3 = across * (1.0 + 2.0 * e2), across * (1.0 + 2.0 * e1), -across * e3
        u1, u2, u3 = strain[U1 * GROUP + n], strain[U2 * GROUP + n], 2.0 * strain[U3 * GROUP + n]
        v1, v2, v3 = strain[V1 * GROUP + n], strain[V2 * GROUP + n], 2.0 * strain[V3 * GROUP + n]
        nx, ny, nz = fibre_normal((a10, a11, b1), (a20, a21, b2))
        k1, k2, k3, c = curvatures((nx, ny, nz), (w1, w2, w3), ((u1, u2, u3), (v1, v2, v3)))
        h1, h2, h3 = stretch_by_curvature(k1, k2, k3, stretch)
        e1, e2, e3 = e1 + h1, e2 + h2, e3 + h3
        z1, z2, z3 = lever * k1, lever * k2, lever * k3
        p1, p2, p3 = stress(e1 + z1, e2 + z2, e3 + z3, mu, bulk)
        r1, r2, r3 = stress(e1 - z1, e2 - z2, e3 - z3, mu, bulk)
        s1, s2, s3 = half * (p1 + r1) + pull, half * (p2 + r2) + pull, half * (p3 + r3)
        m1, m2, m3 = half * lever * (p1 - r1), half * lever * (p2 - r2), half * lever * (p3 - r3)
        m1 += stretch * (s1 * k1 + 0.5 * s3 * k3)
        m2 += stretch * (s2 * k2 + 0.5 * s3 * k3)
        m3 += stretch * (0.25 * (s1 + s2) * k3 + 0.5 * s3 * (k1 + k2))
        twice = 2.0 * c * (m1 * k1 + m2 * k2 + m3 * k3)
        m1, m2, m3 = c * m1, c * m2, c * m3
        gx = m1 * u1 + m2 * u2 + m3 * u3 - twice * nx
        gy = m1 * v1 + m2 * v2 + m3 * v3 - twice * ny
        gz = m1 * w1 + m2 * w2 + m3 * w3 - twice * nz
        m3 = 2.0 * m3
        s1, s2, s3 = s1 - t1, s2 - t2, s3 - t3
        px, qx = s1 * a10 + s3 * a20 - b2 * gy + a21 * gz, s1 * a11 + s3 * a21 + b2 * gx - a20 * gz
        py, qy = s3 * a10 + s2 * a20 + b1 * gy - a11 * gz, s3 * a11 + s2 * a21 - b1 * gx + a10 * gz
        rx, ry = s1 * a12 + s3 * a22, s3 * a12 + s2 * a22
        resultant[PX * GROUP + n], resultant[QX * GROUP + n] = px, qx
        resultant[PY * GROUP + n], resultant[QY * GROUP + n] = py, qy
        resultant[RX * GROUP + n] = rx - a21 * gx + a20 * gy
        resultant[RY * GROUP + n] = ry + a11 * gx - a10 * gy
        resultant[M1 * GROUP + n], resultant[M2 * GROUP + n] = nz * m1, nz * m2
        resultant[M3 * GROUP + n] = nz * m3
        resultant[MU1 * GROUP + n], resultant[MV1 * GROUP + n] = nx * m1, ny * m1
        resultant[MU2 * GROUP + n], resultant[MV2 * GROUP + n] = nx * m2, ny * m2
        resultant[MU3 * GROUP + n], resultant[MV3 * GROUP + n] = nx * m3, ny * m3
        resultant[LX * GROUP + n] = sheared * l1 - shear * rx
        resultant[LY * GROUP + n] = sheared * l2 - shear * ry
