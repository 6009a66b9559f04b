"""Compiled loops over markers in the plane of the sheet."""

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, inline="always")
@no_type_check
def _hermite(t, out):
    """Weights of value and slope at both ends of a unit interval, at t: value, slope, value, slope."""
    rest = 1.0 - t
    out[0], out[1] = (1.0 + 2.0 * t) * rest * rest, t * rest * rest
    out[2], out[3] = t * t * (3.0 - 2.0 * t), -t * t * rest


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def looked_up(pixel, node, step, low):
    """(n, 2) places of pixels (n, 2) by a `plane.PlaneTable`."""
    out = np.empty((len(pixel), 2))
    along_x, along_y = np.empty(4), np.empty(4)
    rows, columns = node.shape[0], node.shape[1]
    for m in range(len(pixel)):
        x, y = (pixel[m, 0] - low) / step, (pixel[m, 1] - low) / step
        if not (np.isfinite(x) and np.isfinite(y)):
            out[m, 0] = out[m, 1] = np.nan
            continue
        column, row = int(min(max(x, 0.0), columns - 2.0)), int(min(max(y, 0.0), rows - 2.0))
        _hermite(x - column, along_x)
        _hermite(y - row, along_y)
        for axis in range(2):
            total = 0.0
            for i in range(2):
                for j in range(2):
                    here = node[row + i, column + j, axis]
                    total += along_y[2 * i] * (along_x[2 * j] * here[0, 0] + along_x[2 * j + 1] * here[0, 1])
                    total += along_y[2 * i + 1] * (
                        along_x[2 * j] * here[1, 0] + along_x[2 * j + 1] * here[1, 1]
                    )
            out[m, axis] = total
    return out
