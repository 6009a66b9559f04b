"""Matches one frame: guesses of where the markers are, tried in order until one explains most dots or
finds most markers."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import plain
from manytouch.tracking.lattice_graph import LatticeGraph
from manytouch.tracking.matching.records import Assignment, DotArrays, MatchingState, Workspace
from manytouch.values.arrays import Points2, read_only

Markers2 = Float64[np.ndarray, "m 2"]

APPEARANCE_QUANTITIES = 2
"""Area and contrast."""

_EXPLAINED_SHARE, _FOUND_SHARE = 0.75, 0.97
"""No other guess is tried if a match explains this share of the dots, or finds this share of the markers."""
_TRANSLATIONS = 3
"""Number of likely translations of a guess that are tried."""
_LEAST_MARKERS, _LEAST_SHARE = 4, 0.1
"""A match needs at least this number and this share of the markers."""
_CHANCE_SHARE = 0.5
"""A match of a smaller share of the dots, and of the markers seen before, is accidental."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FrameMatch:
    """Dots of the nodes in one frame.

    Attributes:
        dot: (N,) dot of each node; -1: none, or not determined.
        found: number of markers that have one; 0 when no identities are accepted.
        explained: number of dots that belong to markers or exterior nodes.
        is_shift_unresolved: a pattern was found, but its identities may be shifted, so none is accepted.
        is_ambiguous, roughness: as in `MatchingState`, after this frame.
        appearance_difference: (2,) mean difference of this frame's dots from their usual appearance.
    """

    dot: np.ndarray
    found: int
    explained: int
    is_shift_unresolved: bool
    is_ambiguous: bool
    roughness: float
    appearance_difference: np.ndarray


@dataclass(slots=True, eq=False)
class WorkspacePool:
    """The workspace of a layout, replaced by a larger one when a frame has more dots.

    Its content is written before it is read in each frame, so states that share a pool stay independent.

    Attributes:
        nodes: N.
    """

    nodes: int
    _dots: int = 0
    _workspace: Workspace | None = None

    def get(self, dots: int) -> Workspace:
        """A workspace for a number of dots."""
        if self._workspace is None or dots > self._dots:
            self._dots = 2 * dots + self.nodes
            self._workspace = Workspace(
                marker_of_dot=np.empty(self._dots, dtype=np.int64),
                is_used=np.empty(self._dots, dtype=bool),
                error_ratio=np.empty(self.nodes),
                parent=np.empty(self.nodes, dtype=np.int64),
                set_size=np.empty(self.nodes, dtype=np.int64),
                flag=np.empty(self.nodes, dtype=bool),
                queue=np.empty(self.nodes, dtype=np.int64),
                delayed=np.empty(self.nodes, dtype=np.int64),
                is_queued=np.empty(self.nodes, dtype=bool),
                attempted=np.empty(self.nodes, dtype=np.int64),
                position_px=np.empty((self.nodes, 2)),
            )
        return self._workspace


def match_frame(
    graph: LatticeGraph, dots: DotArrays, guess_px: Markers2, state: MatchingState, pool: WorkspacePool
) -> FrameMatch:
    """Assigns the dots of a frame to the nodes.

    The guess is tried first; where it explains few of the dots, the layout at rest is tried, and both of them
    translated as a vote on the motion of the whole view suggests.

    Args:
        graph: of the layout.
        dots: of the frame.
        guess_px: (m, 2) where the markers are expected; NaN: known to be missing.
        state: from the frames before.
        pool: of the graph.
    """
    present, number = graph.expected_count, len(dots.centre_px)
    if number == 0 or present == 0:
        return _no_match(graph, state)
    best = _try_guess(graph, dots, guess_px, state, pool)
    if not _is_sufficient(best, number, present):
        for other_px in other_guesses(graph, dots.centre_px, guess_px):
            match = _try_guess(graph, dots, other_px, state, pool)
            if (match.found, match.explained) > (best.found, best.explained):
                best = match
            if _is_sufficient(best, number, present):
                break
    least = max(min(_LEAST_MARKERS, present), _LEAST_SHARE * present)
    explains_few = best.explained < _CHANCE_SHARE * min(number, present)
    is_chance = explains_few and best.found < _CHANCE_SHARE * state.seen_count
    if best.is_shift_unresolved or (best.found >= least and not is_chance):
        return best
    return _no_match(graph, state)


def other_guesses(graph: LatticeGraph, centre_px: Points2, guess_px: Markers2) -> Iterator[np.ndarray]:
    """Positions (m, 2) to begin from when the first guess was poor.

    They are read-only as the first one is: the kernels are compiled once for each type.
    """
    from manytouch.tracking.matching.view_translation import likely_translations

    rest = read_only(np.array(graph.arrays.rest_px[: graph.marker_count]))
    yield rest
    for begin in (guess_px, rest):
        found = likely_translations(centre_px, graph.spacing_px, begin, graph.is_present)
        for translation in found[:_TRANSLATIONS]:
            yield read_only(begin + translation)


def _is_sufficient(match: FrameMatch, dots: int, present: int) -> bool:
    return match.explained >= _EXPLAINED_SHARE * dots or match.found >= _FOUND_SHARE * present


def _no_match(graph: LatticeGraph, state: MatchingState) -> FrameMatch:
    return FrameMatch(
        dot=np.full(len(graph.arrays.rest_px), -1),
        found=0,
        explained=0,
        is_shift_unresolved=False,
        is_ambiguous=state.is_ambiguous,
        roughness=state.roughness,
        appearance_difference=state.appearance_difference,
    )


def _try_guess(
    graph: LatticeGraph, dots: DotArrays, guess_px: Markers2, state: MatchingState, pool: WorkspacePool
) -> FrameMatch:
    from manytouch.tracking.matching.identify import AMBIGUOUS, ASSUMED, DETERMINED, NOT_FOUND, identify

    nodes, workspace = len(graph.arrays.rest_px), pool.get(len(dots.centre_px))
    dot, difference = np.empty(nodes, dtype=np.int64), np.empty(APPEARANCE_QUANTITIES)
    assignment = Assignment(dot, np.empty((nodes, 2)), workspace.is_used)
    certainty, found, explained, roughness = identify(
        plain(dots),
        graph.spacing_px,
        guess_px,
        plain(graph.arrays),
        plain(state),
        plain(assignment),
        plain(workspace),
        difference,
    )
    if certainty == AMBIGUOUS:
        dot.fill(-1)
    is_uncertain = state.is_ambiguous or certainty in {AMBIGUOUS, ASSUMED}
    return FrameMatch(
        dot=dot,
        found=found if certainty > NOT_FOUND else 0,
        explained=explained,
        is_shift_unresolved=certainty == AMBIGUOUS,
        is_ambiguous=graph.can_be_shifted and certainty != DETERMINED and is_uncertain,
        roughness=roughness,
        appearance_difference=difference,
    )
