"""Compiled loops that find the motion of the view."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import numpy as np

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.estimation.perimeter.surface_inputs import MotionSearch
from manytouch.values.arrays import Flags, Floats

STD_SAMPLE = 256  # covariances that a median is taken of, because they differ little


@kernel()
@no_type_check
def border_weights(rest: Floats, border_weight: float) -> Floats:
    """(m,) from 1 in the middle to `border_weight` at the border of points (m, 2)."""
    weight = np.zeros(len(rest))
    for axis in range(2):
        low, high = rest[:, axis].min(), rest[:, axis].max()
        half = max((high - low) / 2, 1e-12)
        for m in range(len(rest)):
            weight[m] = max(weight[m], abs((rest[m, axis] - low) / half - 1.0))
    return 1.0 + (border_weight - 1.0) * weight**2


@kernel(fastmath=REORDER)
@no_type_check
def _squared_residuals(x: Floats, y: Floats, u: Floats, v: Floats, motion: Floats, out: Floats) -> None:
    """Writes the squared residuals (m,) of a motion (3,) at places x, y with displacements u, v."""
    shift_x, shift_y, turn = motion[0], motion[1], motion[2]
    for m in range(len(x)):
        a = u[m] - shift_x + turn * y[m]
        b = v[m] - shift_y - turn * x[m]
        out[m] = a * a + b * b


@kernel(fastmath=REORDER)
@no_type_check
def _weight_below(square: Floats, weight: Floats, limit: float) -> float:
    """Sum of the weights (m,) whose squared residuals (m,) are below a limit."""
    total = 0.0
    for m in range(len(square)):
        total += weight[m] if square[m] < limit else 0.0
    return total


@kernel(fastmath=REORDER)
@no_type_check
def _fit_motion(
    x: Floats, y: Floats, u: Floats, v: Floats, w: Floats, square: Floats, gate: float, motion: Floats
) -> None:
    """Writes the motion (3,) that fits best with Tukey's weight, which is 0 beyond the gate."""
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


@kernel()
@no_type_check
def weighted_quantile(residual: Floats, weight: Floats, goal: float) -> float:
    """The smallest residual (m,) up to which the weights (m,) add up to `goal`; reorders both arrays.

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
    return float(residual[low])


@kernel()
@no_type_check
def propose_motion(rest: Floats, displacement: Floats, is_seen: Flags, search: MotionSearch) -> Floats:
    """The motion (3,) of x, y and angle that fits `share` of the weight best.

    Every pair of markers defines a motion; the median displacement without a rotation is another one.

    Args:
        rest, displacement: (m, 2) places and displacements.
        is_seen: (m,).
        search: hypotheses and parameters.
    """
    pairs, seen = search.pairs, np.flatnonzero(is_seen)
    voter = seen[:: max(1, len(seen) // search.voters)]
    x, y, u, v = rest[voter, 0], rest[voter, 1], displacement[voter, 0], displacement[voter, 1]
    w = search.weight[voter]
    goal = search.share * w.sum()
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
            off_x = displacement[b, 0] - displacement[a, 0]
            off_y = displacement[b, 1] - displacement[a, 1]
            motion[2] = (off_y * span_x - off_x * span_y) / apart
            motion[0] = 0.5 * (
                displacement[a, 0] + displacement[b, 0] + motion[2] * (rest[a, 1] + rest[b, 1])
            )
            motion[1] = 0.5 * (
                displacement[a, 1] + displacement[b, 1] - motion[2] * (rest[a, 0] + rest[b, 0])
            )
        else:
            motion[0], motion[1], motion[2] = np.median(u), np.median(v), 0.0
        _squared_residuals(x, y, u, v, motion, square)
        if _weight_below(square, w, least) >= goal:
            least = weighted_quantile(square, w.copy(), goal)
            best[:] = motion
    return best


@kernel()
@no_type_check
def refine_motion(
    rest: Floats, displacement: Floats, is_seen: Flags, std: float, search: MotionSearch, motion: Floats
) -> Floats:
    """The motion (3,) after rounds of least squares with Tukey's weight, from a proposed one.

    The scale of the residuals is taken from about `voters` of the markers; it is at least `std`.
    """
    seen = np.flatnonzero(is_seen)
    x, y, u, v = rest[seen, 0], rest[seen, 1], displacement[seen, 0], displacement[seen, 1]
    w = search.weight[seen]
    step = max(1, len(seen) // search.voters)
    voter_weight = w[::step].copy()
    goal = search.share * voter_weight.sum()
    square = np.empty(len(seen))
    motion = motion.copy()
    for _ in range(search.rounds):
        _squared_residuals(x, y, u, v, motion, square)
        scale = np.sqrt(weighted_quantile(square[::step].copy(), voter_weight.copy(), goal))
        _fit_motion(x, y, u, v, w, square, 3.0 * max(scale, std), motion)
    return motion


@kernel()
@no_type_check
def median_std(covariance: Floats, is_seen: Flags) -> float:
    """Median standard deviation along an axis of the seen ones of covariances (m, 2, 2), from a sample."""
    step, wait = max(1, is_seen.sum() // STD_SAMPLE), 0
    spread = np.empty(len(covariance))
    number = 0
    for m in range(len(covariance)):
        if is_seen[m]:
            if wait == 0:
                spread[number] = covariance[m, 0, 0] + covariance[m, 1, 1]
                number, wait = number + 1, step
            wait -= 1
    return float(np.sqrt(np.median(spread[:number]) / 2.0))


@kernel()
@no_type_check
def estimate_motion(
    rest: Floats, displacement: Floats, is_seen: Flags, std: float, search: MotionSearch
) -> Floats:
    """The motion (3,) of the view, 0 when no marker is seen; see `RigidMotionEstimator`."""
    search = MotionSearch(*search)
    if not is_seen.any():
        return np.zeros(3)
    motion = propose_motion(rest, displacement, is_seen, search)
    return refine_motion(rest, displacement, is_seen, std, search, motion)
