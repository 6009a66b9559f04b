"""Compiled loops of the estimators, over flat arrays."""

# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
@no_type_check
def _root(parent, hill):
    while parent[hill] != hill:
        hill = parent[hill]
    return hill


def hills(height: np.ndarray, floor: float, merge: float) -> tuple[np.ndarray, np.ndarray]:
    """Peaks of a map: where does each point above a floor belong, and how high is each hill's peak?

    The map is flooded from its highest point down (the watershed), and a point belongs to the hill of its
    highest neighbour; where two hills meet, the lower one is part of the higher one unless the saddle lies
    below `merge` times its peak.

    Args:
        height: (rows, columns); NaN is below everything.
        floor: points that are not higher belong to no hill.
        merge: share of a hill's peak; a saddle above it joins the hill to the other one.

    Returns:
        (rows, columns) number of the hill or -1, and (h,) flat places of the peaks, the highest first.
    """
    flat = height.ravel()
    above = np.flatnonzero(flat > floor)
    # numpy sorts in lanes, compiled loops do not
    label, peak = _flooded(flat, above[np.argsort(-flat[above])], height.shape[1], merge)
    return label.reshape(height.shape), peak


@njit(cache=True, nogil=True)
@no_type_check
def _flooded(flat, order, columns, merge):
    """As `hills`, from the points (n,) that belong to hills, the highest first."""
    rows = len(flat) // columns
    label = np.full(rows * columns, -1, np.int64)
    parent = np.empty(len(order), np.int64)
    peak = np.empty(len(order), np.int64)
    count = 0
    for i in order:
        row, column = i // columns, i % columns
        mine, best = -1, 0.0
        for a in range(max(row - 1, 0), min(row + 2, rows)):
            for b in range(max(column - 1, 0), min(column + 2, columns)):
                near = a * columns + b
                if label[near] < 0:
                    continue
                other = _root(parent, label[near])
                if mine >= 0 and mine != other:
                    high, lower = min(mine, other), max(mine, other)
                    if flat[i] > merge * flat[peak[lower]]:
                        parent[lower] = high
                        mine = other = high
                # Uphill from here: else the highest hill would flow around the others.
                if mine < 0 or flat[near] > best:
                    mine, best = other, flat[near]
        if mine < 0:
            mine = count
            parent[count] = count
            peak[count] = i
            count += 1
        label[i] = mine
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


@njit(cache=True, nogil=True)
@no_type_check
def median(value, is_known):
    """The median of the values (m,) that are known."""
    return np.median(value[is_known])


@njit(cache=True, nogil=True)
@no_type_check
def loners(innovation, std, is_seen, neighbour, stds, spreads):
    """Weights (m,) from 0 to 1 of vectors (m, 2) by how far each is from the median of its neighbours'."""
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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _fill_one(m, near, distance, known, moved, covariance, spread, floor):
    """Gives marker m the weighted mean of its known neighbours."""
    total = x = y = 0.0
    for k in range(len(near)):
        n = near[k]
        if known[n]:
            weight = 1.0 / (distance[k] * distance[k])
            total += weight
            x += weight * moved[n, 0]
            y += weight * moved[n, 1]
    x, y = x / total, y / total
    xx = xy = yy = 0.0
    for k in range(len(near)):
        n = near[k]
        if known[n]:
            weight = 1.0 / (distance[k] * distance[k] * total)
            a, b = moved[n, 0] - x, moved[n, 1] - y
            xx += weight * (covariance[n, 0, 0] + spread * a * a)
            xy += weight * (covariance[n, 0, 1] + spread * a * b)
            yy += weight * (covariance[n, 1, 1] + spread * b * b)
    moved[m, 0], moved[m, 1] = x, y
    covariance[m, 0, 0], covariance[m, 1, 1] = xx + floor * floor, yy + floor * floor
    covariance[m, 0, 1] = covariance[m, 1, 0] = xy


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def filled(moved, covariance, is_seen, around, spread, floor, far, rounds):
    """Displacements (m, 2) and covariances (m, 2, 2), those not seen filled from the rim inward.

    Args:
        moved, covariance, is_seen: (m, 2), (m, 2, 2), (m,).
        around: (m, k) neighbours of each marker, and how far they are.
        spread, floor: see `unseen.FillUnseen`; `floor` is a length here.
        far: deviation where nothing is known.
        rounds: at most.
    """
    index, distance = around
    moved, covariance, known = moved.copy(), covariance.copy(), is_seen.copy()
    for m in range(len(moved)):
        if not known[m]:
            moved[m, 0] = moved[m, 1] = covariance[m, 0, 1] = covariance[m, 1, 0] = 0.0
            covariance[m, 0, 0] = covariance[m, 1, 1] = far * far
    rim = np.empty(len(moved), np.int64)
    for _ in range(rounds):
        number = 0
        for m in range(len(moved)):
            if not known[m]:
                for k in range(index.shape[1]):
                    if known[index[m, k]]:
                        rim[number] = m
                        number += 1
                        break
        if number == 0:
            break
        for m in rim[:number]:
            _fill_one(m, index[m], distance[m], known, moved, covariance, spread, floor)
        for m in rim[:number]:
            known[m] = True
    return moved, covariance
