"""A source read at its own pace, while people watch and steer."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from manytouch.errors import ManytouchError
from manytouch.pipeline import Pipeline, Sink, TrackedFrame
from manytouch.session.background_iterator import BackgroundIterator
from manytouch.session.commands.command_queue import CommandQueue
from manytouch.session.commands.contact_id_offset import ContactIdOffset
from manytouch.session.commands.tare import TARE_FRAMES, tared
from manytouch.session.commands.tuning import parameters_of, tuned
from manytouch.session.methods import METHODS, pipeline_for
from manytouch.session.pacing import LONGEST_NAP_S, Pace
from manytouch.session.prepare import Job, Observer, close
from manytouch.session.recording import SessionRecorder
from manytouch.session.throughput import ThroughputMeter
from manytouch.sources.source import Device
from manytouch.values import (
    Command,
    Comparison,
    Frame,
    Health,
    Press,
    Reading,
    Record,
    Release,
    Sensor,
    Start,
    Stop,
    StopRecording,
    Tare,
    TrackedGrid,
    Truth,
    Tune,
    UseMethod,
)

AHEAD = 1  # frames whose markers are known and whose sheet is not


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Setup:
    """What reads the frames until somebody changes it."""

    pipeline: Pipeline
    sensor: Sensor
    method: str
    version: int


class Live:
    """A session: a job, its sinks, and the commands that steer it; `manytouch.pipeline.Controls`.

    Decoding, detection and tracking run in one thread, estimation and sinks in the one that calls `run`.
    A source that does not wait drops whole frames when reading is too slow; they are counted.
    """

    def __init__(self, job: Job, *, recordings: Path = Path()) -> None:
        """Prepare; nothing runs yet.

        Args:
            job: from `prepare`.
            recordings: folder for recordings that are begun without a name.
        """
        self._job = job
        self._wanted = Setup(pipeline=job.pipeline, sensor=job.sensor, method=job.method, version=0)
        self._present = self._wanted
        self._mailbox = CommandQueue()
        self._meter = ThroughputMeter()
        self._is_held = False
        self._is_over = threading.Event()
        self._dropped = 0
        self._next_index: int | None = None
        self._pace = Pace()
        self._taring: list[TrackedGrid] | None = None
        self._markers_seen = 0
        self._taping = SessionRecorder(job, recordings, self._mailbox.note)

    @property
    def sensor(self) -> Sensor:
        """The one in use."""
        return self._present.sensor

    def send(self, command: Command) -> None:
        """Ask for something; it is done between two frames."""
        self._mailbox.send(command)

    def beside(self, frame_index: int) -> Comparison | None:
        """What really happened in a frame of a simulated source."""
        tell = getattr(self._job.source, "truth", None)
        truth: Truth | None = None if tell is None else tell(frame_index)
        if truth is None:
            return None
        return Comparison(name="truth", surface=truth.surface, contacts=truth.contacts)

    def health(self) -> Health:
        """How it is doing."""
        setup, source = self._present, self._job.source
        middle, late = self._meter.latency_ms
        layout = setup.sensor.layout
        return Health(
            is_running=not self._is_held,
            source=source.status if isinstance(source, Device) else "ok",
            fps=self._meter.fps,
            latency_ms_p50=middle,
            latency_ms_p99=late,
            frames=self._meter.frames,
            dropped=self._dropped,
            markers_seen=self._markers_seen,
            markers=0 if layout is None else int((~layout.is_missing).sum()),
            method=setup.method,
            methods=METHODS,
            parameters=parameters_of(setup.pipeline),
            settings=source.settings if isinstance(source, Device) else (),
            recording=self._taping.name,
            notes=self._mailbox.notes,
            can_press=hasattr(source, "press"),
            sensor_version=setup.version,
        )

    def run(
        self,
        sinks: Sequence[Sink],
        *,
        record: Path | None = None,
        progress: Observer | None = None,
        stop: Callable[[], bool] | None = None,
    ) -> None:
        """Read until the source ends or `stop` says so; sinks are closed whatever happens.

        Args:
            sinks: shall see every reading, in this order.
            record: a recording of all of it.
            progress: told what happens, and every note.
            stop: asked after each frame, and while none comes.

        Raises:
            OutputError: the recording cannot be written.
        """
        with ExitStack() as closing:
            for sink in reversed(sinks):
                closing.callback(sink.close)
            closing.callback(close, self._job.source)
            if progress is not None:
                self._mailbox.say = progress.say
                progress.begin(self._job)
            self._job.warm_up()
            closing.callback(self._taping.end)
            if record is not None:
                self._record(record)
            stream = closing.enter_context(BackgroundIterator(self._seen(), ahead=AHEAD, stop=stop))
            closing.callback(self._end)
            for reading in self._told(iter(stream)):
                for sink in sinks:
                    sink.write(reading)
                self._taping.write(reading)
                self._meter.count(reading.frame.arrived_ns)
                self._markers_seen = int(reading.grid.is_seen.sum())
                if progress is not None:
                    progress.read(reading)
                if stop is not None and stop():
                    break

    def _end(self) -> None:
        self._is_over.set()
        close(self._job.source)

    def _told(self, stream: Iterator[Setup | TrackedFrame]) -> Iterator[Reading]:
        """Readings, in the calling thread."""
        continuity = ContactIdOffset()
        setup = next(stream, None)
        while isinstance(setup, Setup):
            self._present = setup
            following: list[Setup] = []
            continuity.begin()
            sights = _until_setup(stream, following)
            for reading in setup.pipeline.tell(sights, setup.sensor):
                yield continuity(reading)
            setup = following[0] if following else None

    def _seen(self) -> Iterator[Setup | TrackedFrame]:
        """Setups, and the markers of each frame with them, in the other thread."""
        while not self._is_over.is_set():
            setup = self._wanted
            yield setup
            for sight in setup.pipeline.see(self._frames(setup), setup.sensor):
                yield sight
                self._tare(sight.grid)

    def _frames(self, setup: Setup) -> Iterator[Frame]:
        """Frames, until somebody wants another setup."""
        is_live = self._job.source.is_live
        while not self._is_over.is_set():
            self._mailbox.obey(self._do)
            if self._wanted is not setup:
                return
            if self._is_held and not is_live:
                self._pace.reset()
                self._is_over.wait(LONGEST_NAP_S)
                continue
            frame = next(self._job.frames, None)
            if frame is None:
                self._is_over.set()
                return
            if is_live:
                self._count_dropped(frame)
                if not self._is_held:
                    yield frame
            else:
                yield self._paced(frame)

    def _count_dropped(self, frame: Frame) -> None:
        if self._next_index is not None and not self._is_held:
            self._dropped += frame.index - self._next_index
        self._next_index = frame.index + 1

    def _paced(self, frame: Frame) -> Frame:
        """The frame, held back until its time has come."""
        self._pace.wait_for(frame.timestamp_ns, self._is_over.is_set)
        self._taping.take(frame)
        return replace(frame, arrived_ns=time.monotonic_ns())

    def _do(self, command: Command) -> None:
        match command:
            case Start():
                self._is_held = False
            case Stop():
                self._is_held = True
            case Tare():
                self._taring = []
            case UseMethod(method=method):
                self._change(pipeline=pipeline_for(method, self._job.roi_px), method=method)
                self._mailbox.note(f"method {method}")
            case Tune(parameter=parameter, value=value):
                self._change(pipeline=tuned(self._wanted.pipeline, parameter, value))
                self._mailbox.note(f"{parameter} = {value:g}")
            case Record(path=path):
                self._record(path)
            case StopRecording():
                self._taping.end()
            case Press() | Release():
                self._press(command)
            case _:
                self._mailbox.note(f"{type(command).__name__} means nothing to a live source")

    def _record(self, path: Path | None) -> None:
        setup = self._wanted
        self._taping.begin(path, setup.sensor, setup.pipeline, setup.method)

    def _press(self, command: Press | Release) -> None:
        press = getattr(self._job.source, "press", None)
        if press is None:
            raise ManytouchError(f"{self._job.text} cannot be pressed from here; the simulated sensor can")
        press(command)

    def _tare(self, grid: TrackedGrid) -> None:
        """Gather frames at rest, and begin anew with them once they are enough."""
        if self._taring is None:
            return
        self._taring.append(grid)
        if len(self._taring) < TARE_FRAMES:
            return
        sensor = tared(self._wanted.sensor, self._taring)
        self._taring = None
        if sensor is None:
            self._mailbox.note("not tared: fewer than half of the markers are seen")
            return
        try:
            self._change(sensor=sensor, version=self._wanted.version + 1)
        except ManytouchError as error:
            self._mailbox.note(f"not tared: {error}")
        else:
            self._mailbox.note("tared: the sheet as it is now counts as untouched")

    def _change(self, **fields: object) -> None:
        """Begin anew with the next frame, if two frames can be read so.

        Raises:
            ManytouchError: they cannot.
        """
        setup = replace(self._wanted, **fields)  # type: ignore[arg-type]
        replace(self._job, pipeline=setup.pipeline, sensor=setup.sensor, method=setup.method).warm_up()
        self._wanted = setup
        self._taping.describe(setup.sensor, setup.pipeline, setup.method)


def _until_setup(stream: Iterator[Setup | TrackedFrame], following: list[Setup]) -> Iterator[TrackedFrame]:
    """Sights up to the next setup, which is put into `following`."""
    for item in stream:
        if isinstance(item, Setup):
            following.append(item)
            return
        yield item
