"""Kernels that write the tracker's next state and the measured markers after a frame was matched."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from math import sqrt
from typing import NamedTuple

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.tracking.lattice_graph import PRESENT
from manytouch.tracking.matching.growth import fill_displacements
from manytouch.tracking.matching.records import (
    Assignment,
    DotArrays,
    GraphArrays,
    MatchingState,
    Workspace,
)


class UpdateConstants(NamedTuple):
    """Constants, compiled into the kernels.

    Attributes:
        presence_rate: weight of a new frame in the running mean of presence.
        least_presence, most_presence: bounds of the presence of markers that the layout has.
        least_exterior_presence, most_exterior_presence: bounds of that of missing and exterior nodes.
        bins_per_spacing, bins: of the histogram of motions from frame to frame, which ends at
            `bins / bins_per_spacing` spacings.
        motion_share: share of the seen markers that moved by at most the motion that is returned.
    """

    presence_rate: float = 0.05
    least_presence: float = 0.05
    most_presence: float = 0.97
    least_exterior_presence: float = 0.003
    most_exterior_presence: float = 0.9
    bins_per_spacing: float = 100.0
    bins: int = 400
    motion_share: float = 0.95


class NextState(NamedTuple):
    """Arrays of the state after a frame.

    Attributes:
        position_px: (m, 2) where the markers are, or are predicted from their neighbours.
        expected_px: (m, 2) where they are expected in the next frame; NaN: known to be missing.
        frames_unseen: (m,) number of successive frames in which each marker was not seen; 0: seen now.
        presence: (N,) running mean of whether each node has a dot, from 0 to 1.
    """

    position_px: np.ndarray
    expected_px: np.ndarray
    frames_unseen: np.ndarray
    presence: np.ndarray


class Measurements(NamedTuple):
    """What was measured of the markers; NaN, or False, where they are not seen.

    Attributes:
        position_px: (m, 2) centres of their dots.
        covariance_px2: (m, 2, 2) of the centres.
        area_px2: (m,) of their dots.
        is_seen: (m,) whether the layout has the marker and it has a dot.
    """

    position_px: np.ndarray
    covariance_px2: np.ndarray
    area_px2: np.ndarray
    is_seen: np.ndarray


UPDATE = UpdateConstants()


@kernel()
@no_type_check
def _update_presence(
    graph: GraphArrays, state: MatchingState, assignment: Assignment, presence: np.ndarray
) -> None:
    """Writes the running mean of presence (N,) of the nodes that are in view."""
    rest, bounds, kind = graph.rest_px, graph.bounds_px, graph.kind
    dot, displacement, _ = assignment
    for k in range(len(rest)):
        x, y = rest[k, 0] + displacement[k, 0], rest[k, 1] + displacement[k, 1]
        presence[k] = state.presence[k]
        if dot[k] >= 0 or (bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]):
            most, least = UPDATE.most_exterior_presence, UPDATE.least_exterior_presence
            if kind[k] == PRESENT:
                most, least = UPDATE.most_presence, UPDATE.least_presence
            presence[k] += UPDATE.presence_rate * ((dot[k] >= 0) - state.presence[k])
            presence[k] = min(most, max(least, presence[k]))


@kernel()
@no_type_check
def _update_markers(
    graph: GraphArrays,
    state: MatchingState,
    damping: float,
    assignment: Assignment,
    after: NextState,
    is_seen: np.ndarray,
) -> tuple[float, int]:
    """Writes positions, expectations and what is seen; returns what `update_state` does."""
    rest, kind, spacing = graph.rest_px, graph.kind, graph.spacing_px
    dot, displacement, _ = assignment
    place, expected, frames, _ = after
    last, unseen = state.position_px, state.frames_unseen
    count = np.zeros(UPDATE.bins + 1, np.int64)
    seen = 0
    for k in range(len(place)):
        x, y = rest[k, 0] + displacement[k, 0], rest[k, 1] + displacement[k, 1]
        place[k, 0], place[k, 1] = x, y
        expected[k, 0], expected[k, 1] = (x, y) if kind[k] == PRESENT else (np.nan, np.nan)
        is_seen[k] = dot[k] >= 0 and kind[k] == PRESENT
        frames[k] = 0 if is_seen[k] else unseen[k] + 1
        if is_seen[k]:
            dx, dy = x - last[k, 0], y - last[k, 1]
            speed = sqrt(dx * dx + dy * dy) / spacing[k]
            count[min(UPDATE.bins, int(speed * UPDATE.bins_per_spacing))] += 1
            seen += 1
            if unseen[k] == 0:
                expected[k, 0] += damping * dx
                expected[k, 1] += damping * dy
    below, b = count[0], 0
    while below < UPDATE.motion_share * seen:
        b += 1
        below += count[b]
    return (b + 1) / UPDATE.bins_per_spacing, seen


@kernel()
@no_type_check
def _write_measurements(dots: DotArrays, dot: np.ndarray, out: Measurements) -> None:
    """Writes centres, covariances and areas of the seen markers' dots, else NaN."""
    position, covariance, area, is_seen = out
    for k in range(len(is_seen)):
        i = dot[k] if is_seen[k] else -1
        area[k] = dots.area_px2[i] if i >= 0 else np.nan
        for a in range(2):
            position[k, a] = dots.centre_px[i, a] if i >= 0 else np.nan
            for b in range(2):
                covariance[k, a, b] = dots.covariance_px2[i, a, b] if i >= 0 else np.nan


@kernel()
@no_type_check
def update_state(
    dots: DotArrays,
    assignment: Assignment,
    state: MatchingState,
    graph: GraphArrays,
    damping: float,
    workspace: Workspace,
    after: NextState,
    out: Measurements,
) -> tuple[float, int]:
    """Writes the state after a frame that showed markers, and what was measured of them.

    Args:
        dots: of the frame.
        assignment: of the frame; its displacements (N, 2) from rest are written.
        state: before the frame.
        graph: of the layout.
        damping: share of a marker's motion that is expected again in the next frame.
        workspace: of the layout; its `position_px` may be that of the assignment's displacements.
        after: written.
        out: written.

    Returns:
        The motion since the frame before that `motion_share` of the seen markers stayed below, in spacings:
        the upper end of its bin, and that of the first bin if no marker is seen; and how many are seen.
    """
    dots, graph, state = DotArrays(*dots), GraphArrays(*graph), MatchingState(*state)
    assignment, workspace = Assignment(*assignment), Workspace(*workspace)
    after, out = NextState(*after), Measurements(*out)
    rest = graph.rest_px
    dot, displacement, _ = assignment
    for k in range(len(rest)):
        i = dot[k]
        if i >= 0:
            displacement[k, 0] = dots.centre_px[i, 0] - rest[k, 0]
            displacement[k, 1] = dots.centre_px[i, 1] - rest[k, 1]
    fill_displacements(len(rest), graph, assignment, workspace)
    _update_presence(graph, state, assignment, after.presence)
    motion, seen = _update_markers(graph, state, damping, assignment, after, out.is_seen)
    _write_measurements(dots, dot, out)
    return motion, seen
