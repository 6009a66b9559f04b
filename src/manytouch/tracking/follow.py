"""Follows the markers from frame to frame: every dot gets its marker again in each frame, or none.

Nothing but smoothness is believed: the last frame, the layout at rest and a vote on the motion of the whole
view only give guesses, from which identities are grown and verified anew (`identification`). So a wrong guess
costs time, not identities, and after a blackout the pattern locks again by itself.
"""

from dataclasses import dataclass, replace

import numpy as np

from manytouch.errors import SensorError
from manytouch.geometry.camera import project
from manytouch.tracking.identity import Identified, Past, Scratch, identified, presence_of, slack
from manytouch.tracking.mesh import Mesh, mesh_of
from manytouch.values import Detections, Layout, Sensor, TrackedGrid
from manytouch.values.arrays import Counts, Points2, read_only

_WINDOW_LIMIT_PITCHES = 0.3
_LONG_GAP = 2  # frames without a marker after which the view may have moved by a pitch
_WHOLE_RADII = 1.5


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Following:
    """What is kept between frames.

    Attributes:
        mesh: neighbourhoods of the layout.
        scratch: memory for the kernels; it holds no knowledge.
        place_px: (m, 2) where the markers were seen, or should have been.
        velocity_px: (m, 2) motion from the frame before; 0 where it was not seen twice.
        frames_unseen: (m,).
        presence: (N,) share of recent frames in which each node of the mesh had a dot.
        seen: number of markers that were seen in the last frame that showed any.
        roughness: mean second difference of displacements then, in spacings.
        motion_pitches: motion that 95 % of the seen markers stayed below, in spacings; inf after a bad frame.
        is_locked: the last frame was a good one.
        is_anchored: outline or irregularities have been found to tell slips along the lattice apart.
        lost: fewer or faster than windows can follow.
    """

    mesh: Mesh
    scratch: Scratch
    place_px: Points2
    velocity_px: Points2
    frames_unseen: Counts
    presence: np.ndarray
    seen: int
    roughness: float
    motion_pitches: float
    is_locked: bool
    is_anchored: bool
    lost: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FollowGrid:
    """Which dot is which marker, for any layout.

    Attributes:
        damping: part of the last motion that is expected again.
        window_motion_pitches: windows are asked for while motion stays below this, per frame.
        window_share: and while this share of the markers is seen.
        least_share: below this share of the markers the status is few_markers.
        roi_px: x, y, width, height of the part of the image in which dots are looked for; None: all of it.
    """

    damping: float = 0.5
    window_motion_pitches: float = 0.2
    window_share: float = 0.97
    least_share: float = 0.5
    roi_px: tuple[int, int, int, int] | None = None

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
        mesh = mesh_of(
            rest,
            layout.is_missing,
            row_column=layout.row_column,
            bounds_px=self._bounds(sensor, layout, rest),
        )
        place = read_only(np.array(rest, dtype=np.float64))
        return Following(
            mesh=mesh,
            scratch=Scratch(len(mesh.rest_px)),
            place_px=place,
            velocity_px=read_only(np.zeros_like(place)),
            frames_unseen=read_only(np.zeros(len(rest), dtype=np.int64)),
            presence=presence_of(mesh),
            seen=0,
            roughness=0.0,
            motion_pitches=np.inf,
            is_locked=False,
            is_anchored=False,
            lost=False,
        )

    def _bounds(self, sensor: Sensor, layout: Layout, rest_px: Points2) -> tuple[float, float, float, float]:
        """Between which x and y the centres of whole dots lie."""
        camera = sensor.camera
        x, y, w, h = self.roi_px or (0, 0, camera.width_px, camera.height_px)
        extent_px, extent_mm = (np.ptp(each, axis=0).max() for each in (rest_px, layout.rest_mm))
        px_per_mm = extent_px / extent_mm if extent_mm > 0 else 0.0
        margin = _WHOLE_RADII * px_per_mm * float(np.median(layout.radius_mm))
        return x - 0.5 + margin, y - 0.5 + margin, x + w - 0.5 - margin, y + h - 0.5 - margin

    def step(self, state: Following, detections: Detections) -> tuple[Following, TrackedGrid]:
        """Identifies the markers among the dots of the next frame."""
        past = Past(
            guess_px=state.place_px + self.damping * state.velocity_px,
            place_px=state.place_px,
            frames_unseen=state.frames_unseen,
            presence=state.presence,
            seen=state.seen,
            roughness=state.roughness,
            is_next=state.is_locked,
            is_anchored=state.is_anchored,
        )
        answer = identified(
            *(state.mesh, detections.centre_px, past), noise_px=_noise_px(detections), scratch=state.scratch
        )
        if answer.found == 0:
            after, is_seen = _blind(state), np.zeros(state.mesh.markers, dtype=bool)
        else:
            after, is_seen = _moved(state, detections.centre_px, answer)
        gap = int(state.frames_unseen.min(initial=0))
        may_slip = _may_slip(after) and gap > _LONG_GAP and state.seen > 0
        return after, self._grid(after, detections, answer, is_seen, may_slip=may_slip)

    def expected_px(self, state: Following) -> Points2 | None:
        """Places (m, 2) in the next frame, NaN for those known to be missing; None asks for all dots."""
        present = state.mesh.is_present
        is_fast = state.motion_pitches > self.window_motion_pitches
        if is_fast or state.seen < self.window_share * state.mesh.present:
            return None
        return np.where(present[:, None], state.place_px + self.damping * state.velocity_px, np.nan)

    def is_lost(self, state: Following) -> bool:
        """Did the last frame show fewer markers than the one before, or move faster than windows follow?"""
        return state.lost

    def _grid(
        self,
        after: Following,
        detections: Detections,
        answer: Identified,
        is_seen: np.ndarray,
        *,
        may_slip: bool,
    ) -> TrackedGrid:
        markers = after.mesh.markers
        position = np.full((markers, 2), np.nan)
        covariance = np.full((markers, 2, 2), np.nan)
        dots = answer.owner[:markers][is_seen]
        position[is_seen] = detections.centre_px[dots]
        covariance[is_seen] = detections.covariance_px2[dots]
        area = np.full(markers, np.nan)
        area[is_seen] = detections.area_px2[dots]
        status = detections.status
        if status == "ok" and (answer.is_slipping or (len(dots) and may_slip)):
            status = "ambiguous_shift"
        if status == "ok" and len(dots) < self.least_share * after.mesh.present:
            status = "few_markers"
        return TrackedGrid(
            position_px=read_only(position),
            covariance_px2=read_only(covariance),
            is_seen=read_only(is_seen),
            frames_unseen=after.frames_unseen,
            area_px2=read_only(area),
            status=status,
        )


def _may_slip(state: Following) -> bool:
    """Has the image never told slips along the lattice apart? From a good frame on, motion is followed."""
    return len(state.mesh.slip) > 1 and not state.is_anchored


def _noise_px(detections: Detections) -> float:
    """Usual standard deviation of a centre."""
    if len(detections.centre_px) == 0:
        return 0.0
    mean_px2 = float(detections.covariance_px2[:, 0, 0].mean())
    return float(np.sqrt(mean_px2)) if 0.0 < mean_px2 < np.inf else 0.0


def _blind(state: Following) -> Following:
    """The state after a frame in which no marker could be told: nothing is known of the motion."""
    return replace(
        state,
        velocity_px=read_only(np.zeros_like(state.place_px)),
        frames_unseen=read_only(state.frames_unseen + 1),
        motion_pitches=np.inf,
        is_locked=False,
        lost=True,
    )


def _moved(state: Following, centre_px: Points2, answer: Identified) -> tuple[Following, np.ndarray]:
    """The state after a frame that showed markers, and which were seen."""
    from manytouch.tracking.registration import settle

    mesh = state.mesh
    place, velocity = np.empty_like(state.place_px), np.empty_like(state.place_px)
    unseen, presence = np.empty_like(state.frames_unseen), np.empty_like(state.presence)
    is_seen = np.empty(mesh.markers, dtype=bool)
    arrays = state.scratch.for_dots(len(centre_px))
    motion = settle(
        np.array(centre_px, dtype=np.float64),
        answer.owner,
        mesh.markers,
        (state.place_px, state.frames_unseen, state.presence),
        mesh.net,
        mesh.bounds_px,
        arrays[6:10],
        (arrays[10], place, velocity, unseen, presence, is_seen),
    )
    seen = int(is_seen.sum())
    after = Following(
        mesh=mesh,
        scratch=state.scratch,
        place_px=read_only(place),
        velocity_px=read_only(velocity),
        frames_unseen=read_only(unseen),
        presence=read_only(presence),
        seen=seen,
        roughness=answer.roughness,
        motion_pitches=float(motion),
        is_locked=True,
        is_anchored=answer.is_anchored,
        lost=bool(seen < state.seen - slack(mesh) or motion > _WINDOW_LIMIT_PITCHES),
    )
    return after, is_seen
