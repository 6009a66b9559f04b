"""Compiled loops over the regions of the peaks of a load map."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Flags, Floats, Integers


@kernel()
@no_type_check
def shapes_of_peaks(
    load: Floats, label: Integers, height: Floats, stays: Flags, x: Floats, y: Floats, top_share: float
) -> tuple[Floats, Floats, Integers]:
    """Centres (c, 2), areas (c,) and regions (ny, nx) of the peaks that stay.

    Args:
        load: (ny, nx) at the points of a map.
        label: (ny, nx) number of the peak that a point belongs to, or -1.
        height, stays: (p,) of all peaks.
        x, y: (nx,), (ny,) columns and rows of the map.
        top_share: the centre is that of the load above this share of the peak; a region is above half of it.
    """
    number, count = np.full(len(stays), -1), 0
    for p in range(len(stays)):
        if stays[p]:
            number[p] = count
            count += 1
    centre, total, area = np.zeros((count, 2)), np.zeros(count), np.zeros(count)
    region = np.full(load.shape, -1)
    for r in range(load.shape[0]):
        for c in range(load.shape[1]):
            if label[r, c] < 0 or number[label[r, c]] < 0:
                continue
            peak = number[label[r, c]]
            share = load[r, c] / height[label[r, c]]
            if share > 0.5:
                region[r, c] = peak
                area[peak] += 1.0
            if share > top_share:
                total[peak] += load[r, c]
                centre[peak, 0] += load[r, c] * x[c]
                centre[peak, 1] += load[r, c] * y[r]
    cell = (x[1] - x[0]) * (y[1] - y[0])
    for peak in range(count):
        centre[peak, 0] /= total[peak]
        centre[peak, 1] /= total[peak]
        area[peak] *= cell
    return centre, area, region


@kernel()
@no_type_check
def deepest_points(depth: Floats, region: Integers, count: int) -> Integers:
    """(count, 2) row and column of the deepest point of each region of a map, the first of several.

    Args:
        depth: (ny, nx); what is not finite is below everything.
        region: (ny, nx) number of the region of each point, or -1.
        count: number of regions.
    """
    at, most = np.full((count, 2), -1), np.full(count, -np.inf)
    for r in range(depth.shape[0]):
        for c in range(depth.shape[1]):
            k = region[r, c]
            if k >= 0 and (at[k, 0] < 0 or (np.isfinite(depth[r, c]) and depth[r, c] > most[k])):
                at[k, 0], at[k, 1] = r, c
                most[k] = depth[r, c] if np.isfinite(depth[r, c]) else -np.inf
    return at
