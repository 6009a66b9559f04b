"""Kernels that find the dot nearest to a place: a hash grid, made once per frame."""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0917 - compiled functions take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def bin_dots(dot, cell_px):
    """Hash grid of dots: origin x, y, shape, start of each cell, dots in the order of their cells."""
    left = top = np.inf
    right = bottom = -np.inf
    for i in range(len(dot)):
        left, right = min(left, dot[i, 0]), max(right, dot[i, 0])
        top, bottom = min(top, dot[i, 1]), max(bottom, dot[i, 1])
    columns = int((right - left) / cell_px) + 1
    rows = int((bottom - top) / cell_px) + 1
    cell = np.empty(len(dot), np.int64)
    start = np.zeros(rows * columns + 1, np.int64)
    for i in range(len(dot)):
        cell[i] = int((dot[i, 1] - top) / cell_px) * columns + int((dot[i, 0] - left) / cell_px)
        start[cell[i] + 1] += 1
    for c in range(rows * columns):
        start[c + 1] += start[c]
    binned = np.empty(len(dot), np.int64)
    for i in range(len(dot) - 1, -1, -1):
        start[cell[i] + 1] -= 1
        binned[start[cell[i] + 1]] = i
    for c in range(rows * columns):
        start[c] = start[c + 1]
    start[rows * columns] = len(dot)
    return left, top, columns, rows, start, binned


@njit(cache=True, nogil=True, inline="always")
@no_type_check
def around(x, y, reach, columns, rows, each):
    """Columns and rows of the cells within reach of a place, that is given from the first one's corner.

    `each` is one over the size of a cell. Where the last column is less than the first, there are none.
    """
    left, right = int(np.floor((x - reach) * each)), int(np.floor((x + reach) * each))
    top, bottom = int(np.floor((y - reach) * each)), int(np.floor((y + reach) * each))
    return max(0, left), min(columns - 1, right), max(0, top), min(rows - 1, bottom)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def nearest_two(dot, bins, cell_px, x, y, gate_px):
    """Nearest dot within a gate or -1, its squared distance, and of the second nearest within 1.7 gates."""
    low_x, low_y, columns, rows, start, binned = bins
    reach = 1.7 * gate_px
    best, first, second = -1, gate_px * gate_px, reach * reach
    left, right, top, bottom = around(x - low_x, y - low_y, reach, columns, rows, 1.0 / cell_px)
    if right < left:
        return best, first, second
    for row in range(top, bottom + 1):
        for j in range(start[row * columns + left], start[row * columns + right + 1]):
            i = binned[j]
            d = (dot[i, 0] - x) ** 2 + (dot[i, 1] - y) ** 2
            if d < first:
                second = first if best >= 0 else second
                first, best = d, i
            elif d < second:
                second = d
    return best, first, second


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def match(dot, bins, cell_px, guess, kind, spacing, gate, owner, taker):
    """Fills `owner` with the mutually nearest pairs of guessed markers and dots, within `gate` spacings.

    Returns whether all present markers got one.
    """
    low_x, low_y, columns, rows, start, binned = bins
    taker[: len(dot)] = -1
    distance = np.empty(len(dot))
    for k in range(len(guess)):
        owner[k] = -1
        if kind[k] != 0:
            continue
        x, y, reach = guess[k, 0], guess[k, 1], gate * spacing[k]
        best, first = -1, reach * reach
        left, right, top, bottom = around(x - low_x, y - low_y, reach, columns, rows, 1.0 / cell_px)
        if right < left:
            continue
        for row in range(top, bottom + 1):
            for j in range(start[row * columns + left], start[row * columns + right + 1]):
                i = binned[j]
                d = (dot[i, 0] - x) ** 2 + (dot[i, 1] - y) ** 2
                if d < first:
                    first, best = d, i
        owner[k] = best
        if best >= 0 and (taker[best] < 0 or first < distance[best]):
            distance[best], taker[best] = first, k
    for k in range(len(guess)):
        if owner[k] >= 0 and taker[owner[k]] != k:
            owner[k] = -1
