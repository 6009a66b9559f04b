"""The values that the kernels pass to each other: named tuples, which numba compiles to plain arguments.

n dots of a frame, m markers of the layout, N nodes: the markers, then the exterior nodes of the lattice.
"""

from typing import NamedTuple

import numpy as np

from manytouch.tracking.lattice_graph import GraphArrays

__all__ = ["Assignment", "DotArrays", "DotGrid", "GraphArrays", "MarkerCells", "MatchingState", "Workspace"]


class DotArrays(NamedTuple):
    """Dots of one frame in any order.

    Attributes:
        centre_px: (n, 2).
        covariance_px2: (n, 2, 2) of the centres; NaN or 0 where it is not known.
        area_px2: (n,).
        contrast: (n,) grey levels.
    """

    centre_px: np.ndarray
    covariance_px2: np.ndarray
    area_px2: np.ndarray
    contrast: np.ndarray


class DotGrid(NamedTuple):
    """Dots sorted into square cells.

    Attributes:
        centre_px: (n, 2) the dots' centres.
        cell_px: side of a cell.
        left_px, top_px: corner of the first cell.
        columns, rows: number of cells.
        start: (columns rows + 1,) where the dots of each cell begin in `dot`, row by row.
        dot: (n,) dots in the order of their cells.
    """

    centre_px: np.ndarray
    cell_px: float
    left_px: float
    top_px: float
    columns: int
    rows: int
    start: np.ndarray
    dot: np.ndarray


class MarkerCells(NamedTuple):
    """A rectangle of cells: first and last column, first and last row."""

    left: int
    right: int
    top: int
    bottom: int


class MatchingState(NamedTuple):
    """What is known from the frames before.

    Attributes:
        position_px: (m, 2) where the markers were, or were predicted, in the last frame that was matched.
        frames_unseen: (m,).
        presence: (N,) share of recent frames in which each node had a dot.
        seen_count: number of markers seen in the last frame that was matched; 0 when there was none.
        roughness: median second difference of their displacements then, in spacings.
        is_consecutive: that frame is the one before this one.
        is_ambiguous: identities may have been shifted before, and this has not been resolved.
        appearance: (m, 2) usual relative area and contrast of each marker's dot; NaN: not known.
        appearance_difference: (2,) usual mean difference of a frame's dots from `appearance`.
    """

    position_px: np.ndarray
    frames_unseen: np.ndarray
    presence: np.ndarray
    seen_count: int
    roughness: float
    is_consecutive: bool
    is_ambiguous: bool
    appearance: np.ndarray
    appearance_difference: np.ndarray


class Assignment(NamedTuple):
    """Which dot belongs to which node, while a frame is matched; kernels write to it.

    Attributes:
        dot: (N,) dot of each node, or -1.
        displacement_px: (N, 2) from rest; valid where there is a dot, and after `fill_displacements`
            everywhere.
        is_used: (n,) or longer: dots that belong to a node.
    """

    dot: np.ndarray
    displacement_px: np.ndarray
    is_used: np.ndarray


class Workspace(NamedTuple):
    """Arrays that the kernels write before they read them; allocated once, to be used in every frame.

    Attributes:
        marker_of_dot: (n,) or longer.
        is_used: (n,) or longer, of `Assignment`.
        error_ratio: (N,) error of each node over its tolerance.
        parent, set_size: (N,) a forest of disjoint sets, and the sizes of its trees.
        flag: (N,) booleans.
        queue, delayed: (N,) nodes.
        is_queued: (N,) booleans.
        attempted: (N,) counts.
        position_px: (N, 2) any pairs in pixels: guessed positions and motions while a frame is matched, then
            the displacements of its `Assignment`.
    """

    marker_of_dot: np.ndarray
    is_used: np.ndarray
    error_ratio: np.ndarray
    parent: np.ndarray
    set_size: np.ndarray
    flag: np.ndarray
    queue: np.ndarray
    delayed: np.ndarray
    is_queued: np.ndarray
    attempted: np.ndarray
    position_px: np.ndarray
