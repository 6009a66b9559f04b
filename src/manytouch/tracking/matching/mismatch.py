"""Kernels that find and remove connected parts of the lattice that were matched to the wrong dots.

A part that is wrong by one pitch is consistent inside. At its boundary displacements jump by most of a pitch,
and dots without a marker lie near markers without a dot.
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from typing import NamedTuple

import numpy as np

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.tracking.lattice_graph import PRESENT
from manytouch.tracking.matching.records import Assignment, DotGrid, GraphArrays, Workspace
from manytouch.tracking.matching.spatial_hash import nearest_free_dot


class MismatchParameters(NamedTuple):
    """Distances are in local spacings.

    Attributes:
        reach: a free dot is near a marker without a dot within this distance.
        discontinuity: range of displacements around a node, along x or y, that is one.
        motion_tolerance: markers that are not adjacent belong to one set where their motions since the last
            frame differ by less.
    """

    reach: float = 0.9
    discontinuity: float = 0.6
    motion_tolerance: float = 0.15


MISMATCH = MismatchParameters()


@inlined_kernel()
@no_type_check
def _root(parent: np.ndarray, k: int) -> int:
    """Root of a node's tree; shortens the path to it."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@inlined_kernel()
@no_type_check
def _join(
    k: int,
    count: int,
    is_adjacent: bool,
    graph: GraphArrays,
    dot: np.ndarray,
    vector_px: np.ndarray,
    tolerance: float,
    parent: np.ndarray,
) -> None:
    """Joins node k with its adjacent (or other) neighbours whose vectors (N, 2) differ by less."""
    own, most = _root(parent, k), (tolerance * graph.spacing_px[k]) ** 2
    first = graph.start[k] if is_adjacent else graph.adjacent_end[k]
    last = graph.adjacent_end[k] if is_adjacent else graph.start[k + 1]
    for j in range(first, last):
        n = graph.neighbour[j]
        if n < count and dot[n] >= 0 and parent[n] != own:
            dx, dy = vector_px[n, 0] - vector_px[k, 0], vector_px[n, 1] - vector_px[k, 1]
            if dx * dx + dy * dy < most:
                parent[_root(parent, n)] = own


@inlined_kernel()
@no_type_check
def _largest_root(count: int, dot: np.ndarray, parent: np.ndarray, size: np.ndarray) -> int:
    """Root of the largest set; writes the sizes of all sets."""
    size[:count] = 0
    largest = 0
    for k in range(count):
        if dot[k] >= 0:
            root = _root(parent, k)
            size[root] += 1
            if size[root] > size[largest]:
                largest = root
    return largest


@kernel()
@no_type_check
def keep_largest_set(
    count: int,
    graph: GraphArrays,
    assignment: Assignment,
    tolerance: float,
    motion_px: np.ndarray,
    workspace: Workspace,
) -> int:
    """Drops all but the largest connected set of the first `count` nodes; returns its size.

    Args:
        count: number of nodes.
        graph: of the layout.
        assignment: its dots are dropped, its displacements compared.
        tolerance: adjacent nodes are connected where displacements differ by less; in local spacings.
        motion_px: (f, 2) motion of the first f nodes since the last frame: neighbours among them that are not
            adjacent are connected as well where motions differ by less than 0.15 spacings.
        workspace: of the layout.
    """
    dot, displacement, _ = assignment
    parent, size = workspace.parent, workspace.set_size
    for k in range(count):
        parent[k] = k
    for k in range(count):
        if dot[k] >= 0:
            _join(k, count, True, graph, dot, displacement, tolerance, parent)
    largest = _largest_root(count, dot, parent, size)
    moving = len(motion_px)
    for k in range(moving):
        if dot[k] >= 0 and _root(parent, k) != largest:
            _join(k, moving, False, graph, dot, motion_px, MISMATCH.motion_tolerance, parent)
    if moving > 0:
        largest = _largest_root(count, dot, parent, size)
    for k in range(count):
        if dot[k] >= 0 and _root(parent, k) != largest:
            dot[k] = -1
    return int(size[largest])


@inlined_kernel()
@no_type_check
def _is_discontinuous(k: int, graph: GraphArrays, assignment: Assignment) -> bool:
    """Whether the displacements of the neighbours of node k differ by most of a spacing."""
    neighbour, dot, displacement = graph.neighbour, assignment.dot, assignment.displacement_px
    left = top = np.inf
    right = bottom = -np.inf
    for j in range(graph.start[k], graph.start[k + 1]):
        n = neighbour[j]
        if dot[n] >= 0:
            left, right = min(left, displacement[n, 0]), max(right, displacement[n, 0])
            top, bottom = min(top, displacement[n, 1]), max(bottom, displacement[n, 1])
    return bool(max(right - left, bottom - top) > MISMATCH.discontinuity * graph.spacing_px[k])


@kernel()
@no_type_check
def mark_mismatched(
    markers: int,
    grid: DotGrid,
    graph: GraphArrays,
    assignment: Assignment,
    free_dot: np.ndarray,
    is_mismatched: np.ndarray,
) -> int:
    """Marks adjacent markers without a dot that have different free dots near them, at a discontinuity.

    A dot that only vanished leaves no free dot; the boundary of a part that was mismatched has many.

    Args:
        markers: m.
        grid: of the dots.
        graph: of the layout.
        assignment: with displacements of all nodes.
        free_dot: (m,) or longer: workspace.
        is_mismatched: (m,) or longer, written.

    Returns:
        How many were marked.
    """
    rest, bounds, neighbour = graph.rest_px, graph.bounds_px, graph.neighbour
    dot, displacement, is_used = assignment
    any_free = False
    for k in range(markers):
        free_dot[k] = -1
        if dot[k] >= 0 or graph.kind[k] != PRESENT:
            continue
        x, y = rest[k, 0] + displacement[k, 0], rest[k, 1] + displacement[k, 1]
        if bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]:
            free_dot[k] = nearest_free_dot(grid, x, y, MISMATCH.reach * graph.spacing_px[k], is_used)
            any_free = any_free or free_dot[k] >= 0
    marked = 0
    is_mismatched[:markers] = False
    if not any_free:
        return marked
    for k in range(markers):
        if free_dot[k] < 0:
            continue
        with_free = with_another = 0
        for j in range(graph.start[k], graph.adjacent_end[k]):
            n = neighbour[j]
            if n < markers and free_dot[n] >= 0:
                with_free += 1
                with_another += free_dot[n] != free_dot[k]
        # One false dot may lie near several missing ones, but it is one dot.
        if with_free >= 2 and with_another >= 1 and _is_discontinuous(k, graph, assignment):
            is_mismatched[k] = True
            marked += 1
    return marked


@kernel()
@no_type_check
def widen_mismatch(
    markers: int, graph: GraphArrays, dot: np.ndarray, is_mismatched: np.ndarray, marked: np.ndarray
) -> None:
    """Drops the dots (N,) around mismatched markers and marks these markers too; `marked` is workspace."""
    start, neighbour = graph.start, graph.neighbour
    number = 0
    for k in range(markers):
        if is_mismatched[k]:
            marked[number] = k
            number += 1
    for c in range(number):
        k = marked[c]
        for j in range(start[k], start[k + 1]):
            dot[neighbour[j]] = -1
            if neighbour[j] < markers:
                is_mismatched[neighbour[j]] = True
