"""Fits one or two patches, a ring, a bar, or a face of pressure to nodal forces, compiled."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.estimation.mechanics.clusters.patch_kernels import Forces, NodeGrid, Parameters, add_patches


class Whitened(NamedTuple):
    """The likelihood of n nodal forces.

    Attributes:
        white: (q, n) combinations, each divided by its standard deviation.
        aim: (q,) their most likely values.
    """

    white: Float64[np.ndarray, "q n"]
    aim: Float64[np.ndarray, " q"]


@kernel(fastmath=REORDER)
@no_type_check
def _combine(white: Float64[np.ndarray, "q n"], nodal: Forces, result: Float64[np.ndarray, " q"]) -> None:
    """Combinations of nodal forces, into `result`."""
    for q in range(len(result)):
        total = 0.0
        for k in range(len(nodal)):
            total += white[q, k] * nodal[k]
        result[q] = total


@kernel(fastmath=REORDER)
@no_type_check
def _misfit(
    theta: Parameters,
    grid: NodeGrid,
    likelihood: Whitened,
    nodal: Forces,
    residual: Float64[np.ndarray, " q"],
) -> float:
    """Nodal forces of what `theta` describes and their whitened residual; returns its square."""
    nodal[:] = 0.0
    add_patches(theta, grid, nodal)
    _combine(likelihood.white, nodal, residual)
    total = 0.0
    for q in range(len(residual)):
        residual[q] = likelihood.aim[q] - residual[q]
        total += residual[q] * residual[q]
    return total


@kernel(fastmath=REORDER)
@no_type_check
def nodal_slopes(
    theta: Parameters, step: Parameters, grid: NodeGrid, nodal: Forces, slope: Float64[np.ndarray, "p n"]
) -> None:
    """Derivatives of the nodal forces by the parameters, into `slope`; 0 of those with a step of 0.

    Args:
        theta: the parameters.
        step: (p,) of finite differences.
        grid: of the nodes.
        nodal: forces of `theta`.
        slope: result.
    """
    for p in range(len(theta)):
        slope[p] = 0.0
        if step[p] != 0.0:
            moved = theta.copy()
            moved[p] += step[p]
            add_patches(moved, grid, slope[p])
            for k in range(len(nodal)):
                slope[p, k] = (slope[p, k] - nodal[k]) / step[p]


@kernel(fastmath=REORDER)
@no_type_check
def _solve(matrix: Float64[np.ndarray, "p p"], right: Parameters) -> None:
    """Replace `right` by the solution of equations with a positive definite matrix, which is overwritten."""
    count = len(right)
    for i in range(count):
        for j in range(i):
            part = matrix[i, j]
            for k in range(j):
                part -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = part / matrix[j, j]
        pivot = matrix[i, i]
        for k in range(i):
            pivot -= matrix[i, k] * matrix[i, k]
        matrix[i, i] = math.sqrt(max(pivot, 1e-14 * matrix[i, i]))
    for i in range(count):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


@kernel(fastmath=REORDER)
@no_type_check
def fit_patches(
    theta: Parameters, step: Parameters, grid: NodeGrid, likelihood: Whitened, max_steps: int
) -> tuple[float, Float64[np.ndarray, "p p"]]:
    """Fits one or two patches, a ring, or a bar by Levenberg-Marquardt.

    Args:
        theta: (6,), (7,), (4,), (8,) or (9,) parameters of one or two patches, a ring, a bar or an elliptic
            face; initial values, replaced by the result.
        step: (p,) of finite differences; parameters with 0 are fixed.
        grid: of the nodes.
        likelihood: of the nodal forces.
        max_steps: of the iteration.

    Returns:
        Least misfit, and its curvature (p, p), the inverse covariance of the parameters.
    """
    count, rows, nodes = len(theta), len(likelihood.aim), likelihood.white.shape[1]
    now, tried, slope = np.empty(rows), np.empty(rows), np.empty((count, rows))
    nodal, other, by_nodes = np.empty(nodes), np.empty(nodes), np.empty((count, nodes))
    misfit, damping = _misfit(theta, grid, likelihood, nodal, now), 1e-3
    gram, pull = np.zeros((count, count)), np.empty(count)
    for _ in range(max_steps):
        nodal_slopes(theta, step, grid, nodal, by_nodes)
        for p in range(count):
            _combine(likelihood.white, by_nodes[p], slope[p])
        for p in range(count):
            _combine(slope[: p + 1], slope[p], gram[p, : p + 1])
            gram[: p + 1, p] = gram[p, : p + 1]
        _combine(slope, now, pull)
        before = misfit
        for _ in range(6):
            damped, moved = gram.copy(), pull.copy()
            for p in range(count):
                damped[p, p] += damping * gram[p, p] + 1e-9
            _solve(damped, moved)
            moved += theta
            found = _misfit(moved, grid, likelihood, other, tried)
            if found < misfit:
                theta[:], now[:], nodal[:], misfit = moved, tried, other, found
                damping = max(0.1 * damping, 1e-9)
                break
            damping = max(10.0 * damping, 1e-6)
        if before - misfit <= 1e-4 * before + 0.01:
            break
    return misfit, gram
