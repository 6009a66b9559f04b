"""Playback of a recording, a video or images: stored readings, or frames that are processed (again)."""

import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.pipeline import Output, Pipeline, Sink
from manytouch.session.commands.background_preparation import BackgroundPreparation
from manytouch.session.commands.command_queue import CommandQueue
from manytouch.session.commands.continuation import Setup
from manytouch.session.commands.frame_processor import FrameProcessor
from manytouch.session.methods import (
    METHODS,
    choices_of,
    parameter_info,
    parameters_of,
    pipeline_for,
    require_method_for,
    with_parameter,
)
from manytouch.session.pacing import LONGEST_SLEEP_S, Pace
from manytouch.session.prepare import Job, prepare
from manytouch.session.run import Observer, StopCondition
from manytouch.session.throughput import ThroughputMeter
from manytouch.sinks.files.sensor_description import layout_of
from manytouch.sources import open_source
from manytouch.sources.files.frame_timeline import frame_timeline
from manytouch.sources.source import Timeline
from manytouch.values import (
    Command,
    Comparison,
    Health,
    Pause,
    Play,
    Reading,
    Resume,
    Seek,
    Sensor,
    Tune,
    UseMethod,
)

LONG_JUMP = 100
"""Frames processed on the way to a place that is sought, from which on a sentence explains the wait."""


class Playback:
    """Readings of a recording at its own pace, with a timeline, controlled by commands.

    It is both `manytouch.session.Readings`, for `run`, and `manytouch.pipeline.Controls`, for the viewer.
    Without method and sensor the stored readings are shown, and frames without one are omitted. With one of
    them, or once a method is selected, every frame is processed again, and what was recorded is the
    comparison. Contacts follow from the frames before: a place that is sought is reached from the last kept
    state on, and frames that were not processed yet are shown on the way, as fast as they can be.
    """

    def __init__(
        self,
        given: Path | Job,
        *,
        method: str | None = None,
        sensor: str | Path | Sensor | None = None,
        stays: bool = False,
        shown: ThroughputMeter | None = None,
    ) -> None:
        """Open a recording, a video or images.

        Args:
            given: the file, or a job of it. Frames of a job, and of a file without readings, are processed.
            method, sensor: to process it again with; of a job, those of the job are used.
            stays: wait at the end for a `Seek` command, instead of ending.
            shown: meter of the session that has shown the file already; the playback begins with that wait.

        Raises:
            SourceError: it does not exist, or its frames cannot be read in any order.
            ManytouchError: see `prepare`.
        """
        source = given.source if isinstance(given, Job) else open_source(given)
        timeline = source.capabilities.seek or frame_timeline(source)
        if timeline is None:
            name = given.text if isinstance(given, Job) else str(given)
            raise SourceError(
                f"{name!r} has no timeline: manytouch run shows cameras and the simulated sensor"
            )
        self._timeline: Timeline = timeline
        is_stored = source.capabilities.seek is not None and not isinstance(given, Job)
        self._is_processed = method is not None or sensor is not None or not is_stored
        known = method or (timeline.method if timeline.method in METHODS else None)
        self._job = given if isinstance(given, Job) else prepare(source, sensor=sensor, method=known)
        job = self._job
        self._setup = Setup(pipeline=job.pipeline, sensor=job.sensor, method=job.method, version=0)
        self._method = job.method if self._is_processed else known or timeline.method
        self._stays = stays
        self._commands = CommandQueue()
        self._setups: BackgroundPreparation[Setup] = BackgroundPreparation(self._warm_up, self._refuse)
        self._meter = ThroughputMeter() if shown is None else shown
        self._pace = Pace()
        self._is_held = False
        self._place = 0 if shown is None else len(timeline) - 1
        self._sought: int | None = None
        self._continues = False
        self._processor = FrameProcessor()
        self._is_at_end = shown is not None
        self._outputs: tuple[Output, ...] = ()

    @property
    def sensor(self) -> Sensor:
        """The recorded sensor, or the given one."""
        return self._job.sensor

    @property
    def frame_count(self) -> int:
        """Number of recorded frames."""
        return len(self._timeline)

    @property
    def own_sinks(self) -> tuple[Sink, ...]:
        """The outputs, and the meter of rate and latency."""
        return *self._outputs, self._meter

    def attach(self, outputs: Sequence[Output]) -> None:
        """Pass readings to other programs too; call it before the playback is run."""
        self._outputs = (*self._outputs, *outputs)

    def send(self, command: Command) -> None:
        """Request something; it is carried out between two frames."""
        self._commands.send(command)

    def comparison(self, frame_index: int) -> Comparison | None:
        """What was recorded of a frame, where it is processed again with the same unit of length."""
        recorded_sensor = self._job.source.capabilities.sensor
        if not self._is_processed or recorded_sensor is None:
            return None
        if recorded_sensor.length_unit != self.sensor.length_unit:
            return None
        recorded = self._timeline.stored_reading(frame_index)
        if recorded is None:
            return None
        is_alike = len(recorded.surface.displacement_mm) == len(layout_of(self.sensor).rest_mm)
        surface = recorded.surface if is_alike else None
        return Comparison(name="recorded", surface=surface, contacts=recorded.contacts)

    def health(self) -> Health:
        """State of the playback."""
        median_ms, p99_ms = self._meter.latency_ms
        layout = self.sensor.layout
        return Health(
            is_running=not (self._is_held or self._is_at_end),
            source_state=self._timeline.warning or "ok",
            readings_per_s=self._meter.readings_per_s,
            latency_ms_p50=median_ms,
            latency_ms_p99=p99_ms,
            frames=self._meter.frames,
            dropped=0,
            markers_seen=self._meter.markers_seen,
            markers=0 if layout is None else int((~layout.is_missing).sum()),
            method=self._method,
            methods=METHODS,
            parameters=parameters_of(self._setup.pipeline),
            choices=choices_of(self._setup.pipeline),
            parameter_info=parameter_info(self._setup.method),
            notes=self._commands.notes,
            frame=self._place,
            frame_count=len(self._timeline),
            is_preparing=self._setups.is_busy,
            outputs=tuple(state for output in self._outputs for state in output.states),
        )

    def start(self, observer: Observer, stop: StopCondition) -> Generator[Reading, None, None]:
        """Readings until the end of the recording; with `stays` until `stop` returns True.

        Raises:
            ManytouchError: the frames cannot be processed with the given method and sensor.
        """
        self._commands.on_note = observer.on_message
        if self._timeline.warning is not None:
            self._commands.note(self._timeline.warning)
        if self._is_processed:
            self._setup = self._warm_up(self._setup)
        begin = self._next_begin(stop) if self._is_at_end else 0
        while begin is not None:
            yield from self._readings(begin, stop)
            begin = self._next_begin(stop)

    def close(self) -> None:
        """Release the recording."""
        self._setups.close()
        self._job.close()

    def _next_begin(self, stop: StopCondition) -> int | None:
        """The place to continue at; None at the end."""
        self._is_at_end = True
        while not stop():
            self._serve_commands()
            if self._sought is not None:
                begin, self._sought = self._sought, None
                self._is_at_end = False
                return begin
            if not self._stays:
                return None
            time.sleep(LONGEST_SLEEP_S)
        return None

    def _readings(self, begin: int, stop: StopCondition) -> Iterator[Reading]:
        """Readings from a place on, until the end or until another place is sought."""
        if self._is_processed:
            yield from (_arrived(reading) for reading in self._before(begin, stop))
        self._pace.reset()
        for place in self._places(begin, stop):
            if self._is_processed:
                yield _arrived(self._processor.step(self._timeline.frame(place)))
            elif (reading := self._timeline.reading(place)) is not None:
                yield _arrived(self._processor.take_stored(reading))

    def _before(self, begin: int, stop: StopCondition) -> Iterator[Reading]:
        """Process the frames before a place from which its reading follows; give those that are new."""
        first = self._processor.begin(self._setup, begin, continues=self._continues)
        self._continues = False
        if begin - first >= LONG_JUMP:
            self._commands.note(
                f"frames {first} to {begin - 1} are processed first: contacts follow from the frames before"
            )
        for place in range(first, begin):
            self._serve_commands()
            if self._sought is not None and self._continues:
                self._sought = begin
            if self._sought is not None or stop():
                return
            frame, is_new = self._timeline.frame(place), self._processor.is_new(place)
            reading = self._processor.step(frame)
            if is_new:
                self._place = place
                yield reading

    def _places(self, begin: int, stop: StopCondition) -> Iterator[int]:
        """Places when they are due. The first comes at once, also while the playback is held."""
        for place in range(begin, len(self._timeline)):
            self._serve_commands()
            while self._is_held and place > begin and self._sought is None and not stop():
                self._pace.reset()
                time.sleep(LONGEST_SLEEP_S)
                self._serve_commands()
            if self._sought is not None or stop():
                return
            self._pace.wait_for(self._timeline.timestamp_ns(place), stop)
            self._place = place
            yield place

    def _serve_commands(self) -> None:
        """Carry out the commands that wait, and continue with the method that is ready, if there is one."""
        self._commands.drain(self._carry_out)
        setup = self._setups.take()
        if setup is not None:
            self._setup, self._method, self._is_processed = setup, setup.method, True
            if self._sought is None:
                self._sought, self._continues = self._place, True
            self._commands.note(f"frames are processed again with method {setup.method}")

    def _seek(self, place: int) -> None:
        self._sought, self._continues = place, False

    def _request(self, *, pipeline: Pipeline, method: str) -> None:
        """Process the frames again with another setup once it is ready."""
        self._setups.request(replace(self._setup, pipeline=pipeline, method=method, estimation=None))

    def _warm_up(self, setup: Setup) -> Setup:
        """Process two frames with a setup and start its estimation.

        Raises:
            ManytouchError: it cannot.
        """
        job = replace(self._job, pipeline=setup.pipeline, method=setup.method)
        return replace(setup, estimation=job.warm_up(self._commands.note))

    def _refuse(self, reason: str) -> None:
        self._commands.note(f"not changed: {reason}")

    def _carry_out(self, command: Command) -> None:
        match command:
            case Resume():
                self._is_held = False
                if self._is_at_end and self._sought is None:
                    self._seek(0)
            case Pause():
                self._is_held = True
            case Seek(frame=frame):
                if not 0 <= frame < len(self._timeline):
                    raise SourceError(
                        f"there is no frame {frame}: choose one of 0 to {len(self._timeline) - 1}"
                    )
                self._seek(frame)
            case Play(speed=speed):
                if not 0.01 <= speed <= 100.0:
                    raise SourceError(f"the speed must be between 0.01 and 100, not {speed:g}")
                self._pace.speed = speed
                self._pace.reset()
            case UseMethod(method=method):
                require_method_for(self.sensor, method)
                if self._setups.requested() or not self._is_processed or method != self._method:
                    self._request(pipeline=pipeline_for(method), method=method)
            case Tune(parameter=parameter, value=value):
                newest = self._setups.requested() or self._setup
                pipeline = with_parameter(newest.pipeline, parameter, value)
                if pipeline != newest.pipeline:
                    self._request(pipeline=pipeline, method=newest.method)
            case _:
                self._commands.note(f"{type(command).__name__} is not possible with a recording")


def _arrived(reading: Reading) -> Reading:
    """The reading of a frame that is shown now."""
    return replace(reading, frame=replace(reading.frame, arrived_ns=time.monotonic_ns()))
