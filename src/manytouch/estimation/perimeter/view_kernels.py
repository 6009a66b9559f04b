"""Compiled loops that find the motion of the view, over flat arrays."""

# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments

from typing import no_type_check

import numpy as np
from numba import njit

FAST = {"reassoc", "contract", "nsz", "arcp"}  # NaN stays what it is
ENOUGH = 256  # places, of which deviations differ little


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


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _squares(x, y, u, v, motion, out):
    """Squared residuals of a motion."""
    shift_x, shift_y, turn = motion[0], motion[1], motion[2]
    for m in range(len(x)):
        a = u[m] - shift_x + turn * y[m]
        b = v[m] - shift_y - turn * x[m]
        out[m] = a * a + b * b


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _weight_below(square, weight, limit):
    total = 0.0
    for m in range(len(square)):
        total += weight[m] if square[m] < limit else 0.0
    return total


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _fitted(x, y, u, v, w, square, gate, motion):
    """Writes the motion (3,) that fits best with Tukey's weight; none counts beyond the gate."""
    each = 1.0 / (gate * gate) if gate > 0.0 else 0.0
    total = mean_x = mean_y = middle_x = middle_y = lever = turn = 0.0
    for m in range(len(x)):
        share = max(1.0 - square[m] * each, 0.0)
        share *= share * w[m]
        total += share
        mean_x += share * u[m]
        mean_y += share * v[m]
        middle_x += share * x[m]
        middle_y += share * y[m]
        lever += share * (x[m] * x[m] + y[m] * y[m])
        turn += share * (x[m] * v[m] - y[m] * u[m])
    mean_x, mean_y, middle_x, middle_y = mean_x / total, mean_y / total, middle_x / total, middle_y / total
    lever -= total * (middle_x * middle_x + middle_y * middle_y)
    turn -= total * (middle_x * mean_y - middle_y * mean_x)
    motion[2] = turn / lever if lever > 0.0 else 0.0
    motion[0], motion[1] = mean_x + motion[2] * middle_y, mean_y - motion[2] * middle_x


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
        pairs: (n, 2) markers; the voters' median displacement without a turn is proposed too.
        part: of the weight that must fit.
        voters: markers that judge, about.
    """
    seen = np.flatnonzero(is_seen)
    voter = seen[:: max(1, len(seen) // voters)]
    x, y, u, v = rest[voter, 0], rest[voter, 1], moved[voter, 0], moved[voter, 1]
    w = weight[voter]
    goal = part * w.sum()
    square = np.empty(len(voter))
    best, least = np.zeros(3), np.inf
    motion = np.empty(3)
    for k in range(len(pairs) + 1):
        if k < len(pairs):
            a, b = pairs[k]
            span_x, span_y = rest[b, 0] - rest[a, 0], rest[b, 1] - rest[a, 1]
            apart = span_x * span_x + span_y * span_y
            if not (is_seen[a] and is_seen[b] and apart > 0.0):
                continue
            off_x, off_y = moved[b, 0] - moved[a, 0], moved[b, 1] - moved[a, 1]
            motion[2] = (off_y * span_x - off_x * span_y) / apart
            motion[0] = 0.5 * (moved[a, 0] + moved[b, 0] + motion[2] * (rest[a, 1] + rest[b, 1]))
            motion[1] = 0.5 * (moved[a, 1] + moved[b, 1] - motion[2] * (rest[a, 0] + rest[b, 0]))
        else:
            motion[0], motion[1], motion[2] = np.median(u), np.median(v), 0.0
        _squares(x, y, u, v, motion, square)
        if _weight_below(square, w, least) >= goal:
            least = reach(square, w.copy(), goal)
            best[:] = motion
    return best


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def refined(rest, moved, is_seen, weight, motion, part, std, voters, rounds):
    """The motion (3,) after rounds of least squares with Tukey's weight, from the one that was proposed.

    How far residuals may lie is told by `voters` of the markers, about.
    """
    seen = np.flatnonzero(is_seen)
    x, y, u, v = rest[seen, 0], rest[seen, 1], moved[seen, 0], moved[seen, 1]
    w = weight[seen]
    step = max(1, len(seen) // voters)
    voted = w[::step].copy()
    goal = part * voted.sum()
    square = np.empty(len(seen))
    motion = motion.copy()
    for _ in range(rounds):
        _squares(x, y, u, v, motion, square)
        scale = np.sqrt(reach(square[::step].copy(), voted.copy(), goal))
        _fitted(x, y, u, v, w, square, 3.0 * max(scale, std), motion)
    return motion


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def usual_std(covariance, is_seen):
    """Median deviation along an axis of the places (m, 2, 2) that are known; some hundreds tell it."""
    step, wait = max(1, is_seen.sum() // ENOUGH), 0
    spread = np.empty(len(covariance))
    number = 0
    for m in range(len(covariance)):
        if is_seen[m]:
            if wait == 0:
                spread[number] = covariance[m, 0, 0] + covariance[m, 1, 1]
                number, wait = number + 1, step
            wait -= 1
    return np.sqrt(np.median(spread[:number]) / 2.0)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def motion_of(rest, moved, is_seen, std, weight, pairs, part, voters, rounds):
    """The motion (3,) of the view; none when nothing is seen. See `view.RigidMotionEstimator`."""
    if not is_seen.any():
        return np.zeros(3)
    motion = proposed(rest, moved, is_seen, weight, pairs, part, voters)
    return refined(rest, moved, is_seen, weight, motion, part, std, voters, rounds)
