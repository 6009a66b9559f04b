"""Follows the markers from frame to frame: every dot gets its marker again in each frame, or none.

Nothing but smoothness is believed: the last frame, the layout at rest and a vote on the motion of the whole
view only give guesses, from which identities are grown and verified anew (`growth`). So a wrong guess costs
time, not identities, and after a blackout the pattern locks again by itself.
"""

from dataclasses import dataclass

import numpy as np

from manytouch.geometry.camera import project
from manytouch.tracking.mesh import Mesh, mesh_of
from manytouch.values import Detections, Sensor, TrackedGrid
from manytouch.values.arrays import Counts, Mask, Points2, read_only

Bins = tuple[np.ndarray, int, int, np.ndarray, np.ndarray]
_SLACK = 0.25
_SLOW_PITCHES = 0.15
_CALM_PITCHES = 0.3
_WINDOW_LIMIT_PITCHES = 0.3
_LEAST_BELIEVED = 0.3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Following:
    """What is kept between frames.

    Attributes:
        mesh: neighbourhoods of the layout.
        place_px: (m, 2) where the markers were seen, or should have been.
        velocity_px: (m, 2) motion from the frame before; 0 where it was not seen twice.
        frames_unseen: (m,).
        seen: number of markers that were seen in the last frame that showed any.
        motion_pitches: motion that 95 % of the seen markers stayed below, in spacings; inf after a bad frame.
        lost: fewer or faster than windows can follow.
    """

    mesh: Mesh
    place_px: Points2
    velocity_px: Points2
    frames_unseen: Counts
    seen: int
    motion_pitches: float
    lost: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Answer:
    """What one guess gave: dots of the markers, their number, and the usual motion in spacings."""

    owner: np.ndarray
    number: int
    motion_pitches: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FollowGrid:
    """Which dot is which marker, for any layout.

    Attributes:
        damping: part of the last motion that is expected again.
        window_motion_pitches: windows are asked for while motion stays below this, per frame.
        window_share: and while this share of the markers is seen.
        least_share: below this share of the markers the status is few_markers.
    """

    damping: float = 0.5
    window_motion_pitches: float = 0.2
    window_share: float = 0.97
    least_share: float = 0.5

    def start(self, sensor: Sensor) -> Following:
        """Takes the layout's reference centres (`rest_px`, or the projection of `rest_mm`)."""
        assert sensor.layout is not None
        layout = sensor.layout
        rest = project(sensor.camera, layout.rest_mm) if layout.rest_px is None else layout.rest_px
        mesh = mesh_of(rest, layout.is_missing)
        return Following(
            mesh=mesh,
            place_px=mesh.rest_px,
            velocity_px=read_only(np.zeros_like(mesh.rest_px)),
            frames_unseen=read_only(np.zeros(len(rest), dtype=np.int64)),
            seen=0,
            motion_pitches=np.inf,
            lost=False,
        )

    def step(self, state: Following, detections: Detections) -> tuple[Following, TrackedGrid]:
        """Identifies the markers among the dots of the next frame."""
        mesh = state.mesh
        owner = np.full(len(mesh.rest_px), -1)
        if len(detections.centre_px) > 0 and mesh.is_present.any():
            owner = self._identified(
                state, np.array(detections.centre_px)
            )  # a copy: one type for the kernels
        is_seen = owner >= 0
        return self._moved(state, detections, owner, is_seen), self._grid(state, detections, owner, is_seen)

    def expected_px(self, state: Following) -> Points2 | None:
        """Places (m, 2) in the next frame, NaN for those known to be missing; None asks for all dots."""
        present = state.mesh.is_present
        if (
            state.motion_pitches > self.window_motion_pitches
            or state.seen < self.window_share * present.sum()
        ):
            return None
        return np.where(present[:, None], state.place_px + self.damping * state.velocity_px, np.nan)

    def is_lost(self, state: Following) -> bool:
        """Did the last frame show fewer markers than the one before, or move faster than windows follow?"""
        return state.lost

    def _identified(self, state: Following, dot: Points2) -> np.ndarray:
        """(m,) dot of each marker or -1: by the first guess that holds, else by the best of all."""
        from manytouch.tracking.growth import bin_dots
        from manytouch.tracking.registration import shifts

        mesh = state.mesh
        present = int(mesh.is_present.sum())
        slack = 1.0 + _SLACK * np.sqrt(present)
        wanted = min(present, len(dot)) - slack
        bins = bin_dots(dot, mesh.usual_px)
        last = state.place_px + self.damping * state.velocity_px
        first = _answer(mesh, dot, bins, last, state.place_px)
        is_slow = state.seen > 0 and first.motion_pitches < _SLOW_PITCHES
        if first.number >= state.seen - slack and (first.number >= wanted or is_slow):
            return first.owner
        answers = [first]
        for guess in (last, mesh.rest_px):
            for shift in shifts(dot, bins, mesh.usual_px, guess, mesh.is_present, mesh.usual_px):
                answers.append(_answer(mesh, dot, bins, guess + shift, state.place_px))
            if max(each.number for each in answers) >= min(wanted, 0.9 * max(state.seen, 1)):
                break
        return _best(answers, present, slack)

    def _moved(self, state: Following, detections: Detections, owner: np.ndarray, is_seen: Mask) -> Following:
        """The state after a frame."""
        from manytouch.tracking.registration import placed

        mesh = state.mesh
        seen = int(is_seen.sum())
        frames_unseen = np.where(is_seen, 0, state.frames_unseen + 1)
        if seen == 0:
            return Following(
                mesh=mesh,
                place_px=state.place_px,
                velocity_px=read_only(np.zeros_like(state.place_px)),
                frames_unseen=read_only(frames_unseen),
                seen=state.seen,
                motion_pitches=np.inf,
                lost=True,
            )
        place = np.empty_like(mesh.rest_px)
        placed(np.array(detections.centre_px), owner, mesh.rest_px, mesh.net, place)
        velocity = place - state.place_px
        pitches = np.linalg.norm(velocity[is_seen], axis=1) / mesh.spacing_px[is_seen]
        motion = float(np.quantile(pitches, 0.95))
        velocity[~is_seen | (state.frames_unseen > 0)] = 0.0
        slack = 1.0 + _SLACK * np.sqrt(mesh.is_present.sum())
        return Following(
            mesh=mesh,
            place_px=read_only(place),
            velocity_px=read_only(velocity),
            frames_unseen=read_only(frames_unseen),
            seen=seen,
            motion_pitches=motion,
            lost=bool(seen < state.seen - slack or motion > _WINDOW_LIMIT_PITCHES),
        )

    def _grid(
        self, state: Following, detections: Detections, owner: np.ndarray, is_seen: Mask
    ) -> TrackedGrid:
        markers = len(owner)
        position = np.full((markers, 2), np.nan)
        covariance = np.full((markers, 2, 2), np.nan)
        position[is_seen] = detections.centre_px[owner[is_seen]]
        covariance[is_seen] = detections.covariance_px2[owner[is_seen]]
        status = detections.status
        if status == "ok" and is_seen.sum() < self.least_share * state.mesh.is_present.sum():
            status = "few_markers"
        return TrackedGrid(
            position_px=read_only(position),
            covariance_px2=read_only(covariance),
            is_seen=read_only(is_seen),
            frames_unseen=read_only(np.where(is_seen, 0, state.frames_unseen + 1)),
            status=status,
        )


def _answer(mesh: Mesh, dot: Points2, bins: Bins, guess: Points2, before: Points2) -> _Answer:
    from manytouch.tracking.growth import identify

    owner = np.empty(len(guess), dtype=np.int64)
    number = identify(dot, bins, mesh.usual_px, guess, mesh.rest_px, mesh.net, mesh.triangle, owner)
    if number == 0:
        return _Answer(owner=owner, number=0, motion_pitches=np.inf)
    is_seen = owner >= 0
    moved = np.linalg.norm(dot[owner[is_seen]] - before[is_seen], axis=1) / mesh.spacing_px[is_seen]
    return _Answer(owner=owner, number=number, motion_pitches=float(np.median(moved)))


def _best(answers: list[_Answer], present: int, slack: float) -> np.ndarray:
    """The answer with most markers, motion counted against it; none where another says as well.

    On a regular pattern a guess that is off by a pitch loses only the outermost line, so after a large motion
    an answer must beat its rivals by more than chance to be believed.
    """
    score = [each.number - slack * min(each.motion_pitches, 2.0) for each in answers]
    best = answers[int(np.argmax(score))]
    nobody = np.full(len(best.owner), -1)
    if best.motion_pitches < _CALM_PITCHES:
        return best.owner
    if best.number < _LEAST_BELIEVED * present:
        return nobody
    for each in answers:
        common = (each.owner >= 0) & (best.owner >= 0)
        differs = (each.owner != best.owner)[common]
        if each.number >= best.number - slack and common.any() and differs.mean() > 0.5:
            return nobody
    return best.owner
