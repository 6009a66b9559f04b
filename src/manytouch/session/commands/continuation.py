"""What goes on when parameters change while a session runs: the identities of markers and of contacts."""

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

from manytouch.estimation.contact_tracker import with_tracks_of
from manytouch.geometry.views.view_sensors import view_sensors
from manytouch.pipeline import FrontState, Pipeline, TrackedFrame
from manytouch.session.commands.tare import TareTime
from manytouch.values import Sensor

Item = TypeVar("Item")
State = TypeVar("State")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Setup:
    """What processes the frames until a command replaces it; `note` is shown once it does.

    `estimation` is the state to begin with, computed before: it takes several frames' time. None: not yet.
    `tare` states when the reference of the sensor was taken; None: it is that of the beginning.
    """

    pipeline: Pipeline
    sensor: Sensor
    method: str
    version: int
    note: str = ""
    estimation: Any = None
    tare: TareTime | None = None

    def is_variant_of(self, other: "Setup") -> bool:
        """Whether only parameters differ, so that contacts go on."""
        return self.sensor is other.sensor and self.method == other.method

    def has_stages_of(self, other: "Setup") -> bool:
        """Whether nothing differs that has to be prepared."""
        return self.is_variant_of(other) and self.pipeline.has_stages_of(other.pipeline)


class Kept:
    """The state after the last frame of a setup."""

    def __init__(self) -> None:
        """None so far."""
        self.value: Any = None

    def keep(self, value: Any) -> None:
        """Take it."""
        self.value = value


def kept(stream: Generator[Item, None, State], keep: Callable[[State], object]) -> Iterator[Item]:
    """The items of a stream; its state after the last one is passed to `keep`."""
    keep((yield from stream))


def until_setup(stream: Iterator[Setup | TrackedFrame], following: list[Setup]) -> Iterator[TrackedFrame]:
    """Tracked frames up to the next setup, which is appended to `following`."""
    for item in stream:
        if isinstance(item, Setup):
            following.append(item)
            return
        yield item


def resumed_tracking(
    pipeline: Pipeline, sensor: Sensor, before: Pipeline, state: FrontState
) -> FrontState | None:
    """States of detection and tracking to continue with; None: the tracker is another, and starts.

    Detection starts again if one of its parameters has changed. Markers are identified from where they were.
    """
    track, was = pipeline.track, before.track
    if type(track) is not type(was):
        return None
    tracking = state.tracking
    if track is not was and sensor.camera.views:
        views = zip(view_sensors(sensor), tracking, strict=True)
        tracking = tuple(track.resume(track.start(view.sensor), each) for view, each in views)
    elif track is not was:
        tracking = track.resume(track.start(sensor), tracking)
    return FrontState(
        detection=state.detection if pipeline.detect is before.detect else None, tracking=tracking
    )


def resumed_estimation(pipeline: Pipeline, started: Any, before: Pipeline, state: Any) -> Any:
    """State of the estimation to continue with.

    Args:
        pipeline: with its parameters.
        started: its state for the same sensor, from `start`.
        before: with an estimator of the same type.
        state: its state after the last frame.
    """
    return state if pipeline.estimate is before.estimate else with_tracks_of(started, state)
