"""Compiled loops of the paper's depth, over flat arrays."""

# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def cell_depths(plane, corner, rest_perimeter, distance):
    """Depth (c,) of each cell, and its derivative (c, 4, 2) with respect to its corners in the plane."""
    depth = np.empty(len(corner))
    slope = np.empty((len(corner), 4, 2))
    unit = np.empty((4, 2))
    for c in range(len(corner)):
        perimeter = 0.0
        for k in range(4):
            here, there = corner[c, k], corner[c, (k + 1) % 4]
            x, y = plane[there, 0] - plane[here, 0], plane[there, 1] - plane[here, 1]
            length = np.sqrt(x * x + y * y)
            perimeter += length
            scale = length if length > 0.0 else 1.0
            unit[k, 0], unit[k, 1] = x / scale, y / scale
        if not perimeter > 0.0:
            perimeter = np.nan
        ratio = rest_perimeter[c] / perimeter
        depth[c] = distance * (1.0 - ratio)
        steep = distance * ratio / perimeter
        for k in range(4):
            for axis in range(2):
                slope[c, k, axis] = steep * (unit[k - 1, axis] - unit[k, axis])
    return depth, slope


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def marker_depths(marker, cell, share, cell_depth, count):
    """Mean (count,) of the cells at each marker; NaN where there are none."""
    depth = np.zeros(count)
    is_lonely = np.ones(count, np.bool_)
    for k in range(len(marker)):
        depth[marker[k]] += share[k] * cell_depth[cell[k]]
        is_lonely[marker[k]] = False
    depth[is_lonely] = np.nan
    return depth


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def depth_noise(slope, first, pair_corner, entry_first, entry, entry_share, covariance):
    """Variance (m,) of the depths, and their covariance (m, 2) with the markers' own places.

    Args:
        slope: (c, 4, 2) derivatives of the cells' depths.
        first, pair_corner, entry_first, entry, entry_share: of the law.
        covariance: (m, 2, 2) of the places.
    """
    flat = slope.reshape(-1, 2)
    count = len(first) - 1
    variance, mixed = np.full(count, np.nan), np.full((count, 2), np.nan)
    for m in range(count):
        total = 0.0
        for q in range(first[m], first[m + 1]):
            along_x = along_y = 0.0
            for p in range(entry_first[q], entry_first[q + 1]):
                along_x += entry_share[p] * flat[entry[p], 0]
                along_y += entry_share[p] * flat[entry[p], 1]
            corner = pair_corner[q]
            x = covariance[corner, 0, 0] * along_x + covariance[corner, 0, 1] * along_y
            y = covariance[corner, 1, 0] * along_x + covariance[corner, 1, 1] * along_y
            total += along_x * x + along_y * y
            if corner == m:
                mixed[m, 0], mixed[m, 1] = x, y
        if first[m] < first[m + 1]:
            variance[m] = total
    return variance, mixed


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def along_rays(plane, rest, eye, distance, depth, covariance, variance, mixed):
    """Displacements (m, 3) of markers at some depth on their rays, and their covariances (m, 3, 3)."""
    moved = np.empty((len(plane), 3))
    out = np.empty((len(plane), 3, 3))
    for m in range(len(plane)):
        shrink = 1.0 - depth[m] / distance
        for i in range(2):
            arm = plane[m, i] - eye[i]
            moved[m, i] = eye[i] + shrink * arm - rest[m, i]
            reach = arm / distance
            for j in range(2):
                other = (plane[m, j] - eye[j]) / distance
                out[m, i, j] = (
                    shrink * shrink * covariance[m, i, j]
                    - shrink * (mixed[m, i] * other + mixed[m, j] * reach)
                    + variance[m] * reach * other
                )
            out[m, i, 2] = -(shrink * mixed[m, i] - variance[m] * reach)
            out[m, 2, i] = out[m, i, 2]
        moved[m, 2] = -depth[m]
        out[m, 2, 2] = variance[m]
    return moved, out


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def lawful(
    plane,
    rest,
    eye,
    distance,
    corner,
    rest_perimeter,
    marker,
    cell,
    share,
    first,
    pair_corner,
    entry_first,
    entry,
    entry_share,
    covariance,
):
    """The law in one call: displacements (m, 3), their covariances (m, 3, 3), depths (c,) of cells."""
    cell_depth, slope = cell_depths(plane, corner, rest_perimeter, distance)
    depth = marker_depths(marker, cell, share, cell_depth, len(plane))
    variance, mixed = depth_noise(slope, first, pair_corner, entry_first, entry, entry_share, covariance)
    moved, spread = along_rays(plane, rest, eye, distance, depth, covariance, variance, mixed)
    return moved, spread, cell_depth


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def law_errors(depth, variance, index, lean, bend, feigned, spill, scale):
    """Variance (m,) of the law about the depth of the sheet, from the slope and curvature of its own map.

    Args:
        depth, variance: (m,); what their noise feigns in slope and curvature is taken off.
        index: (m, k) the neighbours of each marker.
        lean, bend: (m, k) what a neighbour's depth above the marker's own adds to the two errors of the law.
        feigned: how much of the noise.
        spill: mean squares of the whole map that may show up anywhere.
        scale: relative deviation of all depths.
    """
    count, known, square = index.shape[1], 0, 0.0
    for m in range(len(depth)):
        if not np.isnan(depth[m]):
            square += depth[m] * depth[m]
            known += 1
    spilt = spill * square / max(known, 1)
    total = np.empty(len(depth))
    for m in range(len(depth)):
        leant = bent = lean_noise = bend_noise = around = 0.0
        for k in range(count):
            n = index[m, k]
            rise, noise = depth[n] - depth[m], np.sqrt(variance[n] + variance[m])
            leant += lean[m, k] * rise
            lean_noise += abs(lean[m, k]) * noise
            bent += bend[m, k] * rise
            bend_noise += bend[m, k] * noise
            around += depth[n] * depth[n]
        error = max(leant * leant - feigned * lean_noise * lean_noise, 0.0)
        error += max(bent * bent - feigned * bend_noise * bend_noise, 0.0)
        # The map that slope and curvature are taken from holds the error itself, so what the law adds is
        # never more than what the map shows.
        shown = 0.5 * (depth[m] * depth[m] + around / count) + spilt
        error *= shown / max((np.sqrt(error) + np.sqrt(shown)) ** 2, 1e-300)
        total[m] = error + (scale * depth[m]) ** 2
        # A marker or neighbour in no cell has no depth, and so has its error none.
        if np.isnan(leant) or np.isnan(lean_noise):
            total[m] = np.nan
    return total


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def widen(covariance, error, rest, eye, distance):
    """Adds errors (m,) of depth, which move markers along their rays, to covariances (m, 3, 3)."""
    ray = np.empty(3)
    ray[2] = -1.0
    for m in range(len(rest)):
        for axis in range(2):
            ray[axis] = -(rest[m, axis] - eye[axis]) / distance
        for i in range(3):
            for j in range(3):
                covariance[m, i, j] += error[m] * ray[i] * ray[j]
