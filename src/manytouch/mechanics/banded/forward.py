"""Forward substitution with the Cholesky factor of a band for groups of 8 right-hand sides, compiled.

LAPACK solves one right-hand side after the other and reads the whole factor for each of them. Here it is
read once for all of them, and 8 unknowns of 8 right-hand sides stay in registers (`tile`). What is computed
for one of them does not depend on the others.
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import numpy as np
from jaxtyping import Float, Int64

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.mechanics.banded.tile import COLUMNS, ROWS, At, add_product

LANES = COLUMNS
"""Right-hand sides of a group."""

Flat = Float[np.ndarray, " k"]


@inlined_kernel(fastmath=True)
@no_type_check
def _solve_block(
    factor: Flat, width: int, rows: tuple[int, int], flat: Flat, minus: Flat, at: tuple[int, int]
) -> None:
    """Solve for up to ROWS unknowns of a group; what is before them was added to the right-hand sides.

    Args:
        factor, width: L and its half-band.
        rows: first and last + 1 of the unknowns.
        flat: right-hand sides, replaced by the solution.
        minus: gets the negative solution.
        at: where the right-hand sides and `minus` of the group begin.
    """
    (begin, end), (start, own) = rows, at
    for r in range(begin, end):
        for k in range(max(r - width, begin), r):
            part, known = factor[k * width + r], own + (k - begin) * LANES
            for lane in range(LANES):
                flat[start + r * LANES + lane] += part * minus[known + lane]
        inverse, known = 1.0 / factor[r * width + r], own + (r - begin) * LANES
        for lane in range(LANES):
            value = flat[start + r * LANES + lane] * inverse
            flat[start + r * LANES + lane] = value
            minus[known + lane] = -value


@inlined_kernel(fastmath=True)
@no_type_check
def _add_to_row(
    factor: Flat, width: int, columns: tuple[int, int], row: int, flat: Flat, minus: Flat, groups: int
) -> None:
    """Add what the unknowns of some columns change to the right-hand sides of one row, of all groups.

    Arguments as in `_solve_block`, but `columns`: first and last + 1 of these unknowns.
    """
    begin, end = columns
    for k in range(max(row - width, begin), end):
        part = factor[k * width + row]
        for group in range(groups):
            to = group * (len(flat) // groups) + row * LANES
            known = (group * ROWS + k - begin) * LANES
            for lane in range(LANES):
                flat[to + lane] += part * minus[known + lane]


@kernel(fastmath=True)
@no_type_check
def substitute(
    lower: Float[np.ndarray, "n band"],
    first: Int64[np.ndarray, " groups"],
    lanes: Float[np.ndarray, "groups n 8"],
) -> None:
    """Replace right-hand sides by L^-1 times them.

    What 8 unknowns change in those after them is added as soon as they are known, so that the factor is read
    once and in its order in memory.

    Args:
        lower: row p is column p of L from the diagonal down.
        first: rows before it are 0 in all right-hand sides of a group.
        lanes: the right-hand sides, one in each column of each group.
    """
    unknowns, width, block = lower.shape[0], lower.shape[1] - 1, ROWS * LANES
    factor, flat, size = lower.ravel(), lanes.ravel(), unknowns * LANES
    minus, edge = np.zeros(len(lanes) * block, lower.dtype), np.empty(ROWS * ROWS, lower.dtype)
    for begin in range(first.min() // ROWS * ROWS, unknowns, ROWS):
        end = min(begin + ROWS, unknowns)
        for group in range(len(lanes)):
            if first[group] < end:
                _solve_block(factor, width, (begin, end), flat, minus, (group * size, group * block))
        last = min(end + width, unknowns)  # rows from here on do not depend on these unknowns
        for row in range(end, last - ROWS + 1, ROWS):
            is_whole = row + ROWS <= begin + width + 1  # in the band of all of the columns
            if not is_whole:
                read_edge(factor, width, row, begin, edge)
            for group in range(len(lanes)):
                here, before = At(group * size + row * LANES, LANES), At(group * block, LANES)
                if is_whole:
                    add_product(flat, here, factor, At(begin * width + row, width), minus, before, ROWS)
                else:
                    add_product(flat, here, edge, At(0, ROWS), minus, before, ROWS)
        for row in range(last - (last - end) % ROWS, last):
            _add_to_row(factor, width, (begin, end), row, flat, minus, len(lanes))


@kernel()
@no_type_check
def read_edge(factor: Flat, width: int, row: int, begin: int, edge: Float[np.ndarray, " e"]) -> None:
    """Copy ROWS columns of L from `begin` on, of ROWS rows; what is outside the band is 0."""
    edge[:] = 0.0
    for k in range(begin, begin + ROWS):
        for r in range(row, min(k + width + 1, row + ROWS)):
            edge[(k - begin) * ROWS + r - row] = factor[k * width + r]
