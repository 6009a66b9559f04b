"""Compiled functions of `outlier_gate` and `uncalibrated.dot_area`: weights by neighbours, and a median."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Flags, Floats, Integers


@kernel()
@no_type_check
def median_where(value: Floats, is_known: Flags) -> float:
    """Median of the values (m,) where `is_known` (m,) is true."""
    return np.median(value[is_known])


@kernel()
@no_type_check
def _median(value: Floats, count: int, work: Floats) -> float:
    """Median of the first `count` values, of which there are about eight; `work` is overwritten."""
    for k in range(count):
        at, here = k, value[k]
        while at > 0 and work[at - 1] > here:
            work[at] = work[at - 1]
            at -= 1
        work[at] = here
    half = count // 2
    return float(work[half] if count % 2 else 0.5 * (work[half - 1] + work[half]))


@kernel()
@no_type_check
def neighbour_agreement(
    innovation: Floats, std: Floats, is_seen: Flags, neighbour: Integers, stds: float, spreads: float
) -> Floats:
    """Weight (m,) of each marker: 1 where its innovation is the median of its neighbours', 0 far from it.

    It is 1 where fewer than three neighbours are seen.

    Args:
        innovation: (m, 2) measured minus expected displacement, px.
        std: (m,) standard deviation of each centre along an axis, px.
        is_seen: (m,); others get the weight 0.
        neighbour: (m, k) markers around each marker.
        stds, spreads: see `outlier_gate.OutlierGate`.
    """
    count, around = neighbour.shape
    weight = np.zeros(count)
    x, y, off, work = np.empty(around), np.empty(around), np.empty(around), np.empty(around)
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
        middle_x, middle_y = _median(x, known, work), _median(y, known, work)
        for k in range(known):
            off[k] = np.hypot(x[k] - middle_x, y[k] - middle_y)
        scale = stds * std[m] + spreads * _median(off, known, work)
        far = np.hypot(innovation[m, 0] - middle_x, innovation[m, 1] - middle_y) / scale
        if far < 1.0:
            weight[m] = (1.0 - far * far) ** 2
    return weight
