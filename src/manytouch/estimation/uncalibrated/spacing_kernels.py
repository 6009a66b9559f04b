"""Compiled loop over the neighbours of markers."""

from typing import no_type_check

import numpy as np
from numba import njit

_LEAST = 0.2  # of an area or length that is left: what folds is not followed further


@njit(cache=True, nogil=True)
@no_type_check
def stretched(shift, neighbour, slope, across):
    """Logarithms (m,) of how areas and twice those of how lengths across have changed."""
    count, around = neighbour.shape
    area, length = np.empty(count), np.empty(count)
    for m in range(count):
        xx, xy, yx, yy = 1.0, 0.0, 0.0, 1.0
        for k in range(around):
            n = neighbour[m, k]
            u, v = shift[n, 0] - shift[m, 0], shift[n, 1] - shift[m, 1]
            xx += slope[m, k, 0] * u
            xy += slope[m, k, 0] * v
            yx += slope[m, k, 1] * u
            yy += slope[m, k, 1] * v
        area[m] = np.log(max(xx * yy - xy * yx, _LEAST))
        x = across[m, 0] * xx + across[m, 1] * yx
        y = across[m, 0] * xy + across[m, 1] * yy
        length[m] = np.log(max(x * x + y * y, _LEAST))
    return area, length
