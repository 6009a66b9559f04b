"""From frames to readings: detection, tracking, estimation, one after the other.

Each stage is a frozen dataclass of its parameters. `start(sensor)` gives what it must keep between
frames, `step` takes that and the frame's value and hands both on, so any frame of any recording can
be computed again with the same bits.
"""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from manytouch.values import (
    Command,
    Comparison,
    Contacts,
    Detections,
    Frame,
    Health,
    Reading,
    Sensor,
    Surface,
    TrackedGrid,
)
from manytouch.values.arrays import Points2


@runtime_checkable
class Source(Protocol):
    """Where frames come from; all sources look alike."""

    def __iter__(self) -> Iterator[Frame]: ...


@runtime_checkable
class Sink(Protocol):
    """Where readings go."""

    def write(self, reading: Reading) -> None: ...

    def close(self) -> None: ...


@runtime_checkable
class Detect(Protocol):
    """Finds dots. Its state is scratch memory that is kept from frame to frame, not knowledge."""

    def start(self, sensor: Sensor) -> Any: ...

    def step(self, state: Any, frame: Frame, expected_px: Points2 | None) -> tuple[Any, Detections]:
        """Dots of a frame; `expected_px` (m, 2) limits the search, None looks everywhere."""


@runtime_checkable
class Track(Protocol):
    """Tells which dot is which marker."""

    def start(self, sensor: Sensor) -> Any: ...

    def step(self, state: Any, detections: Detections) -> tuple[Any, TrackedGrid]: ...

    def expected_px(self, state: Any) -> Points2 | None:
        """Where the markers should be in the next frame; None asks for a search of the whole image."""

    def is_lost(self, state: Any) -> bool:
        """Should the frame that gave this state be searched again, everywhere?"""


@runtime_checkable
class Estimate(Protocol):
    """Tells the sheet's shape and what touches it."""

    def start(self, sensor: Sensor) -> Any: ...

    def step(self, state: Any, grid: TrackedGrid) -> tuple[Any, Surface, Contacts]: ...


@runtime_checkable
class Controls(Protocol):
    """What a running session offers to those who watch and steer it; safe from any thread, never blocks."""

    @property
    def sensor(self) -> Sensor:
        """The one in use; another one once `Health.sensor_version` has grown."""

    def send(self, command: Command) -> None:
        """Ask for something; it is done between two frames, and what cannot be done becomes a note."""

    def health(self) -> Health:
        """How it is doing."""

    def beside(self, frame_index: int) -> Comparison | None:
        """What to show beside the estimate of a frame: a simulated source's truth, or what was recorded."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrackedFrame:
    """A frame whose markers are known, and whose sheet is not yet.

    Attributes:
        frame, detections, grid: as in `Reading`.
        milliseconds: from the decoded frame to here.
    """

    frame: Frame
    detections: Detections
    grid: TrackedGrid
    milliseconds: float


def sights(detect: Detect, track: Track, frames: Iterable[Frame], sensor: Sensor) -> Iterator[TrackedFrame]:
    """Dots and markers of each frame, in order."""
    detecting = detect.start(sensor)
    tracking = track.start(sensor)
    for frame in frames:
        begun_s = time.perf_counter()
        before = tracking
        expected_px = track.expected_px(before)
        detecting, detections = detect.step(detecting, frame, expected_px)
        tracking, grid = track.step(before, detections)
        if expected_px is not None and track.is_lost(tracking):
            detecting, detections = detect.step(detecting, frame, None)
            tracking, grid = track.step(before, detections)
        spent_ms = 1e3 * (time.perf_counter() - begun_s)
        yield TrackedFrame(frame=frame, detections=detections, grid=grid, milliseconds=spent_ms)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pipeline:
    """The three stages in a row.

    `see` and `tell` are its two halves, which may run in two threads: what `see` remembers, `tell` does not
    need, and the other way round.
    """

    detect: Detect
    track: Track
    estimate: Estimate

    def run(self, frames: Iterable[Frame], sensor: Sensor) -> Iterator[Reading]:
        """One reading per frame, in order."""
        return self.tell(self.see(frames, sensor), sensor)

    def see(self, frames: Iterable[Frame], sensor: Sensor) -> Iterator[TrackedFrame]:
        """Dots and markers of each frame, in order."""
        return sights(self.detect, self.track, frames, sensor)

    def tell(self, sights: Iterable[TrackedFrame], sensor: Sensor) -> Iterator[Reading]:
        """Shape and contacts of each frame, in order."""
        estimating = self.estimate.start(sensor)
        for sight in sights:
            begun_s = time.perf_counter()
            estimating, surface, contacts = self.estimate.step(estimating, sight.grid)
            yield Reading(
                frame=sight.frame,
                detections=sight.detections,
                grid=sight.grid,
                surface=surface,
                contacts=contacts,
                milliseconds=sight.milliseconds + 1e3 * (time.perf_counter() - begun_s),
            )
