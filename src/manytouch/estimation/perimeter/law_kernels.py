"""Compiled loops of the paper's depth, over flat arrays."""

# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments

from typing import no_type_check

import numpy as np
from numba import njit

FAST = {"reassoc", "contract", "nsz", "arcp"}  # NaN stays what it is
ONE, TWO, THREE = (np.uint64(number) for number in (1, 2, 3))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def cell_depths(plane, corner, rest_perimeter, distance):
    """Depth (c,) of each cell, and its derivative (c, 4, 2) with respect to its corners in the plane."""
    depth = np.empty(len(corner))
    slope = np.empty((len(corner), 4, 2))
    for c in range(len(corner)):
        perimeter = 0.0
        last_x = last_y = 0.0
        # the edge that ends in the first corner comes first
        for k in range(4):
            here, there = corner[c, k - 1 if k > 0 else 3], corner[c, k]
            x, y = plane[there, 0] - plane[here, 0], plane[there, 1] - plane[here, 1]
            length = np.sqrt(x * x + y * y)
            perimeter += length
            each = 1.0 / length if length > 0.0 else 0.0
            x, y = x * each, y * each
            slope[c, k, 0], slope[c, k, 1] = x, y
            if k > 0:
                slope[c, k - 1, 0] -= x
                slope[c, k - 1, 1] -= y
            else:
                last_x, last_y = x, y
        slope[c, 3, 0] -= last_x
        slope[c, 3, 1] -= last_y
        each = 1.0 / perimeter if perimeter > 0.0 else np.nan
        ratio = rest_perimeter[c] * each
        depth[c] = distance * (1.0 - ratio)
        steep = distance * ratio * each
        for k in range(4):
            slope[c, k, 0] *= steep
            slope[c, k, 1] *= steep
    return depth, slope


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def marker_depths(cell_first, cell, cell_depth):
    """Mean (m,) of the cells at each marker; NaN where there are none."""
    depth = np.empty(len(cell_first) - 1)
    for m in range(len(depth)):
        total = 0.0
        for k in range(cell_first[m], cell_first[m + 1]):
            total += cell_depth[cell[k]]
        number = cell_first[m + 1] - cell_first[m]
        depth[m] = total / number if number > 0 else np.nan
    return depth


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def depth_noise(slope, cell_first, first, pair_corner, entry_first, entry, covariance):
    """Variance (m,) of the depths, and their covariance (m, 2) with the markers' own places.

    Args:
        slope: (c, 4, 2) derivatives of the cells' depths.
        cell_first, first, pair_corner, entry_first, entry: of the law.
        covariance: (m, 2, 2) of the places.
    """
    # flat arrays and unsigned indices: they need no check for negative ones
    flat, spread = slope.reshape(-1), covariance.reshape(-1)
    count = len(first) - 1
    variance, mixed = np.empty(count), np.empty((count, 2))
    for m in range(count):
        total, own_x, own_y = 0.0, np.nan, np.nan
        for q in range(first[m], first[m + 1]):
            # each corner has one cell at least
            at = TWO * np.uint64(entry[entry_first[q]])
            along_x, along_y = flat[at], flat[at + ONE]
            for p in range(entry_first[q] + 1, entry_first[q + 1]):
                at = TWO * np.uint64(entry[p])
                along_x += flat[at]
                along_y += flat[at + ONE]
            corner = np.uint64(4) * np.uint64(pair_corner[q])
            x = spread[corner] * along_x + spread[corner + ONE] * along_y
            y = spread[corner + TWO] * along_x + spread[corner + THREE] * along_y
            total += along_x * x + along_y * y
            if pair_corner[q] == m:
                own_x, own_y = x, y
        number = cell_first[m + 1] - cell_first[m]
        each = 1.0 / number if number > 0 else np.nan
        variance[m], mixed[m, 0], mixed[m, 1] = total * each * each, own_x * each, own_y * each
    return variance, mixed


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def along_rays(plane, rest, eye, distance, depth, covariance, variance, mixed):
    """Displacements (m, 3) of markers at some depth on their rays, and their covariances (m, 3, 3)."""
    moved = np.empty((len(plane), 3))
    out = np.empty((len(plane), 3, 3))
    each = 1.0 / distance
    for m in range(len(plane)):
        shrink = 1.0 - depth[m] * each
        for i in range(2):
            arm = plane[m, i] - eye[i]
            moved[m, i] = eye[i] + shrink * arm - rest[m, i]
            reach = arm * each
            for j in range(2):
                other = (plane[m, j] - eye[j]) * each
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
def lawful(plane, rest, eye, distance, law, covariance):
    """Displacements (m, 3) and their covariances (m, 3, 3); `law` is `PerimeterLaw.lists`."""
    corner, rest_perimeter, cell_first, cell, first, pair_corner, entry_first, entry = law
    cell_depth, slope = cell_depths(plane, corner, rest_perimeter, distance)
    depth = marker_depths(cell_first, cell, cell_depth)
    variance, mixed = depth_noise(slope, cell_first, first, pair_corner, entry_first, entry, covariance)
    return along_rays(plane, rest, eye, distance, depth, covariance, variance, mixed)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def sheet(moved, motion, rest, eye, distance, law, covariance, around, rest_mm, feigned, spill, scale):
    """The sheet at its markers: positions and displacements (m, 3), and covariances (m, 3, 3).

    Args:
        moved: (m, 2) displacements in the plane at rest.
        motion: (3,) of the view: x, y and angle.
        rest, eye, distance, law: of `PerimeterLaw`.
        covariance: (m, 2, 2) of `moved`.
        around: neighbours of each marker and what their depths add to the errors: see `law_errors`.
        rest_mm: (m, 3) of the layout.
        feigned, spill, scale: see `law_errors`.
    """
    index, lean, bend = around
    cosine, sine = np.cos(motion[2]) - 1.0, np.sin(motion[2])
    plane = np.empty_like(moved)
    for m in range(len(moved)):
        x, y = rest[m, 0], rest[m, 1]
        plane[m, 0] = x + moved[m, 0] - motion[0] - (cosine * x - sine * y)
        plane[m, 1] = y + moved[m, 1] - motion[1] - (sine * x + cosine * y)
    displacement, spread = lawful(plane, rest, eye, distance, law, covariance)
    depth, variance = -displacement[:, 2], spread[:, 2, 2].copy()
    error = law_errors(depth, variance, index, lean, bend, feigned, spill, scale)
    # what is wrong in depth moves the marker along its ray
    widen(spread, error, rest, eye, distance)
    return rest_mm + displacement, displacement, spread


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _add_neighbours(depth, variance, index, lean, bend, sums):
    """Adds to `sums` (5, m) what one neighbour of each marker (m,) says, see `law_errors`."""
    leant, lean_noise, bent, bend_noise, around = sums[0], sums[1], sums[2], sums[3], sums[4]
    for m in range(np.uint64(len(index))):
        n = np.uint64(index[m])
        there = depth[n]
        rise, noise = there - depth[m], np.sqrt(variance[n] + variance[m])
        leant[m] += lean[m] * rise
        lean_noise[m] += abs(lean[m]) * noise
        bent[m] += bend[m] * rise
        bend_noise[m] += bend[m] * noise
        around[m] += there * there


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def law_errors(depth, variance, index, lean, bend, feigned, spill, scale):
    """Variance (m,) of the law about the depth of the sheet, from the slope and curvature of its own map.

    Args:
        depth, variance: (m,); what their noise feigns in slope and curvature is taken off.
        index: (k, m) the neighbours of each marker.
        lean, bend: (k, m) what a neighbour's depth above the marker's own adds to the two errors of the law.
        feigned: how much of the noise.
        spill: mean squares of the whole map that may show up anywhere.
        scale: relative deviation of all depths.
    """
    count, known, square = len(index), 0, 0.0
    for m in range(len(depth)):
        if not np.isnan(depth[m]):
            square += depth[m] * depth[m]
            known += 1
    spilt = spill * square / max(known, 1)
    total, sums = np.empty(len(depth)), np.zeros((5, len(depth)))
    for k in range(count):
        _add_neighbours(depth, variance, index[k], lean[k], bend[k], sums)
    for m in range(len(depth)):
        leant, lean_noise, bent, bend_noise = sums[0, m], sums[1, m], sums[2, m], sums[3, m]
        error = max(leant * leant - feigned * lean_noise * lean_noise, 0.0)
        error += max(bent * bent - feigned * bend_noise * bend_noise, 0.0)
        # The map that slope and curvature are taken from holds the error itself, so what the law adds is
        # never more than what the map shows.
        shown = 0.5 * (depth[m] * depth[m] + sums[4, m] / count) + spilt
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
    each = 1.0 / distance
    for m in range(len(rest)):
        x, y, here = (rest[m, 0] - eye[0]) * each, (rest[m, 1] - eye[1]) * each, error[m]
        covariance[m, 0, 0] += here * x * x
        covariance[m, 1, 1] += here * y * y
        covariance[m, 2, 2] += here
        covariance[m, 0, 1] += here * x * y
        covariance[m, 0, 2] += here * x
        covariance[m, 1, 2] += here * y
        for i in range(2):
            for j in range(i + 1, 3):
                covariance[m, j, i] = covariance[m, i, j]
