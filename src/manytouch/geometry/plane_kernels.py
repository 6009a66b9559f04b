"""Compiled loops over markers in the plane of the sheet."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import no_type_check

import numpy as np
from numba import njit

ONE, TWO, THREE, FOUR = (np.uint64(number) for number in (1, 2, 3, 4))
FAST = {"reassoc", "contract", "nsz", "arcp"}  # NaN stays what it is


@njit(cache=True, nogil=True, inline="always")
@no_type_check
def _place(x, y, flat, rows, columns, each, low):
    """Where the plane is met by the ray of the pixel (x, y): x, y. `each` is one over the table's step."""
    x, y = (x - low) * each, (y - low) * each
    if not (abs(x) < 1e9 and abs(y) < 1e9):
        return np.nan, np.nan
    column, row = int(min(max(x, 0.0), columns - 2.0)), int(min(max(y, 0.0), rows - 2.0))
    x, y = x - column, y - row
    # weights of value and slope at both ends of a unit interval
    rest, x_rest, y_rest = 1.0 - x, x * (1.0 - x), y * (1.0 - y)
    x0, x1, x2, x3 = (1.0 + 2.0 * x) * rest * rest, x_rest * rest, x * x * (3.0 - 2.0 * x), -x_rest * x
    rest = 1.0 - y
    y0, y1, y2, y3 = (1.0 + 2.0 * y) * rest * rest, y_rest * rest, y * y * (3.0 - 2.0 * y), -y_rest * y
    # the nodes of a row follow each other, eight numbers each: x and y, value and slope along y, along x
    a = np.uint64(8 * (row * columns + column))
    b, c = a + np.uint64(8), a + np.uint64(8 * columns)
    d = c + np.uint64(8)
    place_x = place_y = 0.0
    for k in range(2):
        value, slope = (y0, y1) if k == 0 else (y2, y3)
        one, two = (a, b) if k == 0 else (c, d)
        place_x += value * (x0 * flat[one] + x1 * flat[one + ONE] + x2 * flat[two] + x3 * flat[two + ONE])
        place_x += slope * (
            x0 * flat[one + TWO] + x1 * flat[one + THREE] + x2 * flat[two + TWO] + x3 * flat[two + THREE]
        )
        one, two = one + FOUR, two + FOUR
        place_y += value * (x0 * flat[one] + x1 * flat[one + ONE] + x2 * flat[two] + x3 * flat[two + ONE])
        place_y += slope * (
            x0 * flat[one + TWO] + x1 * flat[one + THREE] + x2 * flat[two + TWO] + x3 * flat[two + THREE]
        )
    return place_x, place_y


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def looked_up(pixel, node, step, low):
    """(n, 2) places of pixels (n, 2) by a `plane.PlaneTable`."""
    out, flat = np.empty((len(pixel), 2)), node.reshape(-1)
    for m in range(len(pixel)):
        x, y = pixel[m, 0], pixel[m, 1]
        out[m, 0], out[m, 1] = _place(x, y, flat, node.shape[0], node.shape[1], 1.0 / step, low)
    return out


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def in_plane(pixel, covariance, node, step, low, rest, matrix):
    """Displacements (m, 2) in the plane, and their covariances (m, 2, 2).

    Args:
        pixel, covariance: (m, 2), (m, 2, 2) in the image.
        node, step, low: of a `plane.PlaneTable`.
        rest: (m, 2) places in the plane at rest.
        matrix: (m, 2, 2) derivatives of places with respect to pixels.
    """
    moved, out = np.empty((len(pixel), 2)), np.empty((len(pixel), 2, 2))
    flat, each = node.reshape(-1), 1.0 / step
    for m in range(len(pixel)):
        x, y = _place(pixel[m, 0], pixel[m, 1], flat, node.shape[0], node.shape[1], each, low)
        moved[m, 0], moved[m, 1] = x - rest[m, 0], y - rest[m, 1]
        a, b, c, d = matrix[m, 0, 0], matrix[m, 0, 1], matrix[m, 1, 0], matrix[m, 1, 1]
        xx, xy, yx, yy = covariance[m, 0, 0], covariance[m, 0, 1], covariance[m, 1, 0], covariance[m, 1, 1]
        top_x, top_y = a * xx + b * yx, a * xy + b * yy
        low_x, low_y = c * xx + d * yx, c * xy + d * yy
        out[m, 0, 0], out[m, 0, 1] = top_x * a + top_y * b, top_x * c + top_y * d
        out[m, 1, 0], out[m, 1, 1] = low_x * a + low_y * b, low_x * c + low_y * d
    return moved, out
