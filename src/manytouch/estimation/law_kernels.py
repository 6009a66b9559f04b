"""Compiled loops of the paper's depth, over flat arrays."""

# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
@no_type_check
def depth_noise(slope, pair, pair_share, pair_cell, pair_place, pair_marker, pair_corner, own, covariance):
    """Variance (m,) of the depths, and their covariance (m, 2) with the markers' own places.

    Args:
        slope: (c, 4, 2) derivatives of the cells' depths.
        pair, pair_share, pair_cell, pair_place, pair_marker, pair_corner, own: of the law.
        covariance: (m, 2, 2) of the places.
    """
    jacobian = np.zeros((len(pair_marker), 2))
    for p in range(len(pair)):
        for axis in range(2):
            jacobian[pair[p], axis] += pair_share[p] * slope[pair_cell[p], pair_place[p], axis]
    variance = np.zeros(len(own))
    mixed = np.full((len(own), 2), np.nan)
    for q in range(len(pair_marker)):
        marker, corner = pair_marker[q], pair_corner[q]
        x = covariance[corner, 0, 0] * jacobian[q, 0] + covariance[corner, 0, 1] * jacobian[q, 1]
        y = covariance[corner, 1, 0] * jacobian[q, 0] + covariance[corner, 1, 1] * jacobian[q, 1]
        variance[marker] += jacobian[q, 0] * x + jacobian[q, 1] * y
        if own[marker] == q:
            mixed[marker, 0], mixed[marker, 1] = x, y
    for m in range(len(own)):
        if own[m] < 0:
            variance[m] = np.nan
    return variance, mixed


@njit(cache=True)
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


@njit(cache=True)
@no_type_check
def law_errors(rest, eye, distance, lever, index, apart, depth, variance, feigned):
    """Variance (m,) of the law about the depth of the sheet, from the slope and curvature of its own map.

    Args:
        rest: (m, 2) in the plane of the sheet.
        eye: (2,) foot of the camera.
        distance: of the camera.
        lever: half the thickness of the sheet.
        index, apart: (m, k) the neighbours of each marker and how far they are.
        depth, variance: (m,); what their noise feigns in slope and curvature is taken off.
        feigned: how much of it.
    """
    total = np.zeros(len(rest))
    count = index.shape[1]
    for m in range(len(rest)):
        lean = bend = lean_noise = bend_noise = 0.0
        for k in range(count):
            n = index[m, k]
            away = apart[m, k] * apart[m, k] * count
            along = 0.0
            for axis in range(2):
                along += (rest[n, axis] - rest[m, axis]) * (rest[m, axis] - eye[axis])
            rise = (depth[n] - depth[m]) / away
            noise = np.sqrt(variance[n] + variance[m]) / away
            lean += along * rise
            lean_noise += abs(along) * noise
            bend += rise
            bend_noise += noise
        stretch = 2.0 * distance * lever
        total[m] = max(lean * lean - feigned * lean_noise * lean_noise, 0.0)
        total[m] += stretch * stretch * max(bend * bend - feigned * bend_noise * bend_noise, 0.0)
        # A marker or neighbour in no cell has no depth, and so has its error none.
        if np.isnan(lean) or np.isnan(lean_noise):
            total[m] = np.nan
    return total


@njit(cache=True)
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
