"""The normal matrix of a Gauss-Newton step, built directly as a band, compiled.

`band` is flat: H[p, q], q >= p, lies at front + p (width + 1) + q - p, where width is the half-band: the rows
of tiles are `width` apart. Tiles reach a little over the ends of the grid and of the band; what they add
there is 0. Its precision is that of the work.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments
# no_type_check keeps checkers of annotations, which numba cannot compile, out of them

from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.mechanics.shell.kernels import REACH, ROW
from manytouch.mechanics.solver.tile import ROWS, add_product

GROUP = 3  # nodes side by side whose rows are added at once: together they reach over 9 nodes
LANES = 32  # numbers kept per row of those 9 nodes: 27, and padding


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def balance_rows(node, tangent, force_z, slope, first, table_x, table_y, shape, shift, rows):
    """Derivative of T f at one node, into `rows` (3, 7, 32), all of it `shift` nodes further along.

    T f = (f_u + w,x f_w, f_v + w,y f_w, f_w). table_x, table_y (4, 4): d w,x / d w at the nodes from `first`.
    """
    slope_x, slope_y = tangent.dtype.type(slope[0]), tangent.dtype.type(slope[1])
    for a in range(ROW):
        for j in range(3):
            along_u, along_v, normal = tangent[node, 0, j, a], tangent[node, 1, j, a], tangent[node, 2, j, a]
            for b in range(ROW):
                place = 3 * (b + shift) + j
                rows[0, a, place] = along_u[b] + slope_x * normal[b]
                rows[1, a, place] = along_v[b] + slope_y * normal[b]
                rows[2, a, place] = normal[b]
    start = first[0] - node // shape[1] + REACH
    along = first[1] - node % shape[1] + REACH
    for a in range(4):
        for b in range(4):
            if 0 <= start + a < ROW and 0 <= along + b < ROW:
                place = 3 * (along + b + shift) + 2
                rows[0, start + a, place] += force_z * table_x[a, b]
                rows[1, start + a, place] += force_z * table_y[a, b]


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _add_group(rows, weighted, begin, low, high, columns, front, width, band, tile):
    """Add rows^T weighted to the band; `begin` is the unknown of the first column of slow offset 0."""
    flat, flat_weighted, stride = rows.reshape(-1), weighted.reshape(-1), ROW * LANES
    flat_tile = tile.reshape(-1)
    for a in range(low, high):
        top = begin + 3 * a * columns
        tile[:] = 0.0
        for p in range(0, LANES, ROWS):
            add_product(
                flat_tile, p * LANES, LANES, flat_weighted, a * LANES + p, stride,
                flat, a * LANES, stride, 3 * GROUP,
            )  # fmt: skip
            for c in range(a + 1, high):
                at = front + (top + p) * (width + 1) + 3 * (c - a) * columns - p
                add_product(
                    band, at, width, flat_weighted, a * LANES + p, stride, flat, c * LANES, stride, 3 * GROUP
                )
        for p in range(3 * (ROW + GROUP - 1)):
            to = front + (top + p) * (width + 1)
            for q in range(p, 3 * (ROW + GROUP - 1)):
                band[np.uintp(to + q - p)] += tile[p, q]


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def add_forces(
    tangent, force, slope, first, table_x, table_y, weight, shape, is_free, front, width, band, gradient
):
    """Add R^T D R to the band and R^T D T f to the gradient, R = d(T f) / dc."""
    slow, columns = shape
    rows = np.zeros((3 * GROUP, ROW, LANES), tangent.dtype)
    weighted = np.zeros((3 * GROUP, ROW, LANES), tangent.dtype)
    tile = np.zeros((LANES, LANES), tangent.dtype)
    for s0 in range(slow):
        low, high = max(REACH - s0, 0), min(ROW, slow - s0 + REACH)
        for f0 in range(0, columns, GROUP):
            begin = 3 * ((s0 - REACH) * columns + f0 - REACH)
            for g in range(GROUP):
                mine, scaled = rows[3 * g : 3 * g + 3], weighted[3 * g : 3 * g + 3]
                if f0 + g >= columns:
                    scaled[:] = 0.0
                    continue
                node = s0 * columns + f0 + g
                f2 = force[node, 2]
                balance_rows(
                    node, tangent, f2, slope[node], first[node], table_x[node], table_y[node], shape, g, mine
                )
                for i in range(3):
                    d = weight[node, i] if is_free[node, i] else 0.0
                    balance = force[node, i] + (slope[node, i] * f2 if i < 2 else 0.0)
                    scale = tangent.dtype.type(d)
                    for a in range(low, high):
                        row, into = mine[i, a], scaled[i, a]
                        for q in range(LANES):
                            into[q] = scale * row[q]
                        at = begin + 3 * a * columns
                        for q in range(3 * max(REACH - f0, g), 3 * min(ROW + g, columns - f0 + REACH)):
                            gradient[at + q] += d * balance * row[q]
            _add_group(rows, weighted, begin, low, high, columns, front, width, band, tile)


@njit(cache=True, nogil=True, fastmath=True)
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


BLOCK = 32  # unknowns that are eliminated at once


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _eliminate_corner(panel, size, inverse):
    """Cholesky of the corner of `panel` in place (upper), and its inverse; False when it is not positive."""
    for k in range(size):
        pivot = panel[k, k]
        if not pivot > 0.0:
            return False
        scale = 1.0 / np.sqrt(pivot)
        for q in range(k, size):
            panel[k, q] *= scale
        for i in range(k + 1, size):
            share = panel[k, i]
            for q in range(i, size):
                panel[i, q] -= share * panel[k, q]
    inverse[:] = 0.0
    for k in range(size):  # rows of the inverse from the bottom: U inverse = 1
        row = size - 1 - k
        scale = 1.0 / panel[row, row]
        inverse[row, row] = 1.0
        for i in range(row + 1, size):
            share = panel[row, i]
            for q in range(i, size):
                inverse[row, q] -= share * inverse[i, q]
        for q in range(row, size):
            inverse[row, q] *= scale
    return True


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def factorise(band, front, unknowns, width):
    """Cholesky of the band in place: H = U^T U, U stored as H was. False when H is not positive definite.

    The half-band must be at least as wide as a block; those of sheets are.
    """
    reach = (width + BLOCK + LANES - 1) // LANES * LANES
    panel = np.zeros((BLOCK, BLOCK + reach), band.dtype)
    solved, negative = np.zeros((BLOCK, reach), band.dtype), np.zeros((BLOCK, reach), band.dtype)
    inverse, tile = np.zeros((BLOCK, BLOCK), band.dtype), np.zeros((ROWS, LANES), band.dtype)
    flat_panel, flat_solved, flat_negative = panel.reshape(-1), solved.reshape(-1), negative.reshape(-1)
    flat_inverse, flat_tile = inverse.reshape(-1), tile.reshape(-1)
    for begin in range(0, unknowns, BLOCK):
        size = min(BLOCK, unknowns - begin)
        beyond = max(min(width, unknowns - begin - size), 0)
        panel[:] = 0.0
        for k in range(size):
            at = front + (begin + k) * (width + 1)
            last = min(width + 1, size + beyond - k)
            panel[k, k : k + last] = band[at : at + last]
        if not _eliminate_corner(panel, size, inverse):
            return False
        solved[:] = 0.0
        for p in range(0, size, ROWS):
            for q in range(0, beyond, LANES):
                add_product(
                    flat_solved, p * reach + q, reach, flat_inverse, p, BLOCK,
                    flat_panel, size + q, BLOCK + reach, min(p + ROWS, size),
                )  # fmt: skip
        for k in range(size):
            at = front + (begin + k) * (width + 1)
            band[at : at + size - k] = panel[k, k:size]
            last = min(width + 1 - size + k, beyond)
            band[at + size - k : at + size - k + last] = solved[k, :last]
            solved[k, last:] = 0.0
            for q in range(reach):
                negative[k, q] = -solved[k, q]
        corner = front + (begin + size) * (width + 1)
        for p in range(0, beyond, ROWS):
            start = p // LANES * LANES
            tile[:] = 0.0
            add_product(flat_tile, 0, LANES, flat_negative, p, reach, flat_solved, start, reach, size)
            for i in range(min(ROWS, beyond - p)):
                at = corner + (p + i) * width
                for q in range(p + i - start, LANES):
                    band[np.uintp(at + start + q)] += tile[i, q]
            for q in range(start + LANES, beyond, LANES):
                add_product(
                    band, corner + p * width + q, width, flat_negative, p, reach,
                    flat_solved, q, reach, size,
                )  # fmt: skip
    return True
