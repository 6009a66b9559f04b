"""Kernels that extend an assignment from node to node of the lattice.

The position of each next node is predicted from the displacements of its neighbours: by quadratic
extrapolation along lines of the lattice where three nodes in a row are known, else by a local affine fit.
Nodes with many known neighbours come first.
"""

# ruff: noqa: PLR0912 - the loop over the queue is one function

from math import sqrt
from typing import NamedTuple

import numpy as np

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.tracking.matching.affine_fit import (
    NO_FIT,
    RIDGE,
    NeighbourSums,
    least_stretch,
    solve_affine,
    sum_neighbours,
)
from manytouch.tracking.matching.records import Assignment, DotGrid, GraphArrays, Workspace
from manytouch.tracking.matching.spatial_hash import nearest_two


class GrowthParameters(NamedTuple):
    """When a dot is accepted at a predicted position. Distances are in local spacings.

    Attributes:
        gate: largest distance from the prediction, times the least stretch of the lattice there.
        narrow_gate, residual_factor: where most adjacent nodes are known: this much plus this many rms
            residuals of the fit.
        sparse_count, sparse_gate: with no more known neighbours than this, the gate is at most so large.
        ratio: squared distance of the dot over that of the second nearest, at most.
        least_adjacent, most_adjacent: adjacent nodes that must be known: the most are required first.
        least_neighbours: known neighbours required of a node without any adjacent ones.
        added_neighbours: a node is tried again after this many more of its neighbours are known.
    """

    gate: float = 0.4
    narrow_gate: float = 0.08
    residual_factor: float = 2.5
    sparse_count: int = 6
    sparse_gate: float = 0.2
    ratio: float = 0.36
    least_adjacent: int = 1
    most_adjacent: int = 4
    least_neighbours: int = 5
    added_neighbours: int = 2


GROWTH = GrowthParameters()


@inlined_kernel()
@no_type_check
def _queue_boundary(
    count: int, graph: GraphArrays, dot: np.ndarray, queue: np.ndarray, is_queued: np.ndarray
) -> int:
    """Queues those of the first nodes that have no dot, but an adjacent node with one; returns how many."""
    start, adjacent_end, neighbour = graph.start, graph.adjacent_end, graph.neighbour
    waiting = 0
    for k in range(count):
        is_queued[k] = False
        if dot[k] >= 0:
            continue
        for j in range(start[k], adjacent_end[k]):
            if dot[neighbour[j]] >= 0:
                queue[waiting] = k
                waiting += 1
                is_queued[k] = True
                break
    return waiting


@inlined_kernel()
@no_type_check
def extrapolate_lines(k: int, graph: GraphArrays, assignment: Assignment) -> tuple[float, float, int]:
    """Sum of quadratic extrapolations of the displacement to node k along its lines, px, and their number."""
    opposite, dot, displacement = graph.opposite, assignment.dot, assignment.displacement_px
    lines = 0
    x = y = 0.0
    for direction in range(4):
        a = opposite[k, direction]
        if a < 0 or dot[a] < 0:
            continue
        b = opposite[a, direction]
        if b < 0 or dot[b] < 0:
            continue
        c = opposite[b, direction]
        if c < 0 or dot[c] < 0:
            continue
        x += 3.0 * (displacement[a, 0] - displacement[b, 0]) + displacement[c, 0]
        y += 3.0 * (displacement[a, 1] - displacement[b, 1]) + displacement[c, 1]
        lines += 1
    return x, y, lines


@inlined_kernel()
@no_type_check
def find_predicted_dot(
    k: int, grid: DotGrid, graph: GraphArrays, assignment: Assignment, sums: NeighbourSums
) -> int:
    """The only dot near the predicted position of node k, or -1; `sums` are those of its neighbours."""
    spacing = graph.spacing_px[k]
    fit, residual = solve_affine(sums, RIDGE * spacing * spacing)
    gate = GROWTH.gate * spacing * least_stretch(fit)
    if 2 * sums.adjacent > graph.adjacent_end[k] - graph.start[k] and sums.used > GROWTH.sparse_count:
        rms = sqrt(max(0.0, residual / sums.w))
        gate = min(gate, GROWTH.narrow_gate * spacing + GROWTH.residual_factor * rms)
    elif sums.used <= GROWTH.sparse_count:
        gate = min(gate, GROWTH.sparse_gate * spacing)
    line_x, line_y, lines = extrapolate_lines(k, graph, assignment)
    for attempt in range(2):
        if attempt == 0 and lines == 0:
            continue
        x = graph.rest_px[k, 0] + (line_x / lines if attempt == 0 else fit.shift_x)
        y = graph.rest_px[k, 1] + (line_y / lines if attempt == 0 else fit.shift_y)
        best, first, second = nearest_two(grid, x, y, gate)
        if best >= 0 and first <= GROWTH.ratio * second:
            return best
    return -1


@kernel()
@no_type_check
def grow(grid: DotGrid, count: int, graph: GraphArrays, assignment: Assignment, workspace: Workspace) -> None:
    """Gives those of the first `count` nodes that have no dot the one at their predicted position."""
    start, adjacent_end, neighbour = graph.start, graph.adjacent_end, graph.neighbour
    dot, displacement, is_used = assignment
    queue, delayed, attempted = workspace.queue, workspace.delayed, workspace.attempted
    is_queued = workspace.is_queued
    waiting = _queue_boundary(count, graph, dot, queue, is_queued)
    attempted[:count] = -GROWTH.added_neighbours
    head = delayed_count = 0
    required = GROWTH.most_adjacent
    while True:
        if waiting == 0:
            if required == GROWTH.least_adjacent or delayed_count == 0:
                break
            required -= 1
            for j in range(delayed_count):
                queue[(head + j) % count] = delayed[j]
            waiting, delayed_count = delayed_count, 0
            continue
        k = queue[head]
        head = (head + 1) % count
        waiting -= 1
        sums = sum_neighbours(k, graph, assignment, NO_FIT, False)
        is_isolated = sums.adjacent == 0
        is_early = sums.adjacent < required and not (required == GROWTH.least_adjacent and is_isolated)
        if is_early or sums.used < required + 1 or (is_isolated and sums.used < GROWTH.least_neighbours):
            delayed[delayed_count] = k
            delayed_count += 1
            continue
        is_queued[k] = False
        if sums.used < attempted[k] + GROWTH.added_neighbours:
            continue
        attempted[k] = sums.used
        found = find_predicted_dot(k, grid, graph, assignment, sums)
        if found < 0 or is_used[found]:
            continue
        dot[k] = found
        is_used[found] = True
        displacement[k, 0] = grid.centre_px[found, 0] - graph.rest_px[k, 0]
        displacement[k, 1] = grid.centre_px[found, 1] - graph.rest_px[k, 1]
        required = GROWTH.most_adjacent
        for j in range(start[k], adjacent_end[k]):
            n = neighbour[j]
            if n < count and dot[n] < 0 and not is_queued[n]:
                queue[(head + waiting) % count] = n
                waiting += 1
                is_queued[n] = True


@kernel()
@no_type_check
def fill_displacements(count: int, graph: GraphArrays, assignment: Assignment, workspace: Workspace) -> None:
    """Gives nodes without a dot the weighted mean displacement of known neighbours, going outward from dots.

    Nodes that no dot can be reached from get the mean of all; without any dot nothing changes.
    """
    start, neighbour, weight = graph.start, graph.neighbour, graph.weight
    dot, displacement = assignment.dot, assignment.displacement_px
    queue, is_known = workspace.queue, workspace.is_queued
    waiting = owned = 0
    total_x = total_y = 0.0
    for k in range(count):
        is_known[k] = dot[k] >= 0
        if dot[k] >= 0:
            total_x += displacement[k, 0]
            total_y += displacement[k, 1]
            owned += 1
        else:
            displacement[k, 0] = displacement[k, 1] = np.nan
    if owned == 0:
        return
    for k in range(count):
        if dot[k] >= 0:
            continue
        for j in range(start[k], start[k + 1]):
            if neighbour[j] < count and dot[neighbour[j]] >= 0:
                queue[waiting] = k
                waiting += 1
                is_known[k] = True
                break
    head = 0
    while head < waiting:
        k = queue[head]
        head += 1
        total = x = y = 0.0
        for j in range(start[k], start[k + 1]):
            n = neighbour[j]
            if n >= count:
                continue
            if not np.isnan(displacement[n, 0]):
                total += weight[j]
                x += weight[j] * displacement[n, 0]
                y += weight[j] * displacement[n, 1]
            elif not is_known[n]:
                is_known[n] = True
                queue[waiting] = n
                waiting += 1
        displacement[k, 0], displacement[k, 1] = x / total, y / total
    for k in range(count):
        if np.isnan(displacement[k, 0]):
            displacement[k, 0], displacement[k, 1] = total_x / owned, total_y / owned
