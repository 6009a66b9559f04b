"""A recording watched again: stored readings, or read anew with another method or sensor."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.pipeline import Sink
from manytouch.session.commands.command_queue import CommandQueue
from manytouch.session.commands.tuning import parameters_of
from manytouch.session.methods import METHODS, pipeline_for
from manytouch.session.pacing import LONGEST_NAP_S, Pace
from manytouch.session.prepare import Job, Observer, prepare
from manytouch.session.throughput import ThroughputMeter
from manytouch.sinks.files.sensor_description import layout_of
from manytouch.sources import open_source
from manytouch.sources.files.replay import ReplaySource
from manytouch.values import (
    Command,
    Comparison,
    Frame,
    Health,
    Play,
    Reading,
    Seek,
    Sensor,
    Start,
    Stop,
    UseMethod,
)


class Playback:
    """A recording at its own pace, with a timeline; `manytouch.pipeline.Controls`.

    Without method and sensor the stored readings are given, and frames that nobody had time to read are left
    out. With one of them, or once a method is chosen, every frame is read anew, from the frame that was
    sought on, and what was recorded stands beside it.
    """

    def __init__(
        self,
        path: Path,
        *,
        method: str | None = None,
        sensor: str | Path | Sensor | None = None,
        stays: bool = False,
    ) -> None:
        """Open a recording.

        Args:
            path: the file.
            method, sensor: to read it anew with.
            stays: wait at the end for somebody to seek, instead of ending.

        Raises:
            SourceError: it is not there, or no recording that can be replayed.
            ManytouchError: see `prepare`.
        """
        source = open_source(path)
        if not isinstance(source, ReplaySource):
            raise SourceError(f"{str(path)!r} is no recording; manytouch run shows other sources")
        self._source = source
        self._is_anew = method is not None or sensor is not None
        recorded = str(self._source.recording.about["method"])
        known = method or (recorded if recorded in METHODS else None)
        self._job: Job = prepare(self._source, sensor=sensor, method=known)
        self._method = known or recorded
        self._stays = stays
        self._mailbox = CommandQueue()
        self._meter = ThroughputMeter()
        self._pace = Pace()
        self._is_held = False
        self._place = 0
        self._sought: int | None = None
        self._markers_seen = 0

    @property
    def job(self) -> Job:
        """The recording as an input."""
        return self._job

    @property
    def sensor(self) -> Sensor:
        """The one that was recorded, or the given one."""
        return self._job.sensor

    def send(self, command: Command) -> None:
        """Ask for something; it is done between two frames."""
        self._mailbox.send(command)

    def beside(self, frame_index: int) -> Comparison | None:
        """What was recorded of a frame, where it is read anew in the same unit of length."""
        recording = self._source.recording
        if not self._is_anew or recording.sensor.length_unit != self.sensor.length_unit:
            return None
        bare = Frame(index=frame_index, timestamp_ns=0, camera="", image=None)
        recorded = recording.reading(bare)
        if recorded is None:
            return None
        is_alike = len(recorded.surface.displacement_mm) == len(layout_of(self.sensor).rest_mm)
        surface = recorded.surface if is_alike else None
        return Comparison(name="recorded", surface=surface, contacts=recorded.contacts)

    def health(self) -> Health:
        """How it is doing."""
        middle, late = self._meter.latency_ms
        layout = self.sensor.layout
        return Health(
            is_running=not self._is_held,
            source=self._source.warning or "ok",
            fps=self._meter.fps,
            latency_ms_p50=middle,
            latency_ms_p99=late,
            frames=self._meter.frames,
            dropped=0,
            markers_seen=self._markers_seen,
            markers=0 if layout is None else int((~layout.is_missing).sum()),
            method=self._method,
            methods=METHODS,
            parameters=parameters_of(self._job.pipeline),
            notes=self._mailbox.notes,
            frame=self._place,
            frame_count=len(self._source.recording),
        )

    def run(
        self,
        sinks: Sequence[Sink],
        *,
        progress: Observer | None = None,
        stop: Callable[[], bool] | None = None,
    ) -> None:
        """Replay until the end or until `stop` says so; sinks are closed whatever happens."""
        is_over = stop or (lambda: False)
        with ExitStack() as closing:
            for sink in reversed(sinks):
                closing.callback(sink.close)
            if progress is not None:
                self._mailbox.say = progress.say
                progress.begin(self._job)
            if self._source.warning is not None:
                self._mailbox.note(self._source.warning)
            if self._is_anew:
                self._job.warm_up()
            while (begin := self._next_begin(is_over)) is not None:
                for reading in self._readings(begin, is_over):
                    for sink in sinks:
                        sink.write(reading)
                    self._meter.count(reading.frame.arrived_ns)
                    self._markers_seen = int(reading.grid.is_seen.sum())
                    if progress is not None:
                        progress.read(reading)

    def _next_begin(self, is_over: Callable[[], bool]) -> int | None:
        """The place to go on from; None when it is over."""
        if self._meter.frames == 0 and self._sought is None:
            return 0
        while not is_over():
            self._mailbox.obey(self._do)
            if self._sought is not None:
                begin, self._sought = self._sought, None
                return begin
            if not self._stays:
                return None
            time.sleep(LONGEST_NAP_S)
        return None

    def _readings(self, begin: int, is_over: Callable[[], bool]) -> Iterator[Reading]:
        """Readings from a place on, paced, until the end or until another place is sought."""
        self._pace.reset()
        places = self._places(begin, is_over)
        if self._is_anew:
            frames = (self._source.frame(place) for place in places)
            readings = self._job.pipeline.run(frames, self.sensor)
        else:
            found = (self._source.reading(place) for place in places)
            readings = (reading for reading in found if reading is not None)
        for reading in readings:
            frame = replace(reading.frame, arrived_ns=time.monotonic_ns())
            yield replace(reading, frame=frame)

    def _places(self, begin: int, is_over: Callable[[], bool]) -> Iterator[int]:
        """Places whose time has come. The one that was sought comes at once, also while it is held."""
        for place in range(begin, len(self._source.recording)):
            self._mailbox.obey(self._do)
            while self._is_held and place > begin and self._sought is None and not is_over():
                self._pace.reset()
                time.sleep(LONGEST_NAP_S)
                self._mailbox.obey(self._do)
            if self._sought is not None or is_over():
                return
            self._pace.wait_for(self._source.recording.timestamp_ns(place), is_over)
            self._place = place
            yield place

    def _do(self, command: Command) -> None:
        match command:
            case Start():
                self._is_held = False
            case Stop():
                self._is_held = True
            case Seek(frame=frame):
                if not 0 <= frame < len(self._source.recording):
                    raise SourceError(
                        f"there is no frame {frame}: 0 to {len(self._source.recording) - 1} are"
                    )
                self._sought = frame
            case Play(speed=speed):
                if not 0.01 <= speed <= 100.0:
                    raise SourceError(f"the speed is from 0.01 to 100, not {speed:g}")
                self._pace.speed = speed
                self._pace.reset()
            case UseMethod(method=method):
                anew = replace(self._job, pipeline=pipeline_for(method), method=method)
                anew.warm_up()
                self._job, self._method, self._is_anew, self._sought = anew, method, True, self._place
                self._mailbox.note(f"read anew with method {method}")
            case _:
                self._mailbox.note(f"{type(command).__name__} means nothing to a replay")
