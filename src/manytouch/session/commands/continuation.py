"""What goes on when parameters change while a session runs: the identities of markers and of contacts."""

from collections.abc import Callable, Generator, Iterator
from typing import Any, TypeVar

from manytouch.estimation.contact_tracker import with_tracks_of
from manytouch.pipeline import FrontState, Pipeline
from manytouch.values import Sensor

Item = TypeVar("Item")
State = TypeVar("State")


def kept(stream: Generator[Item, None, State], keep: Callable[[State], object]) -> Iterator[Item]:
    """The items of a stream; its state after the last one is passed to `keep`."""
    keep((yield from stream))


def resumed_tracking(
    pipeline: Pipeline, sensor: Sensor, before: Pipeline, state: FrontState
) -> FrontState | None:
    """States of detection and tracking to continue with; None: the tracker is another, and starts.

    Detection starts again if one of its parameters has changed. Markers are identified from where they were.
    """
    track, was = pipeline.track, before.track
    if type(track) is not type(was):
        return None
    return FrontState(
        detection=state.detection if pipeline.detect is before.detect else None,
        tracking=state.tracking if track is was else track.resume(track.start(sensor), state.tracking),
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
