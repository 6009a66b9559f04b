"""The normal matrix of a Gauss-Newton step, built directly as a band, compiled.

`band` is flat: H[p, q], q >= p, lies at front + p (width + 1) + q - p, where width is the half-band. Row
strips reach a little over the ends of the grid and of their rows; what they add there is 0.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments
# no_type_check keeps checkers of annotations, which numba cannot compile, out of them

from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.mechanics.shell_kernels import REACH, ROW, STRIP


@njit(cache=True, fastmath=True)
@no_type_check
def balance_rows(node, tangent, force_z, slope_x, slope_y, first, table_x, table_y, shape, rows):
    """Derivative of T f at one node, into `rows` (3, 7, 24).

    T f = (f_u + w,x f_w, f_v + w,y f_w, f_w). table_x, table_y (4, 4): d w,x / d w at the nodes from `first`.
    """
    for a in range(ROW):
        for b in range(STRIP):
            normal = tangent[node, 2, a, b]
            rows[0, a, b] = tangent[node, 0, a, b] + slope_x * normal
            rows[1, a, b] = tangent[node, 1, a, b] + slope_y * normal
            rows[2, a, b] = normal
    start = first[0] - node // shape[1] + REACH
    along = first[1] - node % shape[1] + REACH
    for a in range(4):
        for b in range(4):
            if 0 <= start + a < ROW and 0 <= along + b < ROW:
                rows[0, start + a, 3 * (along + b) + 2] += force_z * table_x[a, b]
                rows[1, start + a, 3 * (along + b) + 2] += force_z * table_y[a, b]


@njit(cache=True, fastmath=True)
@no_type_check
def add_forces(
    tangent, force, slope, first, table_x, table_y, weight, shape, is_free, front, width, band, gradient
):
    """Add R^T D R to the band and R^T D T f to the gradient, R = d(T f) / dc."""
    rows = np.empty((3, ROW, STRIP))
    columns = shape[1]
    for node in range(len(force)):
        d0 = weight[node, 0] if is_free[node, 0] else 0.0
        d1 = weight[node, 1] if is_free[node, 1] else 0.0
        d2 = weight[node, 2] if is_free[node, 2] else 0.0
        f2 = force[node, 2]
        balance_rows(
            node, tangent, f2, slope[node, 0], slope[node, 1], first[node], table_x[node], table_y[node],
            shape, rows,
        )  # fmt: skip
        g0 = d0 * (force[node, 0] + slope[node, 0] * f2)
        g1 = d1 * (force[node, 1] + slope[node, 1] * f2)
        g2 = d2 * f2
        s0, f0 = node // columns, node % columns
        low, high = 3 * max(REACH - f0, 0), 3 * min(ROW, columns - f0 + REACH)
        for a in range(max(REACH - s0, 0), min(ROW, shape[0] - s0 + REACH)):
            begin = 3 * ((s0 + a - REACH) * columns + f0 - REACH)
            for p in range(low, high):
                gradient[begin + p] += g0 * rows[0, a, p] + g1 * rows[1, a, p] + g2 * rows[2, a, p]
                w0, w1, w2 = d0 * rows[0, a, p], d1 * rows[1, a, p], d2 * rows[2, a, p]
                to = front + (begin + p) * (width + 1)
                for q in range(p, high):
                    band[to + q - p] += w0 * rows[0, a, q] + w1 * rows[1, a, q] + w2 * rows[2, a, q]
                for c in range(a + 1, min(ROW, shape[0] - s0 + REACH)):
                    at = to + 3 * (c - a) * columns - p
                    for q in range(STRIP):
                        band[at + q] += w0 * rows[0, c, q] + w1 * rows[1, c, q] + w2 * rows[2, c, q]


@njit(cache=True, fastmath=True)
@no_type_check
def add_dots(derivative, residual, information, first, shape, front, width, band, gradient):
    """Add J^T W J to the band and J^T W r to the gradient; `derivative` (m, 2, 4, 12)."""
    columns = shape[1]
    weighted = np.empty((2, 4, 12))
    for i in range(len(derivative)):
        w00, w01, w11 = information[i, 0, 0], information[i, 0, 1], information[i, 1, 1]
        if w00 == 0.0 and w11 == 0.0:
            continue
        for a in range(4):
            for p in range(12):
                j0, j1 = derivative[i, 0, a, p], derivative[i, 1, a, p]
                weighted[0, a, p] = w00 * j0 + w01 * j1
                weighted[1, a, p] = w01 * j0 + w11 * j1
        for a in range(4):
            begin = 3 * ((first[i, 0] + a) * columns + first[i, 1])
            for p in range(12):
                w0, w1 = weighted[0, a, p], weighted[1, a, p]
                gradient[begin + p] += w0 * residual[i, 0] + w1 * residual[i, 1]
                to = front + (begin + p) * (width + 1)
                for q in range(p, 12):
                    band[to + q - p] += w0 * derivative[i, 0, a, q] + w1 * derivative[i, 1, a, q]
                for c in range(a + 1, 4):
                    at = to + 3 * (c - a) * columns - p
                    for q in range(12):
                        band[at + q] += w0 * derivative[i, 0, c, q] + w1 * derivative[i, 1, c, q]
