"""Kernels that decide whether all identities are shifted by whole pitches along the lattice.

On a regular pattern every shift fits as well, except at the outline, at missing markers, and in the printed
dots' deviations from the lattice and their appearance. The cost of each shift, in nats, is the negative log
likelihood of the positions where dots are present or absent, plus that of the roughness of its displacements.
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from math import sqrt
from typing import NamedTuple

import numpy as np

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.tracking.lattice_graph import EXTERIOR_HIDDEN, PRESENT
from manytouch.tracking.matching.records import DotArrays, GraphArrays, MatchingState
from manytouch.tracking.matching.relative_appearance import (
    APPEARANCE,
    add_appearance_cost,
    measure_appearance,
    sample_step,
)


class ShiftParameters(NamedTuple):
    """What a shift costs, in nats. Distances are in local spacings.

    Attributes:
        clutter: probability of a dot at a position beyond the exterior nodes.
        hidden_cost: cost of a node that the image did not show at rest, with and without a dot.
        least_visible: at least this share of the present markers in view is assumed to show a dot.
        dependence: this number of second differences counts as one independent measurement, since
            neighbouring ones share dots.
        least_second_differences: with fewer of them, roughness costs nothing.
        least_roughness: added to the roughness before its logarithm is taken, unless the noise is larger.
        motion_cost: cost per spacing of the median motion since the last frame that was matched.
        slow_motion, slow_motion_cost: the same cost if that was the previous frame and the motion without a
            shift is below `slow_motion`.
        largest_motion: larger motions cost as much as this one.
        samples: about the number of nodes on which roughness and motion are measured.
        rigid_samples, least_rigid_samples: about the number of nodes that `is_rigid_jump` uses, and the
            number that it requires.
        rigid_variance: a shifted motion is rigid if its variance over that of the unshifted motion is less.
        rigid_noises: an unshifted motion that varies by less than this number of standard deviations of a
            centre is no jump.
    """

    clutter: float = 0.003
    hidden_cost: float = float(np.log(2.0))
    least_visible: float = 0.05
    dependence: float = 8.0
    least_second_differences: int = 12
    least_roughness: float = 0.003
    motion_cost: float = 10.0
    slow_motion: float = 0.35
    slow_motion_cost: float = 25.0
    largest_motion: float = 1.5
    samples: int = 300
    rigid_samples: int = 80
    least_rigid_samples: int = 16
    rigid_variance: float = 0.1
    rigid_noises: float = 4.0


class ShiftChoice(NamedTuple):
    """The most likely shift.

    Attributes:
        shift: its row in `GraphArrays.shifted`; 0: identities are right.
        margin: nats by which the image prefers it to all others.
        measured_margin: part of the margin from roughness and appearance.
        motion: median motion that it implies, in spacings.
    """

    shift: int
    margin: float
    measured_margin: float
    motion: float


SHIFT = ShiftParameters()
_SMALLEST_RATIO, _BISECTIONS = 1e-12, 16


@kernel()
@no_type_check
def _add_occupancy_cost(
    dot: np.ndarray, position_px: np.ndarray, graph: GraphArrays, presence: np.ndarray, cost: np.ndarray
) -> None:
    """Adds to `cost` (s,) the cost of dots at unlikely positions, and of likely positions without a dot."""
    kind, bounds, shifted = graph.kind, graph.bounds_px, graph.shifted
    found = expected = 0.0
    nodes = len(kind)
    is_shown = np.zeros(nodes, np.bool_)
    for k in range(nodes):
        x, y = position_px[k, 0], position_px[k, 1]
        is_shown[k] = bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]
        if kind[k] == PRESENT and is_shown[k]:
            expected += presence[k]
            found += dot[k] >= 0
    visible = min(1.0, max(SHIFT.least_visible, found / max(expected, 1.0)))
    full, empty = np.empty(nodes), np.empty(nodes)
    before, log_full, log_empty = -1.0, 0.0, 0.0
    for k in range(nodes):
        # Most are as likely as the one before, and logarithms are slow.
        if presence[k] != before:
            before = presence[k]
            log_full, log_empty = -np.log(before), -np.log(1.0 - before * visible)
        full[k] = SHIFT.hidden_cost if kind[k] == EXTERIOR_HIDDEN else log_full
        empty[k] = SHIFT.hidden_cost if kind[k] == EXTERIOR_HIDDEN else log_empty
    for s in range(len(shifted)):
        for k in range(nodes):
            t = shifted[s, k]
            if dot[k] >= 0:
                beyond = SHIFT.hidden_cost if kind[k] == EXTERIOR_HIDDEN else -np.log(SHIFT.clutter)
                cost[s] += full[t] if t >= 0 else beyond
            elif t >= 0 and is_shown[k]:
                cost[s] += empty[t]


@kernel(fastmath=REORDER)
@no_type_check
def _count_below(value: np.ndarray, limit: np.float32) -> float:
    number = np.float32(0.0)
    for i in range(np.uint64(len(value))):
        number += np.float32(1.0) if value[i] < limit else np.float32(0.0)
    return float(number)


@kernel()
@no_type_check
def approximate_median(value: np.ndarray) -> float:
    """Median of float32 values (n,), n > 0, that are not negative, to a few parts in ten thousand.

    By bisection of its logarithm: counting is vectorised and has no unpredictable branches, as sorting has.
    """
    high, half = np.float64(value.max()), 0.5 * len(value)
    low = high * _SMALLEST_RATIO
    if high <= 0.0 or _count_below(value, np.float32(low)) > half:
        return 0.0
    for _ in range(_BISECTIONS):
        between = np.sqrt(low * high)
        if _count_below(value, np.float32(between)) <= half:
            low = between
        else:
            high = between
    return sqrt(low * high)


@kernel()
@no_type_check
def _sampled_roughness(
    position_px: np.ndarray, dot: np.ndarray, graph: GraphArrays, shifted: np.ndarray, squared: np.ndarray
) -> tuple[float, int]:
    """Median second difference of displacements along the lattice after a shift, in spacings, and how many.

    Args:
        position_px: (N, 2) of the nodes in the image.
        dot: (N,).
        graph: of the layout.
        shifted: (N,) the node that each becomes.
        squared: (2 N,) workspace.
    """
    rest, spacing, opposite = graph.rest_px, graph.spacing_px, graph.opposite
    at = position_px
    number = 0
    for k in range(0, len(dot), sample_step(len(dot), SHIFT.samples)):
        t = shifted[k]
        if dot[k] < 0 or t < 0:
            continue
        for axis in range(2):
            a, b = opposite[k, 2 * axis], opposite[k, 2 * axis + 1]
            if a < 0 or b < 0 or dot[a] < 0 or dot[b] < 0:
                continue
            ta, tb = opposite[t, 2 * axis], opposite[t, 2 * axis + 1]
            if ta < 0 or tb < 0:
                continue
            x = at[a, 0] + at[b, 0] - 2.0 * at[k, 0] - rest[ta, 0] - rest[tb, 0] + 2.0 * rest[t, 0]
            y = at[a, 1] + at[b, 1] - 2.0 * at[k, 1] - rest[ta, 1] - rest[tb, 1] + 2.0 * rest[t, 1]
            squared[number] = (x * x + y * y) / (spacing[k] * spacing[k])
            number += 1
    return (sqrt(approximate_median(squared[:number])) if number else np.nan), number


@kernel()
@no_type_check
def _sampled_motion(
    position_px: np.ndarray,
    dot: np.ndarray,
    last_px: np.ndarray,
    spacing_px: np.ndarray,
    shifted: np.ndarray,
    squared: np.ndarray,
) -> float:
    """Median distance of the dots from where their markers were, after a shift; in spacings."""
    number = 0
    for k in range(0, len(dot), sample_step(len(dot), SHIFT.samples)):
        t = shifted[k]
        if dot[k] >= 0 and 0 <= t < len(last_px):
            x, y = position_px[k, 0] - last_px[t, 0], position_px[k, 1] - last_px[t, 1]
            squared[number] = (x * x + y * y) / (spacing_px[k] * spacing_px[k])
            number += 1
    return sqrt(approximate_median(squared[:number])) if number else np.inf


@kernel()
@no_type_check
def is_rigid_jump(
    centre_px: np.ndarray,
    dot: np.ndarray,
    shifted: np.ndarray,
    last_px: np.ndarray,
    frames_unseen: np.ndarray,
    noise_px: float,
) -> bool:
    """Whether some shift of identities makes the motion since the last frame rigid, which it is not without.

    A sheet that jumps by a pitch in front of the camera keeps its shape; with the identities of the last
    frame, unevenness of the lattice in the image and dents appear as motion.
    """
    markers = len(last_px)
    step = markers // SHIFT.rigid_samples | 1
    unshifted = 0.0
    for s in range(len(shifted)):
        x = y = square = 0.0
        number = 0
        for k in range(0, markers, step):
            t = shifted[s, k]
            if dot[k] < 0 or t < 0 or t >= markers or frames_unseen[t] > 0:
                continue
            dx, dy = centre_px[dot[k], 0] - last_px[t, 0], centre_px[dot[k], 1] - last_px[t, 1]
            x += dx
            y += dy
            square += dx * dx + dy * dy
            number += 1
        if number < SHIFT.least_rigid_samples:
            continue
        variance = (square - (x * x + y * y) / number) / number
        if s == 0:
            unshifted = variance
            if unshifted < (SHIFT.rigid_noises * noise_px) ** 2:
                return False
        elif variance < SHIFT.rigid_variance * unshifted:
            return True
    return False


@kernel()
@no_type_check
def _choose(
    occupancy: np.ndarray, measured: np.ndarray, motion: np.ndarray, motion_cost: float
) -> ShiftChoice:
    """The shift of least cost, from the costs (s,) of occupancy, of what was measured, and motions (s,)."""
    best = 0
    for s in range(len(occupancy)):
        cost = occupancy[s] + measured[s] + motion_cost * min(motion[s], SHIFT.largest_motion)
        least = occupancy[best] + measured[best] + motion_cost * min(motion[best], SHIFT.largest_motion)
        if cost < least:
            best = s
    margin = measured_margin = np.inf
    for s in range(len(occupancy)):
        if s != best:
            margin = min(margin, occupancy[s] + measured[s] - occupancy[best] - measured[best])
            measured_margin = min(measured_margin, measured[s] - measured[best])
    return ShiftChoice(best, margin, measured_margin, motion[best])


@kernel()
@no_type_check
def choose_shift(
    dots: DotArrays,
    dot: np.ndarray,
    position_px: np.ndarray,
    graph: GraphArrays,
    state: MatchingState,
    noise_px: float,
) -> ShiftChoice:
    """The shift that makes a frame most likely.

    Args:
        dots: of the frame.
        dot: (N,) dot of each node.
        position_px: (N, 2) of all nodes in the image, also of those without a dot.
        graph: of the layout.
        state: from the frames before.
        noise_px: standard deviation of a centre.
    """
    shifted = graph.shifted
    shifts, nodes = len(shifted), len(dot)
    occupancy, measured, motion = np.zeros(shifts), np.zeros(shifts), np.empty(shifts)
    _add_occupancy_cost(dot, position_px, graph, state.presence, occupancy)
    squared = np.empty(2 * nodes, np.float32)
    least = max(SHIFT.least_roughness, noise_px / graph.spacing_px[0])
    usual, usual_number = 0.0, 0
    for s in range(shifts):
        motion[s] = _sampled_motion(
            position_px, dot, state.position_px, graph.spacing_px, shifted[s], squared
        )
        roughness, number = _sampled_roughness(position_px, dot, graph, shifted[s], squared)
        if s == 0:
            usual, usual_number = roughness, number
        if usual_number >= SHIFT.least_second_differences:
            if number < usual_number // 2:
                roughness = usual
            measured[s] = usual_number / SHIFT.dependence * np.log(least + roughness)
    appearance = np.empty((nodes, 2))
    measure_appearance(nodes, sample_step(nodes, APPEARANCE.shift_samples), dot, dots, graph, appearance)
    add_appearance_cost(appearance, shifted, state.appearance, state.appearance_difference, measured)
    is_slow = state.is_consecutive and motion[0] < SHIFT.slow_motion
    motion_cost = SHIFT.slow_motion_cost if is_slow else SHIFT.motion_cost
    return _choose(occupancy, measured, motion, motion_cost)
