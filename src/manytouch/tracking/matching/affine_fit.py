"""Kernels that fit an affine displacement field to the neighbours of a node by weighted least squares."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from manytouch.compilation import inlined_kernel, no_type_check
from manytouch.tracking.matching.records import Assignment, GraphArrays

RIDGE = 0.05
"""Added to the squares of the neighbours' offsets, in squared spacings: directions that no neighbour
determines get no gradient."""
ROBUST_SCALE = 0.02
"""Squared residual, in squared spacings, at which a robust weight is a quarter."""
LEAST_STRETCH, MOST_STRETCH = 0.35, 1.2


class AffineFit(NamedTuple):
    """Displacement around a node, px: shift plus gradient times the offset from its rest position."""

    shift_x: float
    shift_y: float
    gradient_xx: float
    gradient_xy: float
    gradient_yx: float
    gradient_yy: float


NO_FIT = AffineFit(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class NeighbourSums(NamedTuple):
    """Weighted sums over the known neighbours of a node: offsets x, y at rest, displacements u, v.

    Attributes:
        adjacent, used: numbers of adjacent, and of all neighbours with a dot.
        w, x, y, xx, xy, yy: sums of weights, of offsets and of their products.
        u, ux, uy, v, vx, vy: sums of displacements and of their products with offsets.
        square: sum of u^2 + v^2.
    """

    adjacent: int
    used: int
    w: float
    x: float
    y: float
    xx: float
    xy: float
    yy: float
    u: float
    ux: float
    uy: float
    v: float
    vx: float
    vy: float
    square: float


@inlined_kernel()
@no_type_check
def squared_residual(x: float, y: float, u: float, v: float, fit: AffineFit) -> float:
    """Squared distance of a displacement (u, v) at an offset (x, y) from a fit, px^2."""
    off_u = u - fit.shift_x - fit.gradient_xx * x - fit.gradient_xy * y
    off_v = v - fit.shift_y - fit.gradient_yx * x - fit.gradient_yy * y
    return off_u**2 + off_v**2


@inlined_kernel()
@no_type_check
def sum_neighbours(
    k: int, graph: GraphArrays, assignment: Assignment, previous: AffineFit, is_robust: bool
) -> NeighbourSums:
    """Sums over the neighbours of node k that have a dot; robust weights refer to a previous fit."""
    rest, neighbour, weight = graph.rest_px, graph.neighbour, graph.weight
    dot, displacement = assignment.dot, assignment.displacement_px
    scale = graph.spacing_px[k] * graph.spacing_px[k]
    adjacent_end = graph.adjacent_end[k]
    adjacent = used = 0
    sw = sx = sy = sxx = sxy = syy = 0.0
    su = sux = suy = sv = svx = svy = square = 0.0
    for j in range(graph.start[k], graph.start[k + 1]):
        n = neighbour[j]
        if dot[n] < 0:
            continue
        x, y = rest[n, 0] - rest[k, 0], rest[n, 1] - rest[k, 1]
        u, v = displacement[n, 0], displacement[n, 1]
        w = weight[j]
        if is_robust:
            w /= (1.0 + squared_residual(x, y, u, v, previous) / (ROBUST_SCALE * scale)) ** 2
        adjacent += j < adjacent_end
        used += 1
        sw += w
        sx += w * x
        sy += w * y
        sxx += w * x * x
        sxy += w * x * y
        syy += w * y * y
        su += w * u
        sux += w * u * x
        suy += w * u * y
        sv += w * v
        svx += w * v * x
        svy += w * v * y
        square += w * (u * u + v * v)
    return NeighbourSums(adjacent, used, sw, sx, sy, sxx, sxy, syy, su, sux, suy, sv, svx, svy, square)


@inlined_kernel()
@no_type_check
def solve_affine(sums: NeighbourSums, ridge_px2: float) -> tuple[AffineFit, float]:
    """The fit to one neighbour or more, and the weighted sum of its squared residuals (without the ridge)."""
    s = sums
    x, y, u, v = s.x / s.w, s.y / s.w, s.u / s.w, s.v / s.w
    a, b = s.xx - s.w * x * x + ridge_px2, s.xy - s.w * x * y
    c = s.yy - s.w * y * y + ridge_px2
    determinant = a * c - b * b
    px, py = s.ux - s.w * x * u, s.uy - s.w * y * u
    qx, qy = s.vx - s.w * x * v, s.vy - s.w * y * v
    gxx, gxy = (c * px - b * py) / determinant, (a * py - b * px) / determinant
    gyx, gyy = (c * qx - b * qy) / determinant, (a * qy - b * qx) / determinant
    explained = gxx * px + gxy * py + gyx * qx + gyy * qy
    fit = AffineFit(u - gxx * x - gxy * y, v - gyx * x - gyy * y, gxx, gxy, gyx, gyy)
    return fit, s.square - s.w * (u * u + v * v) - explained


@inlined_kernel()
@no_type_check
def fit_affine(
    k: int, graph: GraphArrays, assignment: Assignment, previous: AffineFit, is_robust: bool
) -> tuple[AffineFit, int]:
    """Fit around node k, and how many neighbours it uses; the previous fit where there are none."""
    sums = sum_neighbours(k, graph, assignment, previous, is_robust)
    if sums.used == 0:
        return previous, 0
    fit, _ = solve_affine(sums, RIDGE * (graph.spacing_px[k] * graph.spacing_px[k]))
    return fit, sums.used


@inlined_kernel()
@no_type_check
def rms_residual(
    k: int, graph: GraphArrays, assignment: Assignment, fit: AffineFit, is_robust: bool
) -> float:
    """Weighted rms of the residuals of a fit around node k, px."""
    rest, neighbour, weight = graph.rest_px, graph.neighbour, graph.weight
    dot, displacement = assignment.dot, assignment.displacement_px
    scale = graph.spacing_px[k] * graph.spacing_px[k]
    total = total_weight = 0.0
    for j in range(graph.start[k], graph.start[k + 1]):
        n = neighbour[j]
        if dot[n] >= 0:
            x, y = rest[n, 0] - rest[k, 0], rest[n, 1] - rest[k, 1]
            squared = squared_residual(x, y, displacement[n, 0], displacement[n, 1], fit)
            w = weight[j]
            if is_robust:
                w /= (1.0 + squared / (ROBUST_SCALE * scale)) ** 2
            total += w * squared
            total_weight += w
    return sqrt(total / total_weight)


@inlined_kernel()
@no_type_check
def least_stretch(fit: AffineFit) -> float:
    """Smaller singular value of 1 + gradient: how much the lattice is compressed; 0.35 to 1.2."""
    a, b, c, d = 1.0 + fit.gradient_xx, fit.gradient_xy, fit.gradient_yx, 1.0 + fit.gradient_yy
    square = a * a + b * b + c * c + d * d
    determinant = a * d - b * c
    least = 0.5 * (square - np.sqrt(max(0.0, square * square - 4.0 * determinant * determinant)))
    return min(MOST_STRETCH, max(LEAST_STRETCH, sqrt(max(0.0, least))))
