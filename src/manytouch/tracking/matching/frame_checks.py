"""Kernels that measure whether a frame follows smoothly from the one before."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from math import sqrt
from typing import NamedTuple

import numpy as np

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.tracking.lattice_graph import PRESENT
from manytouch.tracking.matching.records import Assignment, DotGrid, GraphArrays, MatchingState
from manytouch.tracking.matching.spatial_hash import nearest_two


class CheckParameters(NamedTuple):
    """Distances are in local spacings.

    Attributes:
        agreement: displacements that differ by less agree.
        slow_motion: motion since the last frame that is not fast.
        least_disturbance: sum over a marker and its adjacent ones that makes a frame not calm: 2 for each
            that disagrees or is fast, 1 for each that vanished.
        exterior_gate: a dot within it belongs to an exterior node.
        exterior_presence: exterior nodes that have a dot less often are empty usually.
        bin_width, bins: of the histogram of second differences.
    """

    agreement: float = 0.15
    slow_motion: float = 0.3
    least_disturbance: int = 4
    exterior_gate: float = 0.25
    exterior_presence: float = 0.1
    bin_width: float = 0.0005
    bins: int = 300


CHECKS = CheckParameters()
_FAST_OR_DISAGREEING, _VANISHED = 2, 1


@kernel()
@no_type_check
def mark_disagreeing(
    centre_px: np.ndarray,
    guess_px: np.ndarray,
    graph: GraphArrays,
    dot: np.ndarray,
    difference_px: np.ndarray,
    disagrees: np.ndarray,
) -> tuple[int, int]:
    """Marks matches of which few adjacent ones are off the guess (m, 2) by the same.

    Args:
        centre_px: (n, 2).
        guess_px: (m, 2).
        graph: of the layout.
        dot: (N,) dot of each node.
        difference_px: (N, 2) written: centre minus guess, of the m markers that have a dot.
        disagrees: (N,) written, of the m markers.

    Returns:
        The numbers of the others and of those marked.
    """
    spacing, neighbour = graph.spacing_px, graph.neighbour
    start, adjacent_end = graph.start, graph.adjacent_end
    markers = len(guess_px)
    for k in range(markers):
        if dot[k] >= 0:
            difference_px[k, 0] = centre_px[dot[k], 0] - guess_px[k, 0]
            difference_px[k, 1] = centre_px[dot[k], 1] - guess_px[k, 1]
    good = disagreeing = 0
    for k in range(markers):
        disagrees[k] = False
        if dot[k] < 0:
            continue
        most, worst = (CHECKS.agreement * spacing[k]) ** 2, 0.0
        known = same = 0
        for j in range(start[k], adjacent_end[k]):
            n = neighbour[j]
            if n < markers and dot[n] >= 0:
                known += 1
                x, y = difference_px[n, 0] - difference_px[k, 0], difference_px[n, 1] - difference_px[k, 1]
                worst = max(worst, x * x + y * y)
        # Counting those that agree takes longer, and is seldom needed.
        if worst >= most:
            for j in range(start[k], adjacent_end[k]):
                n = neighbour[j]
                if n < markers and dot[n] >= 0:
                    x = difference_px[n, 0] - difference_px[k, 0]
                    y = difference_px[n, 1] - difference_px[k, 1]
                    same += x**2 + y**2 < most
        disagrees[k] = known == 0 or (worst >= most and 2 * same < known)
        disagreeing += disagrees[k]
        good += not disagrees[k]
    return good, disagreeing


@kernel()
@no_type_check
def is_disturbed(
    centre_px: np.ndarray,
    graph: GraphArrays,
    state: MatchingState,
    dot: np.ndarray,
    disagrees: np.ndarray,
    score: np.ndarray,
) -> bool:
    """Whether neighbouring markers disagree, moved far or vanished together; `score` (N,) is workspace.

    One false or missing dot disturbs nothing; the boundary of a part that moved does.
    """
    last, unseen = state.position_px, state.frames_unseen
    spacing, neighbour = graph.spacing_px, graph.neighbour
    markers = len(last)
    for k in range(markers):
        score[k] = 0
        if dot[k] >= 0:
            x, y = centre_px[dot[k], 0] - last[k, 0], centre_px[dot[k], 1] - last[k, 1]
            is_fast = x * x + y * y > (CHECKS.slow_motion * spacing[k]) ** 2
            score[k] = _FAST_OR_DISAGREEING if disagrees[k] or is_fast else 0
        elif graph.kind[k] == PRESENT and unseen[k] == 0:
            score[k] = _VANISHED
    for k in range(markers):
        if score[k] > 0:
            total = score[k]
            for j in range(graph.start[k], graph.adjacent_end[k]):
                if neighbour[j] < markers:
                    total += score[neighbour[j]]
            if total >= CHECKS.least_disturbance:
                return True
    return False


@inlined_kernel()
@no_type_check
def count_vanished(dot: np.ndarray, frames_unseen: np.ndarray, kind: np.ndarray) -> int:
    """Number of markers that have no dot but were seen in the last frame."""
    number = 0
    for k in range(len(frames_unseen)):
        number += dot[k] < 0 and frames_unseen[k] == 0 and kind[k] == PRESENT
    return number


@kernel()
@no_type_check
def count_exterior_dots(
    grid: DotGrid, graph: GraphArrays, assignment: Assignment, presence: np.ndarray
) -> int:
    """Number of exterior nodes and missing markers, empty usually, that have a dot of no other node."""
    rest, spacing, displacement = graph.rest_px, graph.spacing_px, assignment.displacement_px
    number = 0
    for k in range(len(rest)):
        if graph.kind[k] == PRESENT or presence[k] > CHECKS.exterior_presence:
            continue
        x, y = rest[k, 0] + displacement[k, 0], rest[k, 1] + displacement[k, 1]
        i, _, _ = nearest_two(grid, x, y, CHECKS.exterior_gate * spacing[k])
        number += i >= 0 and not assignment.is_used[i]
    return number


@kernel()
@no_type_check
def measure_roughness(markers: int, graph: GraphArrays, assignment: Assignment) -> float:
    """Median second difference of displacements along the lattice, in spacings; NaN: there is none."""
    dot, moved, opposite = assignment.dot, assignment.displacement_px, graph.opposite
    count = np.zeros(CHECKS.bins + 1, np.int64)
    number = 0
    for k in range(markers):
        if dot[k] < 0:
            continue
        for axis in range(2):
            a, b = opposite[k, 2 * axis], opposite[k, 2 * axis + 1]
            if a < 0 or b < 0 or dot[a] < 0 or dot[b] < 0:
                continue
            x = moved[a, 0] + moved[b, 0] - 2.0 * moved[k, 0]
            y = moved[a, 1] + moved[b, 1] - 2.0 * moved[k, 1]
            bins = np.sqrt(x * x + y * y) / (CHECKS.bin_width * graph.spacing_px[k])
            count[min(CHECKS.bins, int(bins))] += 1
            number += 1
    below = 0
    for b in range(CHECKS.bins + 1):
        below += count[b]
        if number and 2 * below >= number:
            return (b + 0.5) * CHECKS.bin_width
    return np.nan


@kernel()
@no_type_check
def median_motion(
    centre_px: np.ndarray, dot: np.ndarray, base_px: np.ndarray, spacing_px: np.ndarray
) -> float:
    """Median distance of the markers' dots from base positions (m, 2), in spacings; inf: there are none."""
    squared = np.empty(len(base_px))
    number = 0
    for k in range(len(base_px)):
        if dot[k] >= 0:
            x, y = centre_px[dot[k], 0] - base_px[k, 0], centre_px[dot[k], 1] - base_px[k, 1]
            squared[number] = (x * x + y * y) / (spacing_px[k] * spacing_px[k])
            number += 1
    return sqrt(np.median(squared[:number])) if number else np.inf


@kernel()
@no_type_check
def rms_noise_px(covariance_px2: np.ndarray) -> float:
    """Usual standard deviation of a centre along x, from covariances (n, 2, 2), n > 0; 0: not known."""
    total = 0.0
    for i in range(len(covariance_px2)):
        total += covariance_px2[i, 0, 0]
    mean = total / len(covariance_px2)
    return sqrt(mean) if 0.0 < mean < np.inf else 0.0
