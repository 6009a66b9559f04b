"""Follows the markers from frame to frame: every dot gets its marker again in each frame, or none.

Nothing but smoothness is believed: the last frame, the layout at rest and a vote on the motion of the whole
view only give guesses, from which identities are grown and verified anew (`growth`). So a wrong guess costs
time, not identities, and after a blackout the pattern locks again by itself.
"""

from dataclasses import dataclass

import numpy as np

from manytouch.errors import SensorError
from manytouch.geometry.camera import project
from manytouch.tracking.identity import Guess, displaced, identified, slack
from manytouch.tracking.mesh import Mesh, mesh_of
from manytouch.values import Detections, Sensor, TrackedGrid
from manytouch.values.arrays import Counts, Mask, Points2, read_only

_WINDOW_LIMIT_PITCHES = 0.3


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
        """Takes the layout's reference centres (`rest_px`, or the projection of `rest_mm`).

        Raises:
            SensorError: the sensor has no markers.
        """
        layout = sensor.layout
        if layout is None:
            raise SensorError(
                f"the sensor {sensor.name!r} has no markers to follow: give a sensor file with [markers]"
            )
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
        guess = Guess(
            place_px=state.place_px + self.damping * state.velocity_px,
            last_px=state.place_px,
            seen=state.seen,
        )
        owner = identified(state.mesh, detections.centre_px, guess)
        is_seen = owner >= 0
        after = _blind(state) if not is_seen.any() else _moved(state, detections.centre_px, owner)
        return after, self._grid(after, detections, owner, is_seen)

    def expected_px(self, state: Following) -> Points2 | None:
        """Places (m, 2) in the next frame, NaN for those known to be missing; None asks for all dots."""
        present = state.mesh.is_present
        is_fast = state.motion_pitches > self.window_motion_pitches
        if is_fast or state.seen < self.window_share * present.sum():
            return None
        return np.where(present[:, None], state.place_px + self.damping * state.velocity_px, np.nan)

    def is_lost(self, state: Following) -> bool:
        """Did the last frame show fewer markers than the one before, or move faster than windows follow?"""
        return state.lost

    def _grid(
        self, after: Following, detections: Detections, owner: np.ndarray, is_seen: Mask
    ) -> TrackedGrid:
        position = np.full((len(owner), 2), np.nan)
        covariance = np.full((len(owner), 2, 2), np.nan)
        position[is_seen] = detections.centre_px[owner[is_seen]]
        covariance[is_seen] = detections.covariance_px2[owner[is_seen]]
        status = detections.status
        if status == "ok" and is_seen.sum() < self.least_share * after.mesh.is_present.sum():
            status = "few_markers"
        return TrackedGrid(
            position_px=read_only(position),
            covariance_px2=read_only(covariance),
            is_seen=read_only(is_seen),
            frames_unseen=after.frames_unseen,
            status=status,
        )


def _blind(state: Following) -> Following:
    """The state after a frame that showed no marker: places stay, nothing is known of the motion."""
    return Following(
        mesh=state.mesh,
        place_px=state.place_px,
        velocity_px=read_only(np.zeros_like(state.place_px)),
        frames_unseen=read_only(state.frames_unseen + 1),
        seen=state.seen,
        motion_pitches=np.inf,
        lost=True,
    )


def _moved(state: Following, centre_px: Points2, owner: np.ndarray) -> Following:
    """The state after a frame that showed markers."""
    mesh = state.mesh
    is_seen = owner >= 0
    seen = int(is_seen.sum())
    place = displaced(mesh, centre_px, owner)
    velocity = place - state.place_px
    pitches = np.linalg.norm(velocity[is_seen], axis=1) / mesh.spacing_px[is_seen]
    motion = float(np.quantile(pitches, 0.95))
    velocity[~is_seen | (state.frames_unseen > 0)] = 0.0
    return Following(
        mesh=mesh,
        place_px=read_only(place),
        velocity_px=read_only(velocity),
        frames_unseen=read_only(np.where(is_seen, 0, state.frames_unseen + 1)),
        seen=seen,
        motion_pitches=motion,
        lost=bool(seen < state.seen - slack(mesh) or motion > _WINDOW_LIMIT_PITCHES),
    )
