"""Compiled loops of the paper's depth and of its standard deviation."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import numpy as np

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.estimation.perimeter.law_inputs import CellLists, LawErrors, Rays
from manytouch.values.arrays import Floats, Integers

ONE, TWO, THREE = (np.uint64(number) for number in (1, 2, 3))


@kernel(fastmath=REORDER)
@no_type_check
def cell_depths(plane: Floats, cells: CellLists, distance: float) -> tuple[Floats, Floats]:
    """Depth (c,) of each cell, and its derivative (c, 4, 2) with respect to its corners in the plane."""
    corner, rest_perimeter = cells.corner, cells.rest_perimeter
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
        scale = distance * ratio * each
        for k in range(4):
            slope[c, k, 0] *= scale
            slope[c, k, 1] *= scale
    return depth, slope


@kernel()
@no_type_check
def marker_depths(cells: CellLists, cell_depth: Floats) -> Floats:
    """Mean (m,) of the cells at each marker; NaN where there are none."""
    cell_first, cell = cells.cell_first, cells.cell
    depth = np.empty(len(cell_first) - 1)
    for m in range(len(depth)):
        total = 0.0
        for k in range(cell_first[m], cell_first[m + 1]):
            total += cell_depth[cell[k]]
        number = cell_first[m + 1] - cell_first[m]
        depth[m] = total / number if number > 0 else np.nan
    return depth


@kernel(fastmath=REORDER)
@no_type_check
def depth_noise(slope: Floats, cells: CellLists, covariance: Floats) -> tuple[Floats, Floats]:
    """Variance (m,) of the depths, and their covariance (m, 2) with the markers' own positions.

    Args:
        slope: (c, 4, 2) derivatives of the depths of the cells.
        cells: of the layout.
        covariance: (m, 2, 2) of the positions.
    """
    cell_first, first, pair_corner = cells.cell_first, cells.first, cells.pair_corner
    entry_first, entry = cells.entry_first, cells.entry
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


@kernel()
@no_type_check
def along_rays(
    plane: Floats, rays: Rays, depth: Floats, covariance: Floats, variance: Floats, mixed: Floats
) -> tuple[Floats, Floats]:
    """Displacements (m, 3) of markers at given depths on their rays, and their covariances (m, 3, 3).

    Args:
        plane: (m, 2) where the rays meet the plane of the sheet at rest.
        rays: at rest.
        depth, variance: (m,) with their variances.
        covariance: (m, 2, 2) of `plane`.
        mixed: (m, 2) covariance of the depth with `plane`.
    """
    rest, axis = rays.rest, rays.axis
    displacement = np.empty((len(plane), 3))
    out = np.empty((len(plane), 3, 3))
    each = 1.0 / rays.distance
    for m in range(len(plane)):
        shrink = 1.0 - depth[m] * each
        for i in range(2):
            arm = plane[m, i] - axis[i]
            displacement[m, i] = axis[i] + shrink * arm - rest[m, i]
            reach = arm * each
            for j in range(2):
                other = (plane[m, j] - axis[j]) * each
                out[m, i, j] = (
                    shrink * shrink * covariance[m, i, j]
                    - shrink * (mixed[m, i] * other + mixed[m, j] * reach)
                    + variance[m] * reach * other
                )
            out[m, i, 2] = -(shrink * mixed[m, i] - variance[m] * reach)
            out[m, 2, i] = out[m, i, 2]
        displacement[m, 2] = -depth[m]
        out[m, 2, 2] = variance[m]
    return displacement, out


@kernel()
@no_type_check
def law_displacements(
    plane: Floats, rays: Rays, cells: CellLists, covariance: Floats
) -> tuple[Floats, Floats]:
    """Displacements (m, 3) by the law and their covariances (m, 3, 3) from noise; see `along_rays`."""
    cell_depth, slope = cell_depths(plane, cells, rays.distance)
    depth = marker_depths(cells, cell_depth)
    variance, mixed = depth_noise(slope, cells, covariance)
    return along_rays(plane, rays, depth, covariance, variance, mixed)


@kernel()
@no_type_check
def surface_at_markers(
    displacement: Floats, view: Floats, rays: Rays, cells: CellLists, covariance: Floats, errors: LawErrors
) -> tuple[Floats, Floats]:
    """Displacements (m, 3) of the markers without the motion of the view, and covariances (m, 3, 3).

    Args:
        displacement: (m, 2) in the plane at rest.
        view: (3,) motion of the view: x, y and angle.
        rays, cells: of the law.
        covariance: (m, 2, 2) of `displacement`.
        errors: of the law.
    """
    rays, cells, errors = Rays(*rays), CellLists(*cells), LawErrors(*errors)
    rest = rays.rest
    cosine, sine = np.cos(view[2]) - 1.0, np.sin(view[2])
    plane = np.empty_like(displacement)
    for m in range(len(displacement)):
        x, y = rest[m, 0], rest[m, 1]
        plane[m, 0] = x + displacement[m, 0] - view[0] - (cosine * x - sine * y)
        plane[m, 1] = y + displacement[m, 1] - view[1] - (sine * x + cosine * y)
    out, spread = law_displacements(plane, rays, cells, covariance)
    error = law_error_variances(-out[:, 2], spread[:, 2, 2].copy(), errors)
    # an error of the depth moves the marker along its ray
    add_depth_variances(spread, error, rays)
    return out, spread


@kernel(fastmath=REORDER)
@no_type_check
def _add_neighbours(
    depth: Floats, variance: Floats, neighbour: Integers, slope: Floats, curvature: Floats, sums: Floats
) -> None:
    """Adds the contribution of one neighbour of each marker (m,) to `sums` (7, m)."""
    by_slope, slope_noise, own_slope = sums[0], sums[1], sums[2]
    by_curvature, curvature_noise, own_curvature, squares = sums[3], sums[4], sums[5], sums[6]
    for m in range(np.uint64(len(neighbour))):
        n = np.uint64(neighbour[m])
        there = depth[n]
        rise, noise = there - depth[m], variance[n]
        by_slope[m] += slope[m] * rise
        slope_noise[m] += slope[m] * slope[m] * noise
        own_slope[m] += slope[m]
        by_curvature[m] += curvature[m] * rise
        curvature_noise[m] += curvature[m] * curvature[m] * noise
        own_curvature[m] += curvature[m]
        squares[m] += there * there


@kernel()
@no_type_check
def law_error_variances(depth: Floats, variance: Floats, errors: LawErrors) -> Floats:
    """Variance (m,) of the law's deviation from the depth, from slope and curvature of its own map.

    Args:
        depth, variance: (m,); what their noise adds to slope and curvature is subtracted.
        errors: weights and parameters.
    """
    count, known, square = len(errors.neighbour), 0, 0.0
    for m in range(len(depth)):
        if not np.isnan(depth[m]):
            square += depth[m] * depth[m]
            known += 1
    spilt = errors.spill * square / max(known, 1)
    total, sums = np.empty(len(depth)), np.zeros((7, len(depth)))
    for k in range(count):
        _add_neighbours(depth, variance, errors.neighbour[k], errors.slope[k], errors.curvature[k], sums)
    for m in range(len(depth)):
        by_slope, by_curvature = sums[0, m], sums[3, m]
        slope_noise = sums[1, m] + sums[2, m] ** 2 * variance[m]
        curvature_noise = sums[4, m] + sums[5, m] ** 2 * variance[m]
        error = max(by_slope * by_slope - errors.noise_factor * slope_noise, 0.0)
        error += max(by_curvature * by_curvature - errors.noise_factor * curvature_noise, 0.0)
        # Slope and curvature are those of a map that contains the error itself, so the error is limited to
        # what the map shows.
        shown = 0.5 * (depth[m] * depth[m] + sums[6, m] / count) + spilt
        error *= shown / max((np.sqrt(error) + np.sqrt(shown)) ** 2, 1e-300)
        total[m] = error + (errors.scale_std * depth[m]) ** 2
        # The error is unknown where the depth of the marker or of a neighbour is.
        if np.isnan(by_slope) or np.isnan(slope_noise):
            total[m] = np.nan
    return total


@kernel()
@no_type_check
def add_depth_variances(covariance: Floats, variance: Floats, rays: Rays) -> None:
    """Adds variances (m,) of the depth, which moves markers along their rays, to covariances (m, 3, 3)."""
    rest, axis = rays.rest, rays.axis
    each = 1.0 / rays.distance
    for m in range(len(rest)):
        x, y, here = (rest[m, 0] - axis[0]) * each, (rest[m, 1] - axis[1]) * each, variance[m]
        covariance[m, 0, 0] += here * x * x
        covariance[m, 1, 1] += here * y * y
        covariance[m, 2, 2] += here
        covariance[m, 0, 1] += here * x * y
        covariance[m, 0, 2] += here * x
        covariance[m, 1, 2] += here * y
        for i in range(2):
            for j in range(i + 1, 3):
                covariance[m, j, i] = covariance[m, i, j]
