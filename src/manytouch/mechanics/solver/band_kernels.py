"""The normal matrix of a Gauss-Newton step, assembled as a band, compiled."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from manytouch.compilation import kernel, no_type_check
from manytouch.mechanics.banded.band import Band
from manytouch.mechanics.banded.tile import COLUMNS, ROWS, At, add_product
from manytouch.mechanics.shell.tangent_kernels import REACH, ROW, Coefficients, Tangent

GROUP = 3  # adjacent nodes whose rows are added at once: together they reach over 9 nodes
LANES = 32  # numbers stored per row of these 9 nodes: 27, and padding


class SheetDerivatives(NamedTuple):
    """Forces of the sheet and what their derivatives consist of; see `Linearisation`."""

    force: Coefficients
    tangent: Tangent
    slope: Float64[np.ndarray, "nodes 2"]


class SlopeTables(NamedTuple):
    """Derivatives of the slopes at the nodes by the deflections around them.

    Attributes:
        first: (nodes, 2) slow and fast index of the first of 4 x 4 nodes around each node.
        x, y: (nodes, 4, 4) derivatives of w,x and w,y by the w of these nodes; 0 for fixed ones.
    """

    first: Int64[np.ndarray, "nodes 2"]
    x: Float64[np.ndarray, "nodes 4 4"]
    y: Float64[np.ndarray, "nodes 4 4"]


@kernel(fastmath=True)
@no_type_check
def balance_rows(
    node: int,
    sheet: SheetDerivatives,
    slopes: SlopeTables,
    shape: tuple[int, int],
    shift: int,
    rows: Float[np.ndarray, "3 7 32"],
) -> None:
    """Derivative of T f = (f_u + w,x f_w, f_v + w,y f_w, f_w) at one node, into `rows`.

    Args:
        node: number of the node.
        sheet: derivatives of the forces.
        slopes: derivatives of the slopes.
        shape: number of nodes along the slow and the fast axis.
        shift: number of nodes by which the result is moved along the fast axis.
        rows: result, by the 7 x 7 nodes around the node.
    """
    tangent, force_z = sheet.tangent, sheet.force[node, 2]
    slope_x, slope_y = tangent.dtype.type(sheet.slope[node, 0]), tangent.dtype.type(sheet.slope[node, 1])
    for a in range(ROW):
        for j in range(3):
            along_u, along_v, normal = tangent[node, 0, j, a], tangent[node, 1, j, a], tangent[node, 2, j, a]
            for b in range(ROW):
                place = 3 * (b + shift) + j
                rows[0, a, place] = along_u[b] + slope_x * normal[b]
                rows[1, a, place] = along_v[b] + slope_y * normal[b]
                rows[2, a, place] = normal[b]
    start = slopes.first[node, 0] - node // shape[1] + REACH
    along = slopes.first[node, 1] - node % shape[1] + REACH
    for a in range(4):
        for b in range(4):
            if 0 <= start + a < ROW and 0 <= along + b < ROW:
                place = 3 * (along + b + shift) + 2
                rows[0, start + a, place] += force_z * slopes.x[node, a, b]
                rows[1, start + a, place] += force_z * slopes.y[node, a, b]


@kernel(fastmath=True)
@no_type_check
def _add_group(
    rows: Float[np.ndarray, "9 7 32"],
    weighted: Float[np.ndarray, "9 7 32"],
    begin: int,
    slow_range: tuple[int, int],
    columns: int,
    band: Band,
    tile: Float[np.ndarray, "32 32"],
) -> None:
    """Add rows^T weighted to the band.

    Args:
        rows, weighted: of three adjacent nodes.
        begin: unknown of the first column at slow offset 0.
        slow_range: first and last + 1 slow offset inside the grid.
        columns: number of nodes along the fast axis.
        band: result.
        tile: work space.
    """
    values, width = band.values, band.width
    flat, flat_weighted, stride = rows.reshape(-1), weighted.reshape(-1), ROW * LANES
    flat_tile = tile.reshape(-1)
    low, high = slow_range
    for a in range(low, high):
        top = begin + 3 * a * columns
        tile[:] = 0.0
        for p in range(0, LANES, ROWS):
            left = At(a * LANES + p, stride)
            for q in range(p, LANES, COLUMNS):
                to = At(p * LANES + q, LANES)
                add_product(flat_tile, to, flat_weighted, left, flat, At(a * LANES + q, stride), 3 * GROUP)
            for c in range(a + 1, high):
                at = band.front + (top + p) * (width + 1) + 3 * (c - a) * columns - p
                for q in range(0, LANES, COLUMNS):
                    right = At(c * LANES + q, stride)
                    add_product(values, At(at + q, width), flat_weighted, left, flat, right, 3 * GROUP)
        for p in range(3 * (ROW + GROUP - 1)):
            place = band.front + (top + p) * (width + 1)
            for q in range(p, 3 * (ROW + GROUP - 1)):
                # unsigned: numba then does not test for negative indices
                values[np.uintp(place + q - p)] += tile[p, q]


@kernel(fastmath=True)
@no_type_check
def add_forces(
    sheet: SheetDerivatives,
    slopes: SlopeTables,
    weight: Coefficients,
    is_free: Bool[np.ndarray, "nodes 3"],
    shape: tuple[int, int],
    band: Band,
    gradient: Float64[np.ndarray, " n"],
) -> None:
    """Add R^T D R to the band and R^T D T f to the gradient, R = d(T f) / dc.

    Args:
        sheet: forces and their derivatives.
        slopes: derivatives of the slopes.
        weight: (nodes, 3) D.
        is_free: (nodes, 3) unknowns that are not fixed.
        shape: number of nodes along the slow and the fast axis.
        band: result.
        gradient: result.
    """
    slow, columns = shape
    kind = sheet.tangent.dtype
    rows = np.zeros((3 * GROUP, ROW, LANES), kind)
    weighted = np.zeros((3 * GROUP, ROW, LANES), kind)
    tile = np.zeros((LANES, LANES), kind)
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
                balance_rows(node, sheet, slopes, shape, g, mine)
                f2 = sheet.force[node, 2]
                for i in range(3):
                    d = weight[node, i] if is_free[node, i] else 0.0
                    balance = sheet.force[node, i] + (sheet.slope[node, i] * f2 if i < 2 else 0.0)
                    scale = kind.type(d)
                    for a in range(low, high):
                        row, into = mine[i, a], scaled[i, a]
                        for q in range(LANES):
                            into[q] = scale * row[q]
                        at = begin + 3 * a * columns
                        for q in range(3 * max(REACH - f0, g), 3 * min(ROW + g, columns - f0 + REACH)):
                            gradient[at + q] += d * balance * row[q]
            _add_group(rows, weighted, begin, (low, high), columns, band, tile)


@kernel(fastmath=True)
@no_type_check
def add_markers(
    derivative: Float[np.ndarray, "m 2 4 12"],
    residual: Float64[np.ndarray, "m 2"],
    information: Float[np.ndarray, "m 2 2"],
    first: Int64[np.ndarray, "m 2"],
    columns: int,
    band: Band,
    gradient: Float64[np.ndarray, " n"],
) -> None:
    """Add J^T W J to the band and J^T W r to the gradient.

    Args:
        derivative: (m, 2, 4, 12) J, by the coefficients of 4 x 4 nodes.
        residual: (m, 2) r.
        information: (m, 2, 2) W; markers with 0 are skipped.
        first: (m, 2) slow and fast index of the first of these nodes.
        columns: number of nodes along the fast axis.
        band: result.
        gradient: result.
    """
    values, width = band.values, band.width
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
                to = band.front + (begin + p) * (width + 1)
                for q in range(p, 12):
                    values[to + q - p] += w0 * derivative[i, 0, a, q] + w1 * derivative[i, 1, a, q]
                for c in range(a + 1, 4):
                    at = to + 3 * (c - a) * columns - p
                    for q in range(12):
                        values[at + q] += w0 * derivative[i, 0, c, q] + w1 * derivative[i, 1, c, q]
