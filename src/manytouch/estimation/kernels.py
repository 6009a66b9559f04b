"""Compiled loops that several estimators share."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Flags, Floats, Integers


@kernel()
@no_type_check
def median_where(value: Floats, is_known: Flags) -> float:
    """The median of the known ones of values (m,)."""
    return np.median(value[is_known])


@kernel()
@no_type_check
def neighbour_agreement(
    innovation: Floats, std: Floats, is_seen: Flags, neighbour: Integers, stds: float, spreads: float
) -> Floats:
    """Weights (m,) from 0 to 1 of vectors (m, 2) by their distance from the median of their neighbours'.

    Args:
        innovation: (m, 2).
        std: (m,) standard deviations of these along an axis.
        is_seen: (m,); others get the weight 0.
        neighbour: (m, k) markers around each marker.
        stds, spreads: see `outlier_gate.OutlierGate`.
    """
    count, around = neighbour.shape
    weight = np.zeros(count)
    x, y, off = np.empty(around), np.empty(around), np.empty(around)
    for m in range(count):
        if not is_seen[m]:
            continue
        known = 0
        for k in neighbour[m]:
            if is_seen[k]:
                x[known], y[known] = innovation[k, 0], innovation[k, 1]
                known += 1
        if known < 3:
            weight[m] = 1.0
            continue
        middle_x, middle_y = np.median(x[:known]), np.median(y[:known])
        for k in range(known):
            off[k] = np.hypot(x[k] - middle_x, y[k] - middle_y)
        scale = stds * std[m] + spreads * np.median(off[:known])
        far = np.hypot(innovation[m, 0] - middle_x, innovation[m, 1] - middle_y) / scale
        if far < 1.0:
            weight[m] = (1.0 - far * far) ** 2
    return weight
