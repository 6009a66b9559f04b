"""Compiled loops that find the motion of the view, over flat arrays."""

# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def border_weights(rest, border_weight):
    """(m,) from 1 in the middle to `border_weight` at the border of points (m, 2)."""
    weight = np.zeros(len(rest))
    for axis in range(2):
        low, high = rest[:, axis].min(), rest[:, axis].max()
        half = max((high - low) / 2, 1e-12)
        for m in range(len(rest)):
            weight[m] = max(weight[m], abs((rest[m, axis] - low) / half - 1.0))
    return 1.0 + (border_weight - 1.0) * weight**2


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _residuals(x, y, u, v, motion, out):
    for m in range(len(x)):
        a = u[m] - motion[0] + motion[2] * y[m]
        b = v[m] - motion[1] - motion[2] * x[m]
        out[m] = np.sqrt(a * a + b * b)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def reach(residual, weight, goal):
    """The least residual (m,) within which the weight (m,) is at least `goal`; both arrays are reordered.

    C. A. R. Hoare 1961, doi:10.1145/366622.366647, with weights.
    """
    low, high, passed = 0, len(residual) - 1, 0.0
    while low < high:
        pivot = residual[(low + high) // 2]
        i, j = low - 1, high + 1
        while True:
            i += 1
            while residual[i] < pivot:
                i += 1
            j -= 1
            while residual[j] > pivot:
                j -= 1
            if i >= j:
                break
            residual[i], residual[j] = residual[j], residual[i]
            weight[i], weight[j] = weight[j], weight[i]
        left = weight[low : j + 1].sum()
        if passed + left >= goal:
            high = j
        else:
            passed += left
            low = j + 1
    return residual[low]


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def proposed(rest, moved, is_seen, weight, pairs, part, voters):
    """The motion (3,) of x, y and angle, of those that pairs of markers propose, that fits part of them best.

    Args:
        rest, moved: (m, 2) places and displacements.
        is_seen, weight: (m,).
        pairs: (n, 2) markers; their median displacement without a turn is proposed too.
        part: of the weight that must fit.
        voters: markers that judge, about.
    """
    seen = np.flatnonzero(is_seen)
    voter = seen[:: max(1, len(seen) // voters)]
    x, y, u, v = rest[voter, 0], rest[voter, 1], moved[voter, 0], moved[voter, 1]
    w = weight[voter]
    goal = part * w.sum()
    residual = np.empty(len(voter))
    best, least = np.zeros(3), np.inf
    motion = np.empty(3)
    for k in range(len(pairs) + 1):
        if k < len(pairs):
            a, b = pairs[k]
            span_x, span_y = rest[b, 0] - rest[a, 0], rest[b, 1] - rest[a, 1]
            square = span_x * span_x + span_y * span_y
            if not (is_seen[a] and is_seen[b] and square > 0.0):
                continue
            off_x, off_y = moved[b, 0] - moved[a, 0], moved[b, 1] - moved[a, 1]
            motion[2] = (off_y * span_x - off_x * span_y) / square
            motion[0] = 0.5 * (moved[a, 0] + moved[b, 0] + motion[2] * (rest[a, 1] + rest[b, 1]))
            motion[1] = 0.5 * (moved[a, 1] + moved[b, 1] - motion[2] * (rest[a, 0] + rest[b, 0]))
        else:
            motion[0], motion[1], motion[2] = np.median(moved[seen, 0]), np.median(moved[seen, 1]), 0.0
        _residuals(x, y, u, v, motion, residual)
        inside = 0.0
        for m in range(len(voter)):
            if residual[m] < least:
                inside += w[m]
        if inside >= goal:
            least = reach(residual, w.copy(), goal)
            best[:] = motion
    return best


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def refined(rest, moved, is_seen, weight, motion, part, std, rounds):
    """The motion (3,) after rounds of least squares with Tukey's weight, from the one that was proposed."""
    seen = np.flatnonzero(is_seen)
    x, y, u, v = rest[seen, 0], rest[seen, 1], moved[seen, 0], moved[seen, 1]
    w = weight[seen]
    goal = part * w.sum()
    residual, share = np.empty(len(seen)), np.empty(len(seen))
    motion = motion.copy()
    for _ in range(rounds):
        _residuals(x, y, u, v, motion, residual)
        gate = 3.0 * max(reach(residual.copy(), w.copy(), goal), std)
        total = mean_x = mean_y = middle_x = middle_y = 0.0
        for m in range(len(seen)):
            share[m] = w[m] * max(1.0 - (residual[m] / gate) ** 2, 0.0) ** 2 if gate > 0.0 else w[m]
            total += share[m]
            mean_x += share[m] * u[m]
            mean_y += share[m] * v[m]
            middle_x += share[m] * x[m]
            middle_y += share[m] * y[m]
        mean_x, mean_y, middle_x, middle_y = (
            mean_x / total,
            mean_y / total,
            middle_x / total,
            middle_y / total,
        )
        lever = turn = 0.0
        for m in range(len(seen)):
            a, b = x[m] - middle_x, y[m] - middle_y
            lever += share[m] * (a * a + b * b)
            turn += share[m] * (a * (v[m] - mean_y) - b * (u[m] - mean_x))
        motion[2] = turn / lever if lever > 0.0 else 0.0
        motion[0], motion[1] = mean_x + motion[2] * middle_y, mean_y - motion[2] * middle_x
    return motion
