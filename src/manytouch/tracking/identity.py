"""Which dot is which marker in one frame, from any guess: the first that holds, or the best of several."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.tracking.mesh import Mesh
from manytouch.values.arrays import Points2

Markers2 = Float64[np.ndarray, "m 2"]

Bins = tuple[np.ndarray, int, int, np.ndarray, np.ndarray]
_SLACK = 0.25
_SLOW_PITCHES = 0.15
_CALM_PITCHES = 0.3
_LEAST_BELIEVED = 0.6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Guess:
    """Where the markers may be.

    Attributes:
        place_px: (m, 2) where they are expected.
        last_px: (m, 2) where they were before: motion is counted from there.
        seen: how many were seen before; 0 when nothing was.
    """

    place_px: Markers2
    last_px: Markers2
    seen: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Answer:
    """What one guess gave: dots of the markers, their number, and the usual motion in spacings."""

    owner: np.ndarray
    number: int
    motion_pitches: float


def slack(mesh: Mesh) -> float:
    """Number of markers by which frames may differ by chance; much less than a line of the pattern."""
    return float(1.0 + _SLACK * np.sqrt(mesh.is_present.sum()))


def identified(mesh: Mesh, centre_px: Points2, guess: Guess) -> np.ndarray:
    """(m,) index of the dot of each marker, -1 where it is not seen or cannot be told.

    Args:
        mesh: of the layout.
        centre_px: (n, 2) dots in any order.
        guess: tried first; when it does not hold, it and the layout at rest are tried again, moved by what a
            vote on the motion of the whole view says.
    """
    owner = np.full(len(mesh.rest_px), -1)
    present = int(mesh.is_present.sum())
    if len(centre_px) == 0 or present == 0:
        return owner
    from manytouch.tracking.growth import bin_dots
    from manytouch.tracking.registration import shifts

    dot = np.array(centre_px)  # a copy, so that the kernels meet one type of array, writable or not
    bins = bin_dots(dot, mesh.usual_px)
    wanted = min(present, len(dot)) - slack(mesh)
    first = _answer(mesh, dot, bins, np.array(guess.place_px), guess.last_px)
    is_slow = guess.seen > 0 and first.motion_pitches < _SLOW_PITCHES
    if first.number >= wanted or (is_slow and first.number >= guess.seen - slack(mesh)):
        return first.owner
    answers = [first]

    def try_shifts_of(begin: np.ndarray) -> None:
        for shift in shifts(dot, bins, mesh.usual_px, begin, mesh.is_present, mesh.usual_px):
            answers.append(_answer(mesh, dot, bins, begin + shift, guess.last_px))

    for begin in (np.array(guess.place_px), np.array(mesh.rest_px)):
        try_shifts_of(begin)
        best = _best(answers, mesh)
        if best.number >= min(wanted, 0.9 * max(guess.seen, 1)):
            break
    if best.number > 0 and (best.number < wanted or best.motion_pitches > _CALM_PITCHES):
        # The same deformation, but one line further: is the best answer only a slip by one pitch?
        try_shifts_of(displaced(mesh, dot, best.owner))
    return _believed(answers, mesh)


def displaced(mesh: Mesh, centre_px: Points2, owner: np.ndarray) -> np.ndarray:
    """(m, 2) the dot of each identified marker; the others are displaced as their neighbours are."""
    from manytouch.tracking.registration import placed

    place = np.empty_like(mesh.rest_px)
    placed(np.array(centre_px), owner, mesh.rest_px, mesh.net, place)
    return place


def _answer(mesh: Mesh, dot: Points2, bins: Bins, guess_px: Markers2, last_px: Markers2) -> _Answer:
    from manytouch.tracking.growth import identify

    owner = np.empty(len(guess_px), dtype=np.int64)
    number = identify(dot, bins, mesh.usual_px, guess_px, mesh.rest_px, mesh.net, mesh.triangle, owner)
    if number == 0:
        return _Answer(owner=owner, number=0, motion_pitches=np.inf)
    is_seen = owner >= 0
    moved = np.linalg.norm(dot[owner[is_seen]] - last_px[is_seen], axis=1) / mesh.spacing_px[is_seen]
    return _Answer(owner=owner, number=number, motion_pitches=float(np.median(moved)))


def _best(answers: list[_Answer], mesh: Mesh) -> _Answer:
    """The answer with most markers, motion counted against it: on a regular pattern all slips look alike."""
    score = [each.number - 2.0 * slack(mesh) * min(each.motion_pitches, 2.0) for each in answers]
    return answers[int(np.argmax(score))]


def _believed(answers: list[_Answer], mesh: Mesh) -> np.ndarray:
    """Dots of the markers by the best answer; none where another one says as well.

    On a regular pattern an answer that is off by a pitch loses only the outermost line, so after a large
    motion an answer must hold most markers, and beat its rivals by more than chance.
    """
    best = _best(answers, mesh)
    if best.motion_pitches < _CALM_PITCHES:
        return best.owner
    nobody = np.full(len(best.owner), -1)
    if best.number < _LEAST_BELIEVED * mesh.is_present.sum():
        return nobody
    for each in answers:
        common = (each.owner >= 0) & (best.owner >= 0)
        differs = (each.owner != best.owner)[common]
        if each.number >= best.number - slack(mesh) and common.any() and differs.mean() > 0.5:
            return nobody
    return best.owner
