"""Surfaces through values at the markers of a lattice: products of two splines on a grid, compiled."""

import numpy as np

from manytouch.compilation import kernel, no_type_check, u64
from manytouch.geometry.sampling import Spline

TAPS = 4
"""Coefficients of a cubic spline that count at one position."""


@kernel(fastmath={"contract", "nsz"})
@no_type_check
def _coefficients(value: np.ndarray, order: np.ndarray, along_y: Spline, along_x: Spline) -> np.ndarray:
    """(rows, columns) coefficients of the surface through the values of the lattice."""
    rows, columns = len(along_y.solve), len(along_x.solve)
    across = np.zeros((rows, columns))
    for r in range(rows):
        for j in range(columns):
            here = value[order[r * columns + j]]
            for i in range(columns):
                across[r, i] += along_x.solve[j, i] * here
    coefficient = np.zeros((rows, columns))
    for r in range(rows):
        for s in range(rows):
            weight = along_y.solve[s, r]
            for i in range(columns):
                coefficient[r, i] += weight * across[s, i]
    return coefficient


@kernel(fastmath={"contract", "nsz"})
@no_type_check
def evaluate_on_grid(value: np.ndarray, order: np.ndarray, along_y: Spline, along_x: Spline) -> np.ndarray:
    """(ny, nx) values of the surface through the values of a lattice.

    Args:
        value: (m,) of the markers.
        order: (m,) marker at each place of the lattice, row by row.
        along_y, along_x: splines through the rows, evaluated at ny, and through the columns, at nx positions.
    """
    coefficient = _coefficients(value, order, along_y, along_x)
    rows, width = len(coefficient), len(along_x.first)
    first_x, tap_x, first_y, tap_y = along_x.first, along_x.tap, along_y.first, along_y.tap
    # Rows of zeros after the last one are for splines with less than four taps.
    wide = np.zeros((rows + TAPS, width))
    for r in range(rows):
        for x in range(width):
            at, here = u64(first_x[x]), 0.0
            for t in range(tap_x.shape[1]):
                here += tap_x[x, t] * coefficient[r, at + u64(t)]
            wide[r, x] = here
    out, part = np.empty((len(first_y), width)), np.zeros(TAPS)
    for y in range(len(first_y)):
        part[: tap_y.shape[1]] = tap_y[y]
        a, b, c, d = part[0], part[1], part[2], part[3]
        r = u64(first_y[y])
        for x in range(u64(width)):
            here = a * wide[r, x] + b * wide[r + u64(1), x]
            out[y, x] = here + c * wide[r + u64(2), x] + d * wide[r + u64(3), x]
    return out


@kernel(fastmath={"contract", "nsz"})
@no_type_check
def evaluate_at_points(
    value: np.ndarray, order: np.ndarray, along_y: Spline, along_x: Spline, place: np.ndarray
) -> np.ndarray:
    """(v, k) values of v surfaces through the values of a lattice.

    Args:
        value: (v, m) of the markers.
        order: (m,) marker at each place of the lattice, row by row.
        along_y, along_x: splines through the rows and the columns, evaluated on a grid.
        place: (k, 2) row and column of the grid.
    """
    out = np.empty((len(value), len(place)))
    columns = along_x.whole.shape[1]
    for k in range(len(place)):
        by_row, by_column = along_y.whole[place[k, 0]], along_x.whole[place[k, 1]]
        for v in range(len(value)):
            total = 0.0
            for r in range(len(by_row)):
                part = 0.0
                for c in range(columns):
                    part += by_column[c] * value[v, order[r * columns + c]]
                total += by_row[r] * part
            out[v, k] = total
    return out
