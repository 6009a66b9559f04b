"""Compiled loop over the neighbours of markers."""

from typing import NamedTuple

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Floats, Integers


class SpacingStencil(NamedTuple):
    """What depends on the layout only.

    Attributes:
        neighbour: (m, k) markers around each marker.
        slope: (m, k, 2) weights of their displacements, minus the marker's own, in the slope along x and y.
        across: (m, 2) unit vectors perpendicular to the direction from the foot of the optical axis.
        least: smallest remaining share of an area or length; a sheet that folds is not followed further.
    """

    neighbour: Integers
    slope: Floats
    across: Floats
    least: float


@kernel()
@no_type_check
def log_stretch(shift: Floats, stencil: SpacingStencil) -> tuple[Floats, Floats]:
    """(m,) logarithm of the change of areas, and twice that of lengths across, for displacements (m, 2)."""
    neighbour, slope, across = stencil.neighbour, stencil.slope, stencil.across
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
        area[m] = np.log(max(xx * yy - xy * yx, stencil.least))
        x = across[m, 0] * xx + across[m, 1] * yx
        y = across[m, 0] * xy + across[m, 1] * yy
        length[m] = np.log(max(x * x + y * y, stencil.least))
    return area, length
