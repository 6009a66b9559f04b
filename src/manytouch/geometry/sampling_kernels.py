"""The compiled product of two splines on a grid."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
@no_type_check
def spread_out(value, order, solve_y, solve_x, first_y, tap_y, first_x, tap_x):
    """(ny, nx) values of the surface through the lattice's values.

    Args:
        value: (m,) of the markers.
        order: (m,) marker at each place of the lattice, row by row.
        solve_y, solve_x, first_y, tap_y, first_x, tap_x: of `sampling.Spline`.
    """
    rows, columns, width = len(solve_y), len(solve_x), len(first_x)
    across = np.zeros((rows, columns))
    for r in range(rows):
        for j in range(columns):
            here = value[order[r * columns + j]]
            for i in range(columns):
                across[r, i] += solve_x[j, i] * here
    coefficient = np.zeros((rows, columns))
    for r in range(rows):
        for s in range(rows):
            weight = solve_y[s, r]
            for i in range(columns):
                coefficient[r, i] += weight * across[s, i]
    wide = np.zeros((rows, width))
    for r in range(rows):
        for x in range(width):
            for t in range(tap_x.shape[1]):
                wide[r, x] += tap_x[x, t] * coefficient[r, first_x[x] + t]
    out = np.zeros((len(first_y), width))
    for y in range(len(first_y)):
        for t in range(tap_y.shape[1]):
            weight, r = tap_y[y, t], first_y[y] + t
            for x in range(width):
                out[y, x] += weight * wide[r, x]
    return out
