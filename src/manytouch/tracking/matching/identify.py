"""The kernel that assigns the dots of one frame to the nodes of the lattice graph, in four steps.

Dots are matched to guessed positions; the matched part grows from node to node; assignments that their
neighbours contradict are dropped; and a shift of all identities by whole pitches is corrected, if the image
shows one. A frame is *calm* if nearly all markers are where they are expected. In a calm frame only the
markers, and no other nodes, are examined, unless something raises doubt.
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from typing import NamedTuple

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.tracking.lattice_graph import PRESENT
from manytouch.tracking.matching.frame_checks import (
    CHECKS,
    count_exterior_dots,
    count_vanished,
    is_disturbed,
    mark_disagreeing,
    measure_roughness,
    median_motion,
    rms_noise_px,
)
from manytouch.tracking.matching.growth import fill_displacements, grow
from manytouch.tracking.matching.mismatch import keep_largest_set, mark_mismatched, widen_mismatch
from manytouch.tracking.matching.records import (
    Assignment,
    DotArrays,
    DotGrid,
    GraphArrays,
    MatchingState,
    Workspace,
)
from manytouch.tracking.matching.relative_appearance import QUANTITIES, measure_difference
from manytouch.tracking.matching.shift_ambiguity import choose_shift, is_rigid_jump
from manytouch.tracking.matching.spatial_hash import build_grid, match_nearest
from manytouch.tracking.matching.verification import drop_folded, drop_replaceable, verify


class IdentificationParameters(NamedTuple):
    """How identities are found and checked in a frame. Distances are in local spacings.

    Attributes:
        gate: largest distance of a dot from the guessed position of its marker.
        calm_share: a calm frame shows at least this share of the markers seen before where they are expected.
        calm_disagreeing: in a calm frame, at most this share of them, plus 2, disagree with adjacent ones.
        discontinuity: adjacent nodes whose displacements differ by more than this are not connected.
        noise_factor: tolerances are larger by this many standard deviations of a centre.
        repairs: how often mismatched parts are removed and grown again, at most.
        reconsiderations: how often a shift is corrected, at most.
        rougher, roughness_margin: in a calm frame, a roughness above `rougher` times the usual one plus
            `roughness_margin` raises doubt about the shift.
        more_different, difference_margin: the same limits for the difference of the dots from their usual
            appearance.
        by_chance: up to this number of vanished markers, or of dots on exterior nodes, raises no doubt.
        least_margin: a shift is determined if the image prefers it to all others by this many nats.
        long_gap: if no marker was seen for more than this number of frames, the view may have moved by a
            pitch in the meantime.
        trackable_motion: if the median motion since the last frame is smaller, identities can be tracked.
        rest_motion: if the median displacement from rest is smaller, identities are assumed to be unshifted.
    """

    gate: float = 0.45
    calm_share: float = 0.9
    calm_disagreeing: float = 0.05
    discontinuity: float = 0.45
    noise_factor: float = 3.0
    repairs: int = 5
    reconsiderations: int = 3
    rougher: float = 1.3
    roughness_margin: float = 0.001
    more_different: float = 1.25
    difference_margin: float = 0.004
    by_chance: int = 2
    least_margin: float = 8.0
    long_gap: int = 2
    trackable_motion: float = 0.35
    rest_motion: float = 0.25


IDENTIFICATION = IdentificationParameters()
AMBIGUOUS, NOT_FOUND, ASSUMED, TRACKED, DETERMINED = -1, 0, 1, 2, 3
"""How certain identities are, in this order: they may be shifted; no identity was found; they are assumed to
be right, as the sheet is near its rest; the motion since the last frame excludes a shift; the image excludes
it."""


class Identification(NamedTuple):
    """The result for one frame.

    Attributes:
        certainty: AMBIGUOUS, NOT_FOUND, ASSUMED, TRACKED or DETERMINED.
        found: number of markers that have a dot.
        explained: number of dots that belong to markers or exterior nodes.
        roughness: median second difference of the displacements, in spacings.
    """

    certainty: int
    found: int
    explained: int
    roughness: float


@kernel()
@no_type_check
def _set_displacements(centre_px: np.ndarray, graph: GraphArrays, assignment: Assignment) -> None:
    """Sets the displacements of all nodes that have a dot, and which dots are used."""
    rest = graph.rest_px
    dot, displacement, is_used = assignment
    is_used[: len(centre_px)] = False
    for k in range(len(rest)):
        i = dot[k]
        if i >= 0:
            displacement[k, 0], displacement[k, 1] = (
                centre_px[i, 0] - rest[k, 0],
                centre_px[i, 1] - rest[k, 1],
            )
            is_used[i] = True


@kernel()
@no_type_check
def _match_guess(
    grid: DotGrid,
    guess_px: np.ndarray,
    graph: GraphArrays,
    state: MatchingState,
    assignment: Assignment,
    workspace: Workspace,
) -> tuple[int, bool]:
    """Matches dots to guessed positions and keeps those that agree with each other.

    Returns the number of dots that agree, and whether the frame is calm.
    """
    dot, markers = assignment.dot, len(guess_px)
    difference_px, disagrees, score = assignment.displacement_px, workspace.flag, workspace.queue
    dot[markers:] = -1
    match_nearest(grid, guess_px, graph, IDENTIFICATION.gate, dot, workspace.marker_of_dot)
    good, disagreeing = mark_disagreeing(grid.centre_px, guess_px, graph, dot, difference_px, disagrees)
    is_calm = (
        state.is_consecutive
        and good >= IDENTIFICATION.calm_share * state.seen_count
        and disagreeing <= IDENTIFICATION.calm_disagreeing * good + 2
        and not is_disturbed(grid.centre_px, graph, state, dot, disagrees, score)
    )
    if is_calm:
        for k in range(markers):
            if disagrees[k]:
                dot[k] = -1
    elif good:
        good = keep_largest_set(
            markers, graph, assignment, CHECKS.agreement, difference_px[:markers], workspace
        )
    return good, is_calm


@kernel()
@no_type_check
def _grow_and_verify(
    grid: DotGrid,
    is_calm: bool,
    graph: GraphArrays,
    state: MatchingState,
    noise_px: float,
    assignment: Assignment,
    workspace: Workspace,
) -> bool:
    """Assigns dots to further nodes, and drops those that their neighbours contradict.

    If a part of the nodes is mismatched, its boundary is removed, and the other parts grow again from what is
    left. Returns whether the displacements of nodes without a dot are filled.
    """
    dot, displacement, _ = assignment
    nodes, markers = len(dot), len(state.position_px)
    count = markers if is_calm else nodes
    for turn in range(IDENTIFICATION.repairs):
        grow(grid, count, graph, assignment, workspace)
        tolerance_px = IDENTIFICATION.noise_factor * noise_px
        dropped = verify(count, graph, state, assignment, tolerance_px, is_calm, workspace)
        if is_calm:
            return False
        dropped += drop_replaceable(grid, count, graph, assignment, tolerance_px)
        fill_displacements(nodes, graph, assignment, workspace)
        if mark_mismatched(markers, grid, graph, assignment, workspace.delayed, workspace.flag):
            # Each time more is removed on both sides of the boundary, until the mismatch is gone.
            for _ in range(turn + 1):
                widen_mismatch(markers, graph, dot, workspace.flag, workspace.delayed)
            keep_largest_set(
                nodes, graph, assignment, IDENTIFICATION.discontinuity, displacement[:0], workspace
            )
            _set_displacements(grid.centre_px, graph, assignment)
        elif dropped == 0 or turn > 0:
            return True
    return False


@kernel()
@no_type_check
def _may_be_shifted(
    grid: DotGrid,
    found: Identification,
    difference: np.ndarray,
    graph: GraphArrays,
    state: MatchingState,
    assignment: Assignment,
    workspace: Workspace,
) -> bool:
    """Whether the identities in a calm frame may be shifted.

    `difference` (2,) is the mean difference of the dots from their usual appearance.
    """
    usual, usual_difference = state.roughness, state.appearance_difference
    if state.is_ambiguous:
        return True
    if found.roughness > IDENTIFICATION.rougher * usual + IDENTIFICATION.roughness_margin:
        return True
    for quantity in range(QUANTITIES):
        most = IDENTIFICATION.more_different * usual_difference[quantity]
        if difference[quantity] > most + IDENTIFICATION.difference_margin:
            return True
    markers, nodes = len(state.frames_unseen), len(graph.rest_px)
    vanished = count_vanished(assignment.dot, state.frames_unseen, graph.kind)
    if nodes == markers or vanished <= IDENTIFICATION.by_chance:
        return False
    fill_displacements(nodes, graph, assignment, workspace)
    return count_exterior_dots(grid, graph, assignment, state.presence) > IDENTIFICATION.by_chance


@kernel()
@no_type_check
def _apply_shift(
    grid: DotGrid, shifted: np.ndarray, graph: GraphArrays, assignment: Assignment, before: np.ndarray
) -> None:
    """Moves the dots of all nodes to the nodes that these become (N,); `before` (N,) is workspace."""
    dot = assignment.dot
    before[:] = dot
    dot[:] = -1
    for k in range(len(dot)):
        if before[k] >= 0 and shifted[k] >= 0:
            dot[shifted[k]] = before[k]
    _set_displacements(grid.centre_px, graph, assignment)


@kernel()
@no_type_check
def _position_nodes(graph: GraphArrays, assignment: Assignment, position_px: np.ndarray) -> None:
    """Writes the positions (N, 2) of all nodes in the image."""
    rest, displacement = graph.rest_px, assignment.displacement_px
    for k in range(len(rest)):
        position_px[k, 0] = rest[k, 0] + displacement[k, 0]
        position_px[k, 1] = rest[k, 1] + displacement[k, 1]


@kernel()
@no_type_check
def _resolve_shift(
    grid: DotGrid,
    dots: DotArrays,
    is_filled: bool,
    graph: GraphArrays,
    state: MatchingState,
    noise_px: float,
    assignment: Assignment,
    workspace: Workspace,
) -> int:
    """Moves the dots to the nodes of the most likely shift, and returns how certain the identities then are.

    The certainty does not take into account that the sheet may have jumped (`is_rigid_jump`). `is_filled`
    states whether the displacements of nodes without a dot are known.
    """
    position_px, markers = workspace.position_px, len(state.position_px)
    margin, measured_margin, motion = 0.0, 0.0, np.inf
    for _ in range(IDENTIFICATION.reconsiderations):
        if not is_filled:
            fill_displacements(len(graph.rest_px), graph, assignment, workspace)
        _position_nodes(graph, assignment, position_px)
        choice = choose_shift(dots, assignment.dot, position_px, graph, state, noise_px)
        margin, measured_margin, motion = choice.margin, choice.measured_margin, choice.motion
        if choice.shift == 0:
            break
        _apply_shift(grid, graph.shifted[choice.shift], graph, assignment, workspace.queue)
        is_filled = _grow_and_verify(grid, False, graph, state, noise_px, assignment, workspace)
    if margin >= IDENTIFICATION.least_margin:
        return DETERMINED
    if measured_margin < -IDENTIFICATION.least_margin:
        return AMBIGUOUS
    if state.frames_unseen.min() <= IDENTIFICATION.long_gap and motion < IDENTIFICATION.trackable_motion:
        return TRACKED
    rest_motion = median_motion(grid.centre_px, assignment.dot, graph.rest_px[:markers], graph.spacing_px)
    return ASSUMED if rest_motion < IDENTIFICATION.rest_motion else AMBIGUOUS


@kernel()
@no_type_check
def _drop_discontinuities(
    centre_px: np.ndarray,
    graph: GraphArrays,
    state: MatchingState,
    assignment: Assignment,
    workspace: Workspace,
) -> None:
    """Drops folded corners, and all nodes that are not connected with most of the others.

    Nodes that are not adjacent are connected by their motions since the frame before or, where it showed no
    markers, since rest.
    """
    rest, displacement = graph.rest_px, assignment.displacement_px
    drop_folded(centre_px, graph, assignment, workspace.error_ratio)
    markers, motion = len(state.position_px), workspace.position_px
    before = state.position_px if state.is_consecutive else rest
    for k in range(markers):
        motion[k, 0] = rest[k, 0] + displacement[k, 0] - before[k, 0]
        motion[k, 1] = rest[k, 1] + displacement[k, 1] - before[k, 1]
    keep_largest_set(len(rest), graph, assignment, IDENTIFICATION.discontinuity, motion[:markers], workspace)


@kernel()
@no_type_check
def _count_found(graph: GraphArrays, dot: np.ndarray, markers: int) -> tuple[int, int]:
    """Numbers of markers, and of all nodes, that have a dot."""
    explained = found = 0
    for k in range(len(dot)):
        if dot[k] >= 0:
            explained += 1
            found += k < markers and graph.kind[k] == PRESENT
    return found, explained


@kernel()
@no_type_check
def identify(
    dots: DotArrays,
    cell_px: float,
    guess_px: np.ndarray,
    graph: GraphArrays,
    state: MatchingState,
    assignment: Assignment,
    workspace: Workspace,
    difference: np.ndarray,
) -> Identification:
    """Assigns dots to nodes from a guess.

    Args:
        dots: of the frame, one or more.
        cell_px: side of the cells that dots are sorted into.
        guess_px: (m, 2) positions to begin from. For a part of the pattern they have to be right, except for
            a shift by whole pitches.
        graph: of the layout.
        state: from the frames before.
        assignment: written.
        workspace: of the layout, for as many dots.
        difference: (2,) written: mean difference of the dots from their usual appearance.
    """
    dots, graph, state = DotArrays(*dots), GraphArrays(*graph), MatchingState(*state)
    assignment, workspace = Assignment(*assignment), Workspace(*workspace)
    dot, markers = assignment.dot, len(guess_px)
    noise_px, grid = rms_noise_px(dots.covariance_px2), build_grid(dots.centre_px, cell_px)
    good, is_calm = _match_guess(grid, guess_px, graph, state, assignment, workspace)
    if good == 0:
        return Identification(NOT_FOUND, 0, 0, state.roughness)
    _set_displacements(dots.centre_px, graph, assignment)
    is_filled = _grow_and_verify(grid, is_calm, graph, state, noise_px, assignment, workspace)
    roughness = measure_roughness(markers, graph, assignment)
    appearance, buffer = state.appearance, workspace.position_px
    measure_difference(dot, dots, graph, appearance, buffer, difference)
    certainty = TRACKED if state.is_consecutive else ASSUMED
    has_jumped = is_calm and is_rigid_jump(
        dots.centre_px, dot, graph.shifted, state.position_px, state.frames_unseen, noise_px
    )
    first = Identification(certainty, 0, 0, roughness)
    if has_jumped or (
        len(graph.shifted) > 1
        and (not is_calm or _may_be_shifted(grid, first, difference, graph, state, assignment, workspace))
    ):
        if is_calm:
            grow(grid, len(dot), graph, assignment, workspace)
            tolerance_px = IDENTIFICATION.noise_factor * noise_px
            verify(len(dot), graph, state, assignment, tolerance_px, True, workspace)
        certainty = _resolve_shift(grid, dots, is_filled, graph, state, noise_px, assignment, workspace)
        if has_jumped and certainty != DETERMINED:
            certainty = AMBIGUOUS
        roughness = measure_roughness(markers, graph, assignment)
        measure_difference(dot, dots, graph, appearance, buffer, difference)
    if not is_calm:
        _drop_discontinuities(dots.centre_px, graph, state, assignment, workspace)
    found, explained = _count_found(graph, dot, markers)
    return Identification(certainty, found, explained, roughness)
