"""The compiled product of two splines on a grid."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from typing import no_type_check

import numpy as np
from numba import njit

FAST = {"contract", "nsz"}
TAPS = 4  # of a cubic spline
ONE, TWO, THREE = (np.uint64(number) for number in (1, 2, 3))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
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
    # rows of zeros after the last one are for splines with less than four taps
    wide = np.zeros((rows + TAPS, width))
    for r in range(rows):
        for x in range(width):
            at, here = np.uint64(first_x[x]), 0.0
            for t in range(tap_x.shape[1]):
                here += tap_x[x, t] * coefficient[r, at + np.uint64(t)]
            wide[r, x] = here
    out, part = np.empty((len(first_y), width)), np.zeros(TAPS)
    for y in range(len(first_y)):
        part[: tap_y.shape[1]] = tap_y[y]
        a, b, c, d = part[0], part[1], part[2], part[3]
        r = np.uint64(first_y[y])
        for x in range(np.uint64(width)):
            here = a * wide[r, x] + b * wide[r + ONE, x]
            out[y, x] = here + c * wide[r + TWO, x] + d * wide[r + THREE, x]
    return out
