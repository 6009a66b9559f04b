"""Forward substitution with the Cholesky factor of a band for 8 right-hand sides at once, compiled.

LAPACK solves one right-hand side after the other and reads the whole factor for each of them. Here 8 unknowns
of all right-hand sides stay in registers while the factor passes (`tile`). What is computed for one of them
does not depend on the others.
"""

import numpy as np
from jaxtyping import Float

from manytouch.compilation import kernel, no_type_check
from manytouch.mechanics.banded.tile import COLUMNS, ROWS, At, add_product

LANES = COLUMNS
"""Right-hand sides that are solved together."""


@kernel(fastmath=True)
@no_type_check
def substitute(lower: Float[np.ndarray, "n band"], first: int, lanes: Float[np.ndarray, "n 8"]) -> None:
    """Replace right-hand sides by L^-1 times them.

    Args:
        lower: row p is column p of L from the diagonal down.
        first: rows before it are 0 in all right-hand sides.
        lanes: the right-hand sides, one in each column.
    """
    unknowns, width = lower.shape[0], lower.shape[1] - 1
    factor, flat, minus = lower.ravel(), lanes.ravel(), np.zeros(lanes.size, lower.dtype)
    edge = np.empty(ROWS * ROWS, lower.dtype)
    begin = first // ROWS * ROWS
    for row in range(begin, unknowns, ROWS):
        end, known = min(row + ROWS, unknowns), begin
        if end == row + ROWS:
            # columns from `inner` on are in the band of all rows, those from `outer` on in that of some
            outer, inner, known = max(row - width, begin), min(max(end - 1 - width, begin), row), row
            if outer < inner:
                read_edge(factor, width, row, outer, inner, edge)
                here = At(row * LANES, LANES)
                before = At(outer * LANES, LANES)
                add_product(flat, here, edge, At(0, ROWS), minus, before, inner - outer)
            if inner < row:
                here = At(row * LANES, LANES)
                before = At(inner * LANES, LANES)
                add_product(flat, here, factor, At(inner * width + row, width), minus, before, row - inner)
        for r in range(row, end):
            for k in range(max(r - width, known), r):
                part = factor[k * width + r]
                for lane in range(LANES):
                    flat[r * LANES + lane] += part * minus[k * LANES + lane]
            inverse = 1.0 / factor[r * width + r]
            for lane in range(LANES):
                value = flat[r * LANES + lane] * inverse
                flat[r * LANES + lane] = value
                minus[r * LANES + lane] = -value


@kernel()
@no_type_check
def read_edge(  # noqa: PLR0917
    factor: Float[np.ndarray, " k"],
    width: int,
    row: int,
    outer: int,
    inner: int,
    edge: Float[np.ndarray, " e"],
) -> None:
    """Copy columns `outer` to `inner` of ROWS rows of L; what is outside the band is 0."""
    edge[:] = 0.0
    for k in range(outer, inner):
        for r in range(row, min(k + width + 1, row + ROWS)):
            edge[(k - outer) * ROWS + r - row] = factor[k * width + r]
