"""Tracks the markers from frame to frame: in each frame every dot is assigned a marker, or none.

Only smoothness of the displacements is assumed. The last frame, the layout at rest and a vote on the motion
of the whole view are guesses, from which the identities are found and verified in each frame (`matching`). So
a wrong guess costs time, but causes no wrong identity, and the pattern is found again after frames without
it.
"""

from dataclasses import dataclass, field, replace
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from manytouch.compilation import plain
from manytouch.errors import SensorError
from manytouch.geometry.refraction import rest_px
from manytouch.tracking.held_markers import HeldMarkers, HeldMarkersState
from manytouch.tracking.lattice_graph import (
    EXTERIOR_HIDDEN,
    EXTERIOR_VISIBLE,
    MISSING,
    PRESENT,
    LatticeGraph,
    build_lattice_graph,
)
from manytouch.tracking.matching.match_frame import (
    APPEARANCE_QUANTITIES,
    FrameMatch,
    WorkspacePool,
    match_frame,
)
from manytouch.tracking.matching.records import Assignment, DotArrays, MatchingState
from manytouch.values import Detections, Layout, Roi, Sensor, Status, TrackedGrid
from manytouch.values.arrays import Counts, Points2, read_only

if TYPE_CHECKING:
    from manytouch.tracking.state_update import Measurements

_MOST_MOTION_SPACINGS = 0.3
"""After a larger motion this frame is searched again as a whole, since windows may miss dots. A choice: the
same value as `slow_motion` in `frame_checks`, and larger than `window_motion_pitches`, which applies to the
next frame."""
_LEAST_LEARNED = 4  # frames: an appearance learned from fewer is mostly noise
_LEARNING_RATE = 0.05  # least weight of a frame in the learned appearance: a choice
_LEARN_ALL, _LEARN_EVERY = 20, 4  # after 20 frames only every 4th is learned from, to save time: a choice
_WHOLE_DOT_RADII = 1.5  # a dot is wholly in the image if its centre is this far from the border: a choice
_COUNT_TOLERANCE = 0.25
"""Difference of the numbers of markers seen in two frames that may be by chance, over the root of the number
of markers. A choice: two standard deviations of the number seen if 1.6 % are hidden at random."""
_INITIAL_PRESENCE = {PRESENT: 0.95, MISSING: 0.01, EXTERIOR_VISIBLE: 0.003, EXTERIOR_HIDDEN: 0.3}
"""Assumed share of frames in which a node has a dot, before frames show it; choices: few markers are hidden,
few empty nodes have a false dot, and what lies beyond the image is not known."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerTrackerState:
    """What is kept between frames: m markers, N nodes of the lattice graph.

    Attributes:
        graph: of the layout.
        pool: workspace of the kernels; its content has no influence on results.
        position_px: (m, 2) where the markers were, or were predicted.
        expected_px: (m, 2) where they are expected in the next frame; NaN: known to be missing.
        frames_unseen: (m,).
        presence: (N,) share of recent frames in which each node had a dot.
        seen_count: number of markers seen in the last frame that was matched.
        roughness: median second difference of displacements then, in spacings.
        motion_spacings: motion that 95 % of the seen markers stayed below, in spacings; inf after a frame
            without a match.
        is_consecutive: the last frame was matched.
        is_ambiguous: whether identities may be shifted along the lattice: the view has moved unseen or too
            fast, and neither the outline nor irregularities of the pattern have shown the shift since.
        appearance: (m, 2) usual relative area and contrast of each marker's dot; NaN: not known.
        appearance_difference: (2,) usual mean difference of a frame's dots from that.
        learned_frames: number of frames that the appearance was learned from.
        held: which markers stayed where they were.
        needs_full_search: whether the last frame has to be searched again as a whole, since it showed fewer
            markers than the one before, or they moved farther than the windows reach.
    """

    graph: LatticeGraph
    pool: WorkspacePool
    position_px: Points2
    expected_px: Points2
    frames_unseen: Counts
    presence: np.ndarray
    seen_count: int
    roughness: float
    motion_spacings: float
    is_consecutive: bool
    is_ambiguous: bool
    appearance: np.ndarray
    appearance_difference: np.ndarray
    learned_frames: int
    held: HeldMarkersState
    needs_full_search: bool

    def for_matching(self) -> MatchingState:
        """The part that the kernels use; without the appearance if it was learned from too few frames."""
        is_learned = self.learned_frames >= _LEAST_LEARNED
        return MatchingState(
            position_px=self.position_px,
            frames_unseen=self.frames_unseen,
            presence=self.presence,
            seen_count=self.seen_count,
            roughness=self.roughness,
            is_consecutive=self.is_consecutive,
            is_ambiguous=self.is_ambiguous,
            appearance=self.appearance,
            appearance_difference=self.appearance_difference if is_learned else _unknown_difference(),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerTracker:
    """Assigns the dots of each frame to the markers of any layout.

    Attributes:
        damping: share of a marker's motion since the frame before that is expected again in the next one.
        window_motion_pitches: dots of the next frame are searched in windows around their expected positions
            only, if 95 % of the markers moved by at most this in a frame, in spacings of the pattern.
        window_share: least share of the markers that must be seen in a frame so that the next one is
            searched in windows only; as `least_share`, of those that are in the region at rest.
        least_share: least share of the markers that must be seen; below it the status is few_markers.
        roi_px: region of interest that is searched for dots, in pixels; None: the whole image.
        held_markers: notices compressed video.
    """

    damping: float = 0.5
    # a published name; windows reach about a radius of a dot, 0.25 pitches of designed sheets (ADR 12)
    window_motion_pitches: float = 0.27
    window_share: float = 0.97
    least_share: float = 0.5
    roi_px: Roi | None = None
    held_markers: HeldMarkers = field(default_factory=HeldMarkers)

    def start(self, sensor: Sensor) -> MarkerTrackerState:
        """The state before the first frame, with the layout's reference centres.

        These are `rest_px`, or the projection of `rest_mm`.

        Raises:
            SensorError: the sensor has no markers.
        """
        layout = sensor.layout
        if layout is None:
            raise SensorError(
                f"the sensor {sensor.name!r} has no markers to track: use a sensor file with [markers]"
            )
        rest = rest_px(sensor, layout)
        graph = build_lattice_graph(
            rest,
            layout.is_missing,
            row_column=layout.row_column,
            bounds_px=self._bounds(sensor, layout, rest),
        )
        position = read_only(np.array(rest, dtype=np.float64))
        initial_presence = np.array([_INITIAL_PRESENCE[kind] for kind in range(len(_INITIAL_PRESENCE))])
        return MarkerTrackerState(
            graph=graph,
            pool=WorkspacePool(len(graph.arrays.rest_px)),
            position_px=position,
            expected_px=_without_missing(graph, position),
            frames_unseen=read_only(np.zeros(len(rest), dtype=np.int64)),
            presence=read_only(initial_presence[graph.arrays.kind]),
            seen_count=0,
            roughness=0.0,
            motion_spacings=np.inf,
            is_consecutive=False,
            is_ambiguous=False,
            appearance=read_only(np.full((len(rest), APPEARANCE_QUANTITIES), np.nan)),
            appearance_difference=_unknown_difference(),
            learned_frames=0,
            held=self.held_markers.start(len(rest)),
            needs_full_search=False,
        )

    def _bounds(self, sensor: Sensor, layout: Layout, rest_px: Points2) -> tuple[float, float, float, float]:
        """Least x, y and largest x, y of the centres of dots that are wholly in the region of interest."""
        camera = sensor.camera
        x, y, w, h = self.roi_px or (0, 0, camera.width_px, camera.height_px)
        extent_px, extent_mm = (np.ptp(each, axis=0).max() for each in (rest_px, layout.rest_mm))
        px_per_mm = extent_px / extent_mm if extent_mm > 0 else 0.0
        margin = _WHOLE_DOT_RADII * px_per_mm * float(np.median(layout.radius_mm))
        return x - 0.5 + margin, y - 0.5 + margin, x + w - 0.5 - margin, y + h - 0.5 - margin

    def step(
        self, state: MarkerTrackerState, detections: Detections
    ) -> tuple[MarkerTrackerState, TrackedGrid]:
        """Identifies the markers among the dots of the next frame."""
        dots = DotArrays(
            _writable(detections.centre_px),
            _writable(detections.covariance_px2),
            _writable(detections.area_px2),
            _writable(detections.contrast),
        )
        before = state.for_matching()
        match = match_frame(state.graph, dots, state.expected_px, before, state.pool)
        status = detections.status
        if match.found == 0:
            after, measured = _state_without_match(state, match), None
        else:
            after, measured = self._updated(
                state,
                before,
                dots,
                match,
                is_good=status is Status.OK,
                is_predicted=detections.is_predicted,
            )
        if status is Status.OK and (match.is_shift_unresolved or (match.found > 0 and after.is_ambiguous)):
            status = Status.AMBIGUOUS_SHIFT
        seen = after.seen_count if match.found else 0
        if status is Status.OK and seen < self.least_share * after.graph.expected_count:
            status = Status.FEW_MARKERS
        return after, _tracked_grid(after, measured, status)

    def expected_px(self, state: MarkerTrackerState) -> Points2 | None:
        """Expected positions (m, 2) in the next frame, NaN: known to be missing; None: search everywhere."""
        is_fast = state.motion_spacings > self.window_motion_pitches
        is_sparse = state.seen_count < self.window_share * state.graph.expected_count
        return None if is_fast or is_sparse else state.expected_px

    def needs_full_search(self, state: MarkerTrackerState) -> bool:
        """Whether the last frame has to be searched again as a whole; see `MarkerTrackerState`."""
        return state.needs_full_search

    def resume(self, started: MarkerTrackerState, before: MarkerTrackerState) -> MarkerTrackerState:
        """The state `before`, which also holds after a change of parameters, since it contains none."""
        return before

    def _updated(
        self,
        state: MarkerTrackerState,
        before: MatchingState,
        dots: DotArrays,
        match: FrameMatch,
        *,
        is_good: bool,
        is_predicted: bool,
    ) -> tuple[MarkerTrackerState, "Measurements"]:
        """The state after a frame that showed markers, and what was measured of them."""
        from manytouch.tracking.state_update import Measurements, NextState, update_state

        graph = state.graph
        markers = graph.marker_count
        workspace = state.pool.get(len(dots.centre_px))
        arrays = NextState(
            position_px=np.empty((markers, 2)),
            expected_px=np.empty((markers, 2)),
            frames_unseen=np.empty_like(state.frames_unseen),
            presence=np.empty_like(state.presence),
        )
        measured = Measurements(
            position_px=np.empty((markers, 2)),
            covariance_px2=np.empty((markers, 2, 2)),
            area_px2=np.empty(markers),
            is_seen=np.empty(markers, dtype=bool),
        )
        assignment = Assignment(match.dot, workspace.position_px, workspace.is_used)
        motion, seen = update_state(
            plain(dots),
            plain(assignment),
            plain(before),
            plain(graph.arrays),
            self.damping,
            plain(workspace),
            plain(arrays),
            plain(measured),
        )
        appearance, difference = _learn_appearance(state, dots, match, is_good=is_good)
        few = seen < state.seen_count - _count_tolerance(graph)
        return MarkerTrackerState(
            graph=graph,
            pool=state.pool,
            position_px=read_only(arrays.position_px),
            expected_px=read_only(arrays.expected_px),
            frames_unseen=read_only(arrays.frames_unseen),
            presence=read_only(arrays.presence),
            seen_count=seen,
            roughness=match.roughness,
            motion_spacings=motion,
            is_consecutive=True,
            is_ambiguous=match.is_ambiguous,
            appearance=appearance,
            appearance_difference=difference,
            learned_frames=state.learned_frames + int(is_good),
            held=self.held_markers.step(
                state.held, measured.position_px, measured.covariance_px2, is_predicted=is_predicted
            ),
            needs_full_search=few or motion > _MOST_MOTION_SPACINGS,
        ), measured


def _writable(array: np.ndarray) -> np.ndarray:
    """The array, or a copy: the kernels are compiled for writable, contiguous arrays only."""
    flags = array.flags
    return array if flags.writeable and flags.c_contiguous else np.array(array)


def _unknown_difference() -> np.ndarray:
    return read_only(np.full(APPEARANCE_QUANTITIES, np.nan))


def _count_tolerance(graph: LatticeGraph) -> float:
    """Number of markers by which frames may differ by chance; much less than a line of the pattern."""
    return 1.0 + _COUNT_TOLERANCE * sqrt(graph.expected_count)


def _without_missing(graph: LatticeGraph, position_px: Points2) -> Points2:
    """Positions (m, 2), NaN of markers that are known to be missing."""
    return read_only(np.where(graph.is_present[:, None], position_px, np.nan))


def _state_without_match(state: MarkerTrackerState, match: FrameMatch) -> MarkerTrackerState:
    """The state after a frame in which no marker was identified: the motion is not known."""
    return replace(
        state,
        expected_px=_without_missing(state.graph, state.position_px),
        frames_unseen=read_only(state.frames_unseen + 1),
        motion_spacings=np.inf,
        is_consecutive=False,
        is_ambiguous=match.is_ambiguous,
        needs_full_search=True,
    )


def _learn_appearance(
    state: MarkerTrackerState, dots: DotArrays, match: FrameMatch, *, is_good: bool
) -> tuple[np.ndarray, np.ndarray]:
    """The appearance (m, 2) after a frame and the usual difference (2,) from it: running means."""
    from manytouch.tracking.matching.relative_appearance import running_mean, update_appearance

    is_skipped = state.learned_frames > _LEARN_ALL and state.learned_frames % _LEARN_EVERY != 0
    if not is_good or match.is_ambiguous or is_skipped:
        return state.appearance, state.appearance_difference
    rate = max(_LEARNING_RATE, 1.0 / (state.learned_frames + 1))
    appearance = np.empty_like(state.appearance)
    update_appearance(match.dot, plain(dots), plain(state.graph.arrays), state.appearance, rate, appearance)
    usual, now = state.appearance_difference.tolist(), match.appearance_difference.tolist()
    difference = [running_mean(a, b, rate) for a, b in zip(usual, now, strict=True)]
    return read_only(appearance), read_only(np.array(difference))


def _tracked_grid(after: MarkerTrackerState, measured: "Measurements | None", status: Status) -> TrackedGrid:
    """What is output of a frame; no marker is seen where nothing was measured."""
    markers = after.graph.marker_count
    if measured is None:
        return TrackedGrid(
            position_px=read_only(np.full((markers, 2), np.nan)),
            covariance_px2=read_only(np.full((markers, 2, 2), np.nan)),
            is_seen=read_only(np.zeros(markers, dtype=bool)),
            frames_unseen=after.frames_unseen,
            area_px2=read_only(np.full(markers, np.nan)),
            status=status,
            is_compressed=after.held.is_compressed,
        )
    return TrackedGrid(
        position_px=read_only(measured.position_px),
        covariance_px2=read_only(measured.covariance_px2),
        is_seen=read_only(measured.is_seen),
        frames_unseen=after.frames_unseen,
        area_px2=read_only(measured.area_px2),
        status=status,
        is_compressed=after.held.is_compressed,
    )
