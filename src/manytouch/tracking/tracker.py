"""Follows the markers from frame to frame: every dot gets its marker again in each frame, or none.

Nothing but smoothness is believed: the last frame, the layout at rest and a vote on the motion of the whole
view only give guesses, from which identities are grown and verified anew (`identification`). So a wrong guess
costs time, not identities, and after a blackout the pattern locks again by itself.
"""

from dataclasses import dataclass, replace

import numpy as np

from manytouch.errors import SensorError
from manytouch.geometry.camera import project
from manytouch.tracking.lattice_graph import LatticeGraph, mesh_of
from manytouch.tracking.matching.frame_identity import (
    SIGNS,
    Dots,
    Identified,
    Past,
    Scratch,
    identified,
    presence_of,
    slack,
)
from manytouch.values import Detections, Layout, Roi, Sensor, Status, TrackedGrid
from manytouch.values.arrays import Counts, Points2, read_only

_WINDOW_LIMIT_PITCHES = 0.3
_LEAST_LEARNT = 4  # frames: looks known from fewer are mostly noise
_LEARNT, _LEARNT_OFTEN, _LEARNT_EACH = 0.05, 20, 4
_WHOLE_RADII = 1.5

Measured = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerTrackerState:
    """What is kept between frames.

    Attributes:
        mesh: neighbourhoods of the layout.
        scratch: memory for the kernels; it holds no knowledge.
        place_px: (m, 2) where the markers were seen, or should have been.
        expected_px: (m, 2) where they should be in the next frame; NaN where they are known to be missing.
        frames_unseen: (m,).
        presence: (N,) share of recent frames in which each node of the mesh had a dot.
        seen: number of markers that were seen in the last frame that showed any.
        roughness: median second difference of displacements then, in spacings.
        motion_pitches: motion that 95 % of the seen markers stayed below, in spacings; inf after a bad frame.
        is_locked: the last frame was a good one.
        is_open: the view moved, unseen or too fast, so that the numbers may have slipped along the lattice,
            and neither outline nor irregularities have told since.
        look: (m, 2) area and contrast of each marker's dot against the adjacent ones'; NaN: not known.
        unlike: (2,) mean difference of a frame's looks from that.
        learnt: number of frames that looks were learnt from.
        lost: fewer or faster than windows can follow.
    """

    mesh: LatticeGraph
    scratch: Scratch
    place_px: Points2
    expected_px: Points2
    frames_unseen: Counts
    presence: np.ndarray
    seen: int
    roughness: float
    motion_pitches: float
    is_locked: bool
    is_open: bool
    look: np.ndarray
    unlike: np.ndarray
    learnt: int
    lost: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerTracker:
    """Which dot is which marker, for any layout.

    Attributes:
        damping: part of the last motion that is expected again.
        window_motion_pitches: windows are asked for while motion stays below this, per frame.
        window_share: and while this share of the markers is seen.
        least_share: below this share of the markers the status is few_markers.
        roi_px: x, y, width, height of the part of the image in which dots are looked for; None: all of it.
    """

    damping: float = 0.5
    window_motion_pitches: float = 0.27
    window_share: float = 0.97
    least_share: float = 0.5
    roi_px: Roi | None = None

    def start(self, sensor: Sensor) -> MarkerTrackerState:
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
        return MarkerTrackerState(
            mesh=mesh,
            scratch=Scratch(len(mesh.rest_px)),
            place_px=place,
            expected_px=_known(mesh, place),
            frames_unseen=read_only(np.zeros(len(rest), dtype=np.int64)),
            presence=presence_of(mesh),
            seen=0,
            roughness=0.0,
            motion_pitches=np.inf,
            is_locked=False,
            is_open=False,
            look=read_only(np.full((len(rest), SIGNS), np.nan)),
            unlike=read_only(np.full(SIGNS, np.nan)),
            learnt=0,
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

    def step(
        self, state: MarkerTrackerState, detections: Detections
    ) -> tuple[MarkerTrackerState, TrackedGrid]:
        """Identifies the markers among the dots of the next frame."""
        past = Past(
            guess_px=state.expected_px,
            place_px=state.place_px,
            frames_unseen=state.frames_unseen,
            presence=state.presence,
            seen=state.seen,
            roughness=state.roughness,
            is_next=state.is_locked,
            is_open=state.is_open,
            look=state.look,
            unlike=state.unlike if state.learnt >= _LEAST_LEARNT else np.full(SIGNS, np.nan),
        )
        dots = (
            *(_owned(detections.centre_px), _owned(detections.covariance_px2)),
            *(_owned(detections.area_px2), _owned(detections.contrast)),
        )
        answer = identified(state.mesh, dots, past, state.scratch)
        if answer.found == 0:
            after, measured = _blind(state, answer), _nothing_measured(state.mesh.markers)
        else:
            is_good = detections.status is Status.OK
            after, measured = _moved(state, dots, answer, damping=self.damping, is_good=is_good)
        return after, self._grid(after, detections.status, answer, measured)

    def expected_px(self, state: MarkerTrackerState) -> Points2 | None:
        """Places (m, 2) in the next frame, NaN for those known to be missing; None asks for all dots."""
        is_fast = state.motion_pitches > self.window_motion_pitches
        is_sparse = state.seen < self.window_share * state.mesh.present
        return None if is_fast or is_sparse else state.expected_px

    def is_lost(self, state: MarkerTrackerState) -> bool:
        """Did the last frame show fewer markers than the one before, or move faster than windows follow?"""
        return state.lost

    def _grid(
        self, after: MarkerTrackerState, status: Status, answer: Identified, measured: Measured
    ) -> TrackedGrid:
        position, covariance, area, is_seen = (read_only(each) for each in measured)
        seen = after.seen if answer.found else 0
        if status is Status.OK and (answer.is_slipping or (seen and after.is_open)):
            status = Status.AMBIGUOUS_SHIFT
        if status is Status.OK and seen < self.least_share * after.mesh.present:
            status = Status.FEW_MARKERS
        return TrackedGrid(
            position_px=position,
            covariance_px2=covariance,
            is_seen=is_seen,
            frames_unseen=after.frames_unseen,
            area_px2=area,
            status=status,
        )


def _owned(array: np.ndarray) -> np.ndarray:
    """The array, or a copy: the kernels meet one type only, and are compiled once."""
    flags = array.flags
    return array if flags.writeable and flags.c_contiguous else np.array(array)


def _known(mesh: LatticeGraph, place_px: Points2) -> Points2:
    """Places (m, 2), NaN of markers that are known to be missing."""
    return read_only(np.where(mesh.is_present[:, None], place_px, np.nan))


def _nothing_measured(markers: int) -> Measured:
    return (
        np.full((markers, 2), np.nan),
        np.full((markers, 2, 2), np.nan),
        np.full(markers, np.nan),
        np.zeros(markers, dtype=bool),
    )


def _blind(state: MarkerTrackerState, answer: Identified) -> MarkerTrackerState:
    """The state after a frame in which no marker could be told: nothing is known of the motion."""
    return replace(
        state,
        expected_px=_known(state.mesh, state.place_px),
        frames_unseen=read_only(state.frames_unseen + 1),
        motion_pitches=np.inf,
        is_locked=False,
        is_open=answer.is_open,
        lost=True,
    )


def _moved(
    state: MarkerTrackerState, dots: Dots, answer: Identified, *, damping: float, is_good: bool
) -> tuple[MarkerTrackerState, Measured]:
    """The state after a frame that showed markers, and what it showed of them."""
    from manytouch.tracking.matching.registration import keep

    mesh = state.mesh
    markers = mesh.markers
    is_pause = state.learnt > _LEARNT_OFTEN and state.learnt % _LEARNT_EACH != 0
    is_lesson = is_good and not answer.is_open and not is_pause
    rate = max(_LEARNT, 1.0 / (state.learnt + 1)) if is_lesson else 0.0
    look, unlike = np.empty_like(state.look), np.empty_like(state.unlike)
    after = (
        np.empty((markers, 2)),
        np.empty((markers, 2)),
        np.empty_like(state.frames_unseen),
        np.empty_like(state.presence),
    )
    measured = (
        np.empty((markers, 2)),
        np.empty((markers, 2, 2)),
        np.empty(markers),
        np.empty(markers, dtype=bool),
    )
    motion, seen = keep(
        dots,
        answer.owner,
        (state.place_px, state.frames_unseen, state.presence),
        mesh.net,
        mesh.bounds_px,
        damping,
        state.scratch.for_dots(len(dots[0])),
        rate,
        (state.look, state.unlike, answer.unlike, look, unlike),
        after,
        measured,
    )
    place, expected, unseen, presence = (read_only(each) for each in after)
    return MarkerTrackerState(
        mesh=mesh,
        scratch=state.scratch,
        place_px=place,
        expected_px=expected,
        frames_unseen=unseen,
        presence=presence,
        seen=seen,
        roughness=answer.roughness,
        motion_pitches=motion,
        is_locked=True,
        is_open=answer.is_open,
        look=read_only(look) if is_lesson else state.look,
        unlike=read_only(unlike) if is_lesson else state.unlike,
        learnt=state.learnt + int(is_good),
        lost=seen < state.seen - slack(mesh) or motion > _WINDOW_LIMIT_PITCHES,
    ), measured
