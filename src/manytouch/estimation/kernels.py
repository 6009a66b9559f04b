"""Compiled functions that estimators share: weights by neighbours, motion without the view's."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Flags, Floats, Integers

_NEGLIGIBLE = 1e-9  # of the stiffness of a motion of the view per marker, so that it is determined
_LEAST_SCALE = 1e-3  # pitches, of the lengths at which markers lose their weight; a choice


@kernel()
@no_type_check
def _median(value: Floats, count: int, work: Floats) -> float:
    """Median of the first `count` values, of which there are about eight; `work` is overwritten."""
    for k in range(count):
        here = value[k]
        for at in range(k):  # no branches: the order of the values cannot be foreseen
            low = min(work[at], here)
            here = max(work[at], here)
            work[at] = low
        work[k] = here
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


@kernel()
@no_type_check
def solve_damped(matrix: Floats, damping: float, right: Floats) -> Floats:
    """Solution (p,) of equations whose diagonal is increased by a share `damping`, by Cholesky's factor.

    Args:
        matrix: (p, p) symmetric; only its lower triangle is read.
        damping: at least 0.
        right: (p,).

    Returns:
        NaN where the matrix is not positive definite.
    """
    count = len(right)
    factor, solution = np.empty((count, count)), right.copy()
    for i in range(count):
        for j in range(i + 1):
            total = matrix[i, j] * (1.0 + damping) if i == j else matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = np.sqrt(total) if i == j else total / factor[j, j]
    for i in range(count):
        for k in range(i):
            solution[i] -= factor[i, k] * solution[k]
        solution[i] /= factor[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            solution[i] -= factor[k, i] * solution[k]
        solution[i] /= factor[i, i]
    return solution


@kernel()
@no_type_check
def lengths_without_view(
    view: Floats, moved: Floats, is_seen: Flags, refinements: int, reach: float
) -> Floats:
    """Lengths (m,) of displacements without the motion of the view, which is fitted to most of the markers.

    Args:
        view: (2, m, p) displacements along x and y for each parameter of a motion of the view.
        moved: (m, 2) displacements, pitches; 0 where not seen.
        is_seen: (m,) at least one.
        refinements: rounds of weighting, at least one.
        reach: length over the median length at which a marker has no weight.
    """
    axes, count, unknowns = view.shape
    weight, length, known = np.empty(count), np.empty(count), np.empty(count)
    for m in range(count):
        weight[m] = 1.0 if is_seen[m] else 0.0
    gram, pull = np.empty((unknowns, unknowns)), np.empty(unknowns)
    for _ in range(refinements):
        gram[:] = 0.0
        pull[:] = 0.0
        for i in range(unknowns):
            gram[i, i] = _NEGLIGIBLE * count
        for axis in range(axes):
            for m in range(count):
                for i in range(unknowns):
                    part = weight[m] * view[axis, m, i]
                    pull[i] += part * moved[m, axis]
                    for j in range(i + 1):
                        gram[i, j] += part * view[axis, m, j]
        motion = solve_damped(gram, 0.0, pull)
        seen = 0
        for m in range(count):
            x, y = moved[m, 0], moved[m, 1]
            for i in range(unknowns):
                x -= view[0, m, i] * motion[i]
                y -= view[1, m, i] * motion[i]
            length[m] = np.hypot(x, y)
            if is_seen[m]:
                known[seen] = length[m]
                seen += 1
        scale = reach * np.median(known[:seen]) + _LEAST_SCALE
        for m in range(count):
            far = length[m] / scale
            weight[m] = (1.0 - far * far) ** 2 if is_seen[m] and far < 1.0 else 0.0
    return length
