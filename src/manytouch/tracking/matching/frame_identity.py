"""Which dot is which marker in one frame: from the last frame, from the layout at rest, or from nothing."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from manytouch.tracking.lattice_graph import CLOSED, MISSING, OPEN, PRESENT, LatticeGraph
from manytouch.values.arrays import Counts, Points2, read_only

Dots = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Centres (n, 2) in any order, their covariances (n, 2, 2), areas (n,) and contrasts (n,)."""
Markers2 = Float64[np.ndarray, "m 2"]

_SLACK = 0.25
_EXPLAINED = 0.75
_FOUND = 0.5
_LEAST_FOUND, _LEAST_SHARE = 4, 0.1
SIGNS = 2  # of a look: area and contrast
_PRESENCE = {PRESENT: 0.95, MISSING: 0.01, CLOSED: 0.003, OPEN: 0.3}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Past:
    """What the frames before say about the next one.

    Attributes:
        guess_px: (m, 2) where the markers are expected.
        place_px: (m, 2) where they were, or should have been, in the last good frame.
        frames_unseen: (m,).
        presence: (N,) share of recent frames in which each node had a dot.
        seen: how many markers were seen in the last good frame; 0 when there was none.
        roughness: mean second difference of their displacements then, in spacings.
        is_next: the last good frame is the one before this one.
        is_open: the numbers may have slipped along the lattice before; nothing has settled it yet.
        look: (m, 2) area and contrast of each marker's dot against the adjacent ones'; NaN: not known.
        unlike: (2,) how unlike that the dots usually are.
    """

    guess_px: Markers2
    place_px: Markers2
    frames_unseen: Counts
    presence: np.ndarray
    seen: int
    roughness: float
    is_next: bool
    is_open: bool
    look: np.ndarray
    unlike: np.ndarray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Identified:
    """Dots of the nodes.

    Attributes:
        owner: (N,) dot of each node, -1 where there is none or it cannot be told.
        found: number of markers that have one; 0 when nothing is believed.
        explained: number of dots that are believed to be markers or ghosts.
        is_slipping: a pattern was found, but its numbers may have slipped: nothing is believed.
        is_open, roughness: as in `Past`, after this frame.
        unlike: (2,) how unlike the known looks this frame's dots are.
    """

    owner: np.ndarray
    found: int
    explained: int
    is_slipping: bool
    is_open: bool
    roughness: float
    unlike: np.ndarray


@dataclass(slots=True, eq=False)
class Scratch:
    """Memory that the kernels write before they read it: no knowledge, kept only to be used again."""

    nodes: int
    dots: int = 0
    arrays: tuple[np.ndarray, ...] = field(default=())

    def for_dots(self, number: int) -> tuple[np.ndarray, ...]:
        """The arrays, large enough for a number of dots."""
        if not self.arrays or number > self.dots:
            self.dots = 2 * number + self.nodes
            whole, real = (np.empty(self.nodes, dtype=kind) for kind in (np.int64, np.float64))
            flags = np.empty(self.nodes, dtype=bool)
            self.arrays = (
                np.empty(self.dots, dtype=np.int64),
                np.empty(self.dots, dtype=bool),
                *(real, whole, whole.copy(), flags, whole.copy(), whole.copy(), flags.copy(), whole.copy()),
                np.empty((self.nodes, 2)),
            )
        return self.arrays


def presence_of(mesh: LatticeGraph) -> np.ndarray:
    """(N,) how likely each node shows a dot, before any frame was seen."""
    share = np.array([_PRESENCE[kind] for kind in range(4)])
    return read_only(share[mesh.kind])


def slack(mesh: LatticeGraph) -> float:
    """Number of markers by which frames may differ by chance; much less than a line of the pattern."""
    return float(1.0 + _SLACK * np.sqrt(mesh.present))


def _can_slip(mesh: LatticeGraph) -> bool:
    return len(mesh.slip) > 1


def identified(mesh: LatticeGraph, dots: Dots, past: Past, scratch: Scratch) -> Identified:
    """Dots of the markers.

    The guess is tried first; where it explains few of the dots, the layout at rest is tried, and both moved
    by what a vote on the motion of the whole view says.

    Args:
        mesh: of the layout.
        dots: of the frame.
        past: what is known from before.
        scratch: of `mesh`.
    """
    present, number = mesh.present, len(dots[0])
    if number == 0 or present == 0:
        return _nothing(mesh, past)
    best = _tried(mesh, dots, past.guess_px, past, scratch)
    if not _is_enough(best, number, present):
        for begin in _beginnings(mesh, dots[0], past):
            answer = _tried(mesh, dots, begin, past, scratch)
            if (answer.found, answer.explained) > (best.found, best.explained):
                best = answer
            if _is_enough(best, number, present):
                break
    return _believed(mesh, past, best, number, present)


def _beginnings(mesh: LatticeGraph, centre_px: Points2, past: Past) -> Iterator[np.ndarray]:
    """Places (m, 2) to begin from when the guess was poor."""
    from manytouch.tracking.matching.registration import shifts

    rest = np.array(mesh.rest_px[: mesh.markers])
    yield rest
    for begin in (past.guess_px, rest):
        for shift in shifts(centre_px, mesh.usual_px, begin, mesh.is_present)[:3]:
            yield begin + shift


def _is_enough(answer: Identified, dots: int, present: int) -> bool:
    return answer.explained >= _EXPLAINED * dots or answer.found >= 0.97 * present


def _believed(mesh: LatticeGraph, past: Past, answer: Identified, dots: int, present: int) -> Identified:
    """The answer, or nothing when it is too little to be more than chance."""
    least = max(min(_LEAST_FOUND, present), _LEAST_SHARE * present)
    is_chance = answer.explained < _FOUND * min(dots, present) and answer.found < _FOUND * past.seen
    if answer.is_slipping or (answer.found >= least and not is_chance):
        return answer
    return _nothing(mesh, past)


def _nothing(mesh: LatticeGraph, past: Past) -> Identified:
    return Identified(
        owner=np.full(len(mesh.rest_px), -1),
        found=0,
        explained=0,
        is_slipping=False,
        is_open=past.is_open,
        roughness=past.roughness,
        unlike=past.unlike,
    )


def _tried(mesh: LatticeGraph, dots: Dots, guess_px: np.ndarray, past: Past, scratch: Scratch) -> Identified:
    from manytouch.tracking.matching.identify import ASSUMED, TOLD, UNKNOWN, identify

    owner = np.empty(len(mesh.rest_px), dtype=np.int64)
    moved = np.empty((len(mesh.rest_px), 2))
    unlike = np.empty(SIGNS)
    verdict, found, explained, roughness = identify(
        dots,
        mesh.usual_px,
        guess_px,
        (
            *(past.place_px, past.frames_unseen, past.presence),
            *(past.seen, past.roughness, past.is_next, past.is_open, past.look, past.unlike),
        ),
        mesh.net,
        (mesh.slip, mesh.triangle, mesh.bounds_px),
        owner,
        moved,
        scratch.for_dots(len(dots[0])),
        unlike,
    )
    if verdict < 0:
        owner.fill(-1)
    return Identified(
        owner=owner,
        found=int(found) if verdict > 0 else 0,
        explained=int(explained),
        is_slipping=verdict < 0,
        is_open=_can_slip(mesh) and verdict != TOLD and (past.is_open or verdict in {UNKNOWN, ASSUMED}),
        roughness=float(roughness),
        unlike=unlike,
    )
