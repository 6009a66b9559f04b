"""The run loop: readings into sinks, with an observer, until they end or are stopped.

`process`, `run`, `view` and `demo` all use it. What differs between a file, a live session and a playback is
where their readings come from and at which pace: that is behind `Readings`.
"""

from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack
from types import NoneType
from typing import Protocol, runtime_checkable

from manytouch.errors import require_type
from manytouch.pipeline import Sink
from manytouch.values import Reading, Sensor

StopCondition = Callable[[], bool]
"""Returns True once a run shall end; called after each frame, and while none comes."""


OBSERVER = "an object with on_message, on_begin and on_reading, see manytouch.Observer"


@runtime_checkable
class Observer(Protocol):
    """An object that is notified of the progress of a run."""

    def on_message(self, sentence: str) -> None:
        """A sentence for the user, sent once."""

    def on_begin(self, sensor: Sensor, frame_count: int | None) -> None:
        """The sensor is determined, and the first frame is about to be processed.

        Args:
            sensor: in use, with its assumptions.
            frame_count: expected number of frames; None when not known.
        """

    def on_reading(self, reading: Reading) -> None:
        """All sinks have this reading."""


class NoObserver:
    """An observer that ignores everything."""

    def on_message(self, sentence: str) -> None:
        """Ignore it."""

    def on_begin(self, sensor: Sensor, frame_count: int | None) -> None:
        """Ignore it."""

    def on_reading(self, reading: Reading) -> None:
        """Ignore it."""


@runtime_checkable
class Readings(Protocol):
    """Something that produces readings: a `Job`, a `Live` session or a `Playback`. It can be run once."""

    @property
    def sensor(self) -> Sensor:
        """The sensor at the beginning."""

    @property
    def frame_count(self) -> int | None:
        """Expected number of readings; None when not known."""

    @property
    def own_sinks(self) -> Sequence[Sink]:
        """Sinks that belong to it; they get each reading after all others."""

    def start(self, observer: Observer, stop: StopCondition) -> Generator[Reading, None, None]:
        """Produce readings in order, at the pace of the source.

        Args:
            observer: gets its messages.
            stop: ends waiting for a frame; the end after a reading is left to the run loop.
        """

    def close(self) -> None:
        """Release the source; waiting for a frame ends."""


def run(
    readings: Readings,
    sinks: Sequence[Sink] = (),
    observer: Observer | None = None,
    stop: StopCondition | None = None,
) -> bool:
    """Write each reading to every sink, until there are no more or `stop` returns True.

    Whatever ends the run, the source is released and all sinks are closed, in this order, and an error is
    raised only after that.

    Args:
        readings: what produces them.
        sinks: get every reading, in this order.
        observer: notified of begin, readings and messages.
        stop: called after each frame.

    Returns:
        Whether the readings ended by themselves, not by `stop`.

    Raises:
        ArgumentError: something else was given.
        Exception: what source, pipeline or a sink raised.
    """
    require_type("the input of run", readings, Readings, "a job: manytouch.run(manytouch.prepare(source))")
    require_type("sinks", sinks, (list, tuple), "a list of sinks")
    for sink in sinks:
        require_type("a sink", sink, Sink, "an object with write(reading) and close()")
    require_type("the observer", observer, (Observer, NoneType), OBSERVER)
    require_type("stop", stop, (Callable, NoneType), "a function that returns whether to end")  # type: ignore[arg-type]
    watch = NoObserver() if observer is None else observer
    is_over = _never if stop is None else stop
    receivers = (*sinks, *readings.own_sinks)
    with ExitStack() as closing:
        for sink in reversed(receivers):
            closing.callback(sink.close)
        stream = readings.start(watch, is_over)
        closing.callback(stream.close)
        closing.callback(readings.close)
        watch.on_begin(readings.sensor, readings.frame_count)
        for reading in stream:
            for sink in receivers:
                sink.write(reading)
            watch.on_reading(reading)
            if is_over():
                break
    return not is_over()


def _never() -> bool:
    return False
