"""Peaks of a map and the regions that belong to them, by watershed."""

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Floats, Integers


def watershed(height: np.ndarray, floor: float, merge: float) -> tuple[np.ndarray, np.ndarray]:
    """Labels each point of a map with the peak that it belongs to.

    The map is flooded from its highest point down. A point belongs to the region of its highest neighbour;
    where regions meet, the lower ones become part of the highest one unless the saddle lies below `merge`
    times their peaks.

    Args:
        height: (rows, columns); NaN counts as below everything.
        floor: points that are not higher belong to no region.
        merge: share of the lower peak; a saddle above it joins the regions.

    Returns:
        (rows, columns) number of the region or -1, and (p,) flat indices of the peaks, the highest first.
    """
    flat = height.ravel()
    above, down = _points_above(flat, floor)
    # sorted here, because numpy sorts faster than compiled loops
    label, peak = _flood(flat, above, np.argsort(down), height.shape[1], merge)
    return label.reshape(height.shape), peak


@kernel()
@no_type_check
def _root(parent: Integers, region: int) -> int:
    """The region that `region` has become part of."""
    while parent[region] != region:
        region = parent[region]
    return region


@kernel()
@no_type_check
def _points_above(flat: Floats, floor: float) -> tuple[Integers, Floats]:
    """Flat indices (n,) of the points that are higher than the floor, and their negative heights."""
    above, down, count = np.empty(len(flat), np.int64), np.empty(len(flat)), 0
    for i in range(len(flat)):
        if flat[i] > floor:
            above[count], down[count] = i, -flat[i]
            count += 1
    return above[:count], down[:count]


@kernel()
@no_type_check
def _flood(
    flat: Floats, above: Integers, sorting: Integers, columns: int, merge: float
) -> tuple[Integers, Integers]:
    """As `watershed`, from the flat indices (n,) of the points above the floor and what sorts them."""
    rows, order = len(flat) // columns, above[sorting]
    label = np.full(rows * columns, -1, np.int64)
    parent = np.empty(len(order), np.int64)
    peak = np.empty(len(order), np.int64)
    near = np.empty(8, np.int64)
    count = 0
    for i in order:
        row, column = i // columns, i % columns
        found, first, highest = 0, count, -1
        for a in range(max(row - 1, 0), min(row + 2, rows)):
            for b in range(max(column - 1, 0), min(column + 2, columns)):
                place = a * columns + b
                if label[place] >= 0:
                    near[found] = place
                    found += 1
                    first = min(first, _root(parent, label[place]))
                    # The highest neighbour decides; otherwise the highest region would surround the others.
                    if highest < 0 or flat[place] > flat[highest]:
                        highest = place
        for place in near[:found]:
            other = _root(parent, label[place])
            if other != first and flat[i] > merge * flat[peak[other]]:
                parent[other] = first
        own = _root(parent, label[highest]) if highest >= 0 else -1
        if own < 0:
            own = count
            parent[count] = count
            peak[count] = i
            count += 1
        label[i] = own
    number = np.full(count, -1, np.int64)
    kept = 0
    for k in range(count):
        if parent[k] == k:
            number[k] = kept
            peak[kept] = peak[k]
            kept += 1
    for i in order:
        label[i] = number[_root(parent, label[i])]
    return label, peak[:kept].copy()
