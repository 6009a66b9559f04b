"""Kernels that find the dot nearest to a position: a hash grid (cell list), built once per frame."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import numpy as np

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.tracking.lattice_graph import PRESENT
from manytouch.tracking.matching.records import DotGrid, GraphArrays, MarkerCells

SECOND_REACH = 1.7
"""The second nearest dot is searched within this many gates."""


@kernel()
@no_type_check
def build_grid(centre_px: np.ndarray, cell_px: float) -> DotGrid:
    """Sorts dots (n, 2), n > 0, into square cells by counting."""
    left = top = np.inf
    right = bottom = -np.inf
    for i in range(len(centre_px)):
        left, right = min(left, centre_px[i, 0]), max(right, centre_px[i, 0])
        top, bottom = min(top, centre_px[i, 1]), max(bottom, centre_px[i, 1])
    columns = int((right - left) / cell_px) + 1
    rows = int((bottom - top) / cell_px) + 1
    cell = np.empty(len(centre_px), np.int64)
    start = np.zeros(rows * columns + 1, np.int64)
    for i in range(len(centre_px)):
        row, column = int((centre_px[i, 1] - top) / cell_px), int((centre_px[i, 0] - left) / cell_px)
        cell[i] = row * columns + column
        start[cell[i] + 1] += 1
    for c in range(rows * columns):
        start[c + 1] += start[c]
    dot = np.empty(len(centre_px), np.int64)
    for i in range(len(centre_px) - 1, -1, -1):
        start[cell[i] + 1] -= 1
        dot[start[cell[i] + 1]] = i
    for c in range(rows * columns):
        start[c] = start[c + 1]
    start[rows * columns] = len(centre_px)
    return DotGrid(centre_px, cell_px, left, top, columns, rows, start, dot)


@inlined_kernel()
@no_type_check
def cells_within(grid: DotGrid, x: float, y: float, reach_px: float) -> MarkerCells:
    """Cells within reach of a position; where the last column is before the first, there are none."""
    per_px = 1.0 / grid.cell_px
    x -= grid.left_px
    y -= grid.top_px
    left, right = int(np.floor((x - reach_px) * per_px)), int(np.floor((x + reach_px) * per_px))
    top, bottom = int(np.floor((y - reach_px) * per_px)), int(np.floor((y + reach_px) * per_px))
    return MarkerCells(max(0, left), min(grid.columns - 1, right), max(0, top), min(grid.rows - 1, bottom))


@inlined_kernel()
@no_type_check
def nearest_two(grid: DotGrid, x: float, y: float, gate_px: float) -> tuple[int, float, float]:
    """The dot nearest to a position within a gate, and how unambiguous it is.

    Returns:
        The dot or -1, its squared distance, and that of the second nearest dot within 1.7 gates; px^2. Where
        there is no such dot, the squared gate and the squared 1.7 gates.
    """
    centre, start, dot, columns = grid.centre_px, grid.start, grid.dot, grid.columns
    reach = SECOND_REACH * gate_px
    best, first, second = -1, gate_px * gate_px, reach * reach
    cells = cells_within(grid, x, y, reach)
    if cells.right < cells.left:
        return best, first, second
    for row in range(cells.top, cells.bottom + 1):
        for j in range(start[row * columns + cells.left], start[row * columns + cells.right + 1]):
            i = dot[j]
            squared = (centre[i, 0] - x) ** 2 + (centre[i, 1] - y) ** 2
            if squared < first:
                second = first if best >= 0 else second
                first, best = squared, i
            elif squared < second:
                second = squared
    return best, first, second


@inlined_kernel()
@no_type_check
def nearest_dot(grid: DotGrid, x: float, y: float, gate_px: float) -> tuple[int, float]:
    """The dot nearest to a position within a gate or -1, and its squared distance or the squared gate."""
    centre, start, dot, columns = grid.centre_px, grid.start, grid.dot, grid.columns
    best, first = -1, gate_px * gate_px
    cells = cells_within(grid, x, y, gate_px)
    if cells.right < cells.left:
        return best, first
    for row in range(cells.top, cells.bottom + 1):
        for j in range(start[row * columns + cells.left], start[row * columns + cells.right + 1]):
            i = dot[j]
            squared = (centre[i, 0] - x) ** 2 + (centre[i, 1] - y) ** 2
            if squared < first:
                first, best = squared, i
    return best, first


@inlined_kernel()
@no_type_check
def nearest_free_dot(grid: DotGrid, x: float, y: float, gate_px: float, is_used: np.ndarray) -> int:
    """The nearest dot within a gate that is not used (n,), or -1."""
    centre, start, dot, columns = grid.centre_px, grid.start, grid.dot, grid.columns
    best, first = -1, gate_px * gate_px
    cells = cells_within(grid, x, y, gate_px)
    if cells.right < cells.left:
        return best
    for row in range(cells.top, cells.bottom + 1):
        for j in range(start[row * columns + cells.left], start[row * columns + cells.right + 1]):
            i = dot[j]
            if not is_used[i]:
                squared = (centre[i, 0] - x) ** 2 + (centre[i, 1] - y) ** 2
                if squared < first:
                    best, first = i, squared
    return best


@kernel()
@no_type_check
def match_nearest(
    grid: DotGrid,
    guess_px: np.ndarray,
    graph: GraphArrays,
    gate: float,
    dot_of_node: np.ndarray,
    marker_of_dot: np.ndarray,
) -> None:
    """Matches markers and dots that are each other's nearest.

    Args:
        grid: of the n dots.
        guess_px: (m, 2) guessed positions of the markers.
        graph: of the layout; markers that are known to be missing get no dot.
        gate: largest distance of a match, in local spacings.
        dot_of_node: (N,) written for the m markers: the dot or -1.
        marker_of_dot: (n,) or longer: workspace.
    """
    kind, spacing = graph.kind, graph.spacing_px
    marker_of_dot[: len(grid.centre_px)] = -1
    distance = np.empty(len(grid.centre_px))
    for k in range(len(guess_px)):
        dot_of_node[k] = -1
        if kind[k] != PRESENT:
            continue
        best, first = nearest_dot(grid, guess_px[k, 0], guess_px[k, 1], gate * spacing[k])
        dot_of_node[k] = best
        if best >= 0 and (marker_of_dot[best] < 0 or first < distance[best]):
            distance[best], marker_of_dot[best] = first, k
    for k in range(len(guess_px)):
        if dot_of_node[k] >= 0 and marker_of_dot[dot_of_node[k]] != k:
            dot_of_node[k] = -1
