"""From frames to readings: detection, tracking and estimation in a row.

Each stage is a frozen dataclass of its parameters. `start(sensor)` returns the state of a stage before the
first frame; `step(state, input)` returns the next state and the output, and changes nothing else. So any
frame of any recording can be computed again with the same bits.
"""

import time
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from manytouch.errors import ArgumentError, require_type
from manytouch.geometry.views.merging import merged_detections, merged_grid
from manytouch.geometry.views.view_sensors import view_sensors
from manytouch.values import (
    Command,
    Comparison,
    Contacts,
    Detections,
    Frame,
    Health,
    Interpolation,
    OutputState,
    Reading,
    Sensor,
    Status,
    Surface,
    TrackedGrid,
)
from manytouch.values.arrays import Points2, read_only


@runtime_checkable
class Sink(Protocol):
    """A receiver of readings."""

    def write(self, reading: Reading) -> None:
        """Take the reading of the next frame."""

    def close(self) -> None:
        """Finish; called once, also after an error."""


@runtime_checkable
class Output(Sink, Protocol):
    """A sink that passes readings on to other programs, without ever waiting for them."""

    @property
    def states(self) -> tuple[OutputState, ...]:
        """What was sent to each program and dropped so far; safe from any thread."""


@runtime_checkable
class Detector(Protocol):
    """First stage: finds the dots of an image. Its state has buffers and what the first frames showed."""

    def start(self, sensor: Sensor) -> Any:
        """State before the first frame."""

    def step(self, state: Any, frame: Frame, expected_px: Points2 | None) -> tuple[Any, Detections]:
        """Detect the dots of a frame.

        Args:
            state: from `start` or the step before.
            frame: its image may be None. `track_frames` passes a frame a second time, as a whole, where
                tracking is lost; the state is then that after the first search of the same frame.
            expected_px: (m, 2) places to search; None searches the whole image.
        """


@runtime_checkable
class Tracker(Protocol):
    """Second stage: assigns dots to markers."""

    def start(self, sensor: Sensor) -> Any:
        """State before the first frame."""

    def step(self, state: Any, detections: Detections) -> tuple[Any, TrackedGrid]:
        """Assign the dots of a frame to the markers of the layout."""

    def expected_px(self, state: Any) -> Points2 | None:
        """Expected places (m, 2) in the next frame; None requests a search of the whole image."""

    def needs_full_search(self, state: Any) -> bool:
        """Whether the frame that led to this state has to be searched again as a whole."""

    def resume(self, started: Any, before: Any) -> Any:
        """State to continue with after parameters have changed: identities are kept.

        Args:
            started: from `start` of this stage, for the same sensor.
            before: of a stage of the same type with other parameters.
        """


@runtime_checkable
class Estimator(Protocol):
    """Third stage: computes surface and contacts from marker positions."""

    def start(self, sensor: Sensor) -> Any:
        """State before the first frame."""

    def step(self, state: Any, grid: TrackedGrid) -> tuple[Any, Surface, Contacts]:
        """Estimate surface and contacts of a frame."""


@runtime_checkable
class Controls(Protocol):
    """What a running session offers to the viewer; safe from any thread, never blocks."""

    @property
    def sensor(self) -> Sensor:
        """The sensor in use; it has been replaced whenever `Health.sensor_version` has grown."""

    def send(self, command: Command) -> None:
        """Request something; it is carried out between two frames. A refusal becomes a note in `health`.

        At most one command of each kind (`values.commands.command_kind`) waits: a newer one replaces it
        without a note. While `MAX_WAITING` commands wait (`session.commands.command_queue`), one of a further
        kind is dropped, also without a note.
        """

    def health(self) -> Health:
        """State of source, session and recording."""

    def comparison(self, frame_index: int) -> Comparison | None:
        """What to show with the estimate of a frame: the ground truth, or what was recorded."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrackedFrame:
    """A frame after detection and tracking.

    Attributes:
        frame, detections, grid: as in `Reading`.
        milliseconds: computing time of both stages.
    """

    frame: Frame
    detections: Detections
    grid: TrackedGrid
    milliseconds: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FrontState:
    """States of detection and tracking between two frames.

    Attributes:
        detection: None: detection starts, and searches the whole of its first image.
        tracking: of the tracker.
    """

    detection: Any
    tracking: Any


def track_frames(
    detect: Detector,
    track: Tracker,
    frames: Iterable[Frame],
    sensor: Sensor,
    state: FrontState | None = None,
) -> Generator[TrackedFrame, None, FrontState]:
    """Detect and track the markers of each frame, in order.

    A frame on which tracking is lost is searched once more as a whole. `Detector.step` is then called twice
    for one frame: the second time with the state after the first search. `Tracker.step` is called twice with
    its state before the frame. Several views of one sheet are tracked one by one, and their markers merged.

    Args:
        detect, track: the stages.
        frames: in order.
        sensor: with a layout.
        state: to continue from; None: both stages start.

    Returns:
        The states after the last frame; of several views, tuples of them.
    """
    several = view_sensors(sensor) if sensor.camera.views else ()
    if several:
        states = _states_of_views(state, len(several))
        views = [
            _TrackedView(detect, track, view.sensor, each) for view, each in zip(several, states, strict=True)
        ]
    else:
        views = [_TrackedView(detect, track, sensor, state)]
    for frame in frames:
        begin_s = time.perf_counter()
        if several:
            parts = [view.step(each.picture(frame)) for view, each in zip(views, several, strict=True)]
            detections = merged_detections(several, [found for found, _ in parts])
            assert sensor.layout is not None
            grid = merged_grid(several, [each for _, each in parts], len(sensor.layout.rest_mm))
        else:
            detections, grid = views[0].step(frame)
        _protect(detections)
        if grid.timestamp_ns != frame.timestamp_ns:
            grid = replace(grid, timestamp_ns=frame.timestamp_ns)
        spent_ms = 1e3 * (time.perf_counter() - begin_s)
        yield TrackedFrame(frame=frame, detections=detections, grid=grid, milliseconds=spent_ms)
    if not several:
        return views[0].state
    after = [view.state for view in views]
    return FrontState(
        detection=tuple(each.detection for each in after), tracking=tuple(each.tracking for each in after)
    )


def _require_frame(frame: Frame) -> Frame:
    require_type("one of the frames", frame, Frame, "manytouch.Frame(index=, timestamp_ns=, camera=, image=)")
    return frame


def _protect(dots: Detections) -> None:
    """Make the arrays of dots read-only; the kernels that find and assign them take writable ones."""
    for array in (dots.centre_px, dots.covariance_px2, dots.area_px2, dots.contrast):
        read_only(array)


def _states_of_views(state: FrontState | None, count: int) -> list[FrontState | None]:
    if state is None:
        return [None] * count
    detection = (None,) * count if state.detection is None else state.detection
    return [
        FrontState(detection=one, tracking=other)
        for one, other in zip(detection, state.tracking, strict=True)
    ]


class _TrackedView:
    """Detection and tracking in the pictures of one camera.

    Attributes:
        state: of both stages after the last picture.
    """

    def __init__(self, detect: Detector, track: Tracker, sensor: Sensor, state: FrontState | None) -> None:
        self._detect, self._track = detect, track
        self._is_new = state is not None and state.detection is None
        self.state = FrontState(
            detection=detect.start(sensor) if state is None or self._is_new else state.detection,
            tracking=track.start(sensor) if state is None else state.tracking,
        )

    def step(self, frame: Frame) -> tuple[Detections, TrackedGrid]:
        """Dots and markers of the next picture."""
        detect, track, before = self._detect, self._track, self.state.tracking
        expected_px = None if self._is_new else track.expected_px(before)
        self._is_new = False
        detection_state, detections = detect.step(self.state.detection, frame, expected_px)
        tracking_state, grid = track.step(before, detections)
        if expected_px is not None and track.needs_full_search(tracking_state):
            detection_state, detections = detect.step(detection_state, frame, None)
            tracking_state, grid = track.step(before, detections)
        self.state = FrontState(detection=detection_state, tracking=tracking_state)
        return detections, grid


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pipeline:
    """The three stages of a method, in order, and how the surfaces are evaluated between the markers.

    `track_frames` and `estimate_readings` are its two halves. They share no state, so each may run in a
    thread of its own.

    Attributes:
        detect, track, estimate: the stages.
        interpolation: of the surfaces; None: as the estimator states.
    """

    detect: Detector
    track: Tracker
    estimate: Estimator
    interpolation: Interpolation | None = None

    def __repr__(self) -> str:
        stages = ", ".join(type(stage).__name__ for stage in (self.detect, self.track, self.estimate))
        return f"Pipeline({stages})"

    def run(self, frames: Iterable[Frame], sensor: Sensor) -> Iterator[Reading]:
        """One reading per frame, in order.

        Args:
            frames: a source, or other frames in order.
            sensor: with a layout.

        Raises:
            ArgumentError: something else was given, such as the path of a video, or images.
        """
        if isinstance(frames, str | Path) or not isinstance(frames, Iterable):
            kind = type(frames).__name__
            raise ArgumentError(f"frames are of type {kind}: give a source (manytouch.open_source) or frames")
        require_type("the sensor", sensor, Sensor, "a Sensor (manytouch.load_sensor reads one)")
        return self.estimate_readings(self.track_frames(map(_require_frame, frames), sensor), sensor)

    def has_stages_of(self, other: "Pipeline") -> bool:
        """Whether the three stages are those of another pipeline, which then differs in the interpolation."""
        mine, others = (self.detect, self.track, self.estimate), (other.detect, other.track, other.estimate)
        return all(one is another for one, another in zip(mine, others, strict=True))

    def track_frames(
        self, frames: Iterable[Frame], sensor: Sensor, state: FrontState | None = None
    ) -> Generator[TrackedFrame, None, FrontState]:
        """Detect and track the markers of each frame, in order; see the function `track_frames`."""
        return track_frames(self.detect, self.track, frames, sensor, state)

    def estimate_readings(
        self, tracked: Iterable[TrackedFrame], sensor: Sensor, state: Any = None
    ) -> Generator[Reading, None, Any]:
        """Estimate surface and contacts of each tracked frame, in order.

        Args:
            tracked: the frames.
            sensor: that they show.
            state: what `estimate.start` returns for this sensor, or the state to continue from; None: it is
                computed first.

        Returns:
            The state after the last frame.
        """
        if state is None:
            state = self.estimate.start(sensor)
        for each in tracked:
            begin_s = time.perf_counter()
            state, surface, contacts = self.estimate.step(state, each.grid)
            if sensor.rest_is_doubtful and contacts.status is Status.OK:
                contacts = replace(contacts, status=Status.REST_DOUBTFUL)
            if self.interpolation is not None:
                surface = replace(surface, interpolation=self.interpolation)
            yield Reading(
                frame=each.frame,
                detections=each.detections,
                grid=each.grid,
                surface=surface,
                contacts=contacts,
                milliseconds=each.milliseconds + 1e3 * (time.perf_counter() - begin_s),
            )
        return state
