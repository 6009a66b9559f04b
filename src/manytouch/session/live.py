"""A live session: frames at the pace of their source, and commands while it runs."""

import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from manytouch.errors import ManytouchError
from manytouch.pipeline import Output, Pipeline, Sink, TrackedFrame
from manytouch.session.background_iterator import BackgroundIterator, short_switch_interval
from manytouch.session.commands.background_preparation import BackgroundPreparation
from manytouch.session.commands.command_queue import CommandQueue
from manytouch.session.commands.contact_id_offset import ContactIdOffset
from manytouch.session.commands.continuation import (
    Kept,
    Setup,
    kept,
    resumed_estimation,
    resumed_tracking,
    until_setup,
)
from manytouch.session.commands.tare import TareCollector
from manytouch.session.commands.touched_tares import TouchedTares
from manytouch.session.methods import (
    METHODS,
    choices_of,
    parameter_info,
    parameters_of,
    pipeline_for,
    require_method_for,
    value_text,
    with_parameter,
    with_parameters,
)
from manytouch.session.pacing import LONGEST_SLEEP_S, Pace
from manytouch.session.prepare import Job
from manytouch.session.recording import SessionRecorder
from manytouch.session.run import Observer, StopCondition
from manytouch.session.throughput import ThroughputMeter
from manytouch.sources.state_notes import StateNotes
from manytouch.tracking import COMPRESSED_VIDEO
from manytouch.values import (
    Command,
    Comparison,
    Frame,
    Health,
    Pause,
    Press,
    Reading,
    Record,
    Release,
    Resume,
    Sensor,
    StopRecording,
    Tare,
    Tune,
    UndoTare,
    UseMethod,
)

AHEAD = 1  # frames that are tracked and wait for estimation


class Live:
    """Readings of a job at the pace of its source, controlled by commands.

    It is both `manytouch.session.Readings`, for `run`, and `manytouch.pipeline.Controls`, for the viewer.
    Decoding, detection and tracking run in a thread, estimation and sinks in the one that calls `run`. Frames
    of a device that come while a thread is busy are dropped and counted, all but the last. What is changed
    is prepared in a third thread, while the frames are processed as before. `meter` counts the readings,
    `recorder` records.
    """

    def __init__(
        self,
        job: Job,
        *,
        recordings: Path = Path(),
        record: Path | None = None,
        begin: Callable[[], int] | None = None,
    ) -> None:
        """Prepare; nothing runs yet.

        Args:
            job: from `prepare`.
            recordings: folder for recordings that are begun without a name.
            record: record everything into this file.
            begin: called when all is prepared; returns when timestamp 0 of a file or a simulation is due, in
                ns of the monotonic clock. None: the first frame is due at once.
        """
        self._job = job
        self._wanted = Setup(pipeline=job.pipeline, sensor=job.sensor, method=job.method, version=0)
        self._present = self._wanted
        self._commands = CommandQueue()
        self._setups: BackgroundPreparation[Setup] = BackgroundPreparation(self._warm_up, self._refuse)
        self.meter = ThroughputMeter()
        self.recorder = SessionRecorder(job, recordings, self._commands.note)
        self._state_notes = StateNotes(job.source, self._commands.note)
        self._record_path, self._begin = record, begin
        self._outputs: tuple[Output, ...] = ()
        self._is_held = False
        self._is_over = threading.Event()
        self._dropped = 0
        self._stream: BackgroundIterator[Setup | TrackedFrame] | None = None
        self._next_index: int | None = None
        self._pace = Pace()
        self._tare = TareCollector()
        self._before_tares: list[Setup] = []
        self._touched_tares = TouchedTares()
        self._is_changed = False

    @property
    def is_repeatable(self) -> bool:
        """Whether no command has changed readings: no other method, parameter or reference, and no press."""
        return not self._is_changed

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on commands that make results doubtful."""
        return self._touched_tares.warnings

    @property
    def sensor(self) -> Sensor:
        """The sensor in use."""
        return self._present.sensor

    @property
    def job(self) -> Job:
        """The job with the method, the parameters and the sensor in use."""
        setup = self._present
        return replace(self._job, pipeline=setup.pipeline, sensor=setup.sensor, method=setup.method)

    @property
    def frame_count(self) -> int | None:
        """Expected number of frames; None when not known."""
        return self._job.frame_count

    @property
    def own_sinks(self) -> tuple[Sink, ...]:
        """The outputs, the recorder, the meter of rate and latency, and the notes on the source."""
        return *self._outputs, self.recorder, self.meter, self._state_notes

    def attach(self, outputs: Sequence[Output]) -> None:
        """Pass readings to other programs too; call it before the session is run."""
        self._outputs = (*self._outputs, *outputs)

    def send(self, command: Command) -> None:
        """Request something; it is carried out between two frames."""
        self._commands.send(command)

    def comparison(self, frame_index: int) -> Comparison | None:
        """Ground truth of a frame; None where the source has none."""
        truth_of = self._job.source.capabilities.truth
        truth = None if truth_of is None else truth_of(frame_index)
        if truth is None:
            return None
        return Comparison(name="truth", surface=truth.surface, contacts=truth.contacts)

    def health(self) -> Health:
        """State of source, session and recording."""
        setup, can = self._present, self._job.source.capabilities
        layout, (median_ms, p99_ms) = setup.sensor.layout, self.meter.latency_ms
        return Health(
            is_running=not self._is_held,
            source_state="ok" if can.device is None else can.device.status,
            readings_per_s=self.meter.readings_per_s,
            latency_ms_p50=median_ms,
            latency_ms_p99=p99_ms,
            frames=self.meter.frames,
            dropped=self._dropped + (0 if self._stream is None else self._stream.replaced),
            markers_seen=self.meter.markers_seen,
            markers=0 if layout is None else int((~layout.is_missing).sum()),
            method=setup.method,
            methods=METHODS,
            parameters=parameters_of(setup.pipeline),
            choices=choices_of(setup.pipeline),
            parameter_info=parameter_info(setup.method),
            settings=() if can.device is None else can.device.settings,
            recording=self.recorder.name,
            notes=self._commands.notes,
            can_press=can.press is not None,
            can_untare=bool(self._before_tares),
            reference_warning=self._touched_tares.warning,
            sensor_version=setup.version,
            is_preparing=self._setups.is_busy,
            outputs=tuple(state for output in self._outputs for state in output.states),
        )

    def start(self, observer: Observer, stop: StopCondition) -> Generator[Reading, None, None]:
        """Readings until the source ends.

        Raises:
            ManytouchError: the first frames cannot be processed.
            OutputError: the recording cannot be written.
        """
        self._commands.on_note = observer.on_message
        self._wanted = self._present = self._warm_up(self._wanted)
        if self._record_path is not None:
            self._begin_recording(self._record_path)
        if self._begin is not None:
            self._pace.begin(self._begin())
        replaceable = TrackedFrame if self._job.source.is_live else None
        is_over = self._state_notes.checked(stop)
        self._stream = BackgroundIterator(
            self._track(), ahead=AHEAD, stop=is_over, replaceable=replaceable, thread_name="manytouch-track"
        )
        with short_switch_interval(), self._stream as stream:
            try:
                yield from self._estimate(iter(stream))
            finally:
                self.close()

    def close(self) -> None:
        """End the session and release the source."""
        self._is_over.set()
        self._setups.close()
        self._job.close()

    def _estimate(self, stream: Iterator[Setup | TrackedFrame]) -> Iterator[Reading]:
        """Readings, in the calling thread."""
        renumber, state, before, is_noted = ContactIdOffset(), Kept(), None, False
        setup = next(stream, None)
        while isinstance(setup, Setup):
            self._present = setup
            if (warning := self._touched_tares.use(setup.tare)) is not None:
                self._commands.note(warning)
            following: list[Setup] = []
            begin = setup.estimation
            if before is not None and setup.is_variant_of(before):
                begin = resumed_estimation(setup.pipeline, begin, before.pipeline, state.value)
            else:
                renumber.begin()
            frames = until_setup(stream, following)
            readings = setup.pipeline.estimate_readings(frames, setup.sensor, begin)
            for reading in kept(readings, state.keep):
                self._touched_tares.add(reading)
                if reading.grid.is_compressed and not is_noted:
                    is_noted = True
                    self._commands.note(COMPRESSED_VIDEO)
                yield renumber(reading)
            before, setup = setup, following[0] if following else None

    def _track(self) -> Iterator[Setup | TrackedFrame]:
        """Setups, each followed by the frames tracked with it, in the background thread."""
        state, before, begin = Kept(), None, None
        while not self._is_over.is_set():
            setup = self._wanted
            yield setup
            if before is not None:
                begin = None
                if setup.sensor is before.sensor:
                    begin = resumed_tracking(setup.pipeline, setup.sensor, before.pipeline, state.value)
            stream = setup.pipeline.track_frames(self._frames(setup), setup.sensor, begin)
            for tracked in kept(stream, state.keep):
                yield tracked
                self._collect_tare(tracked)
            before = setup

    def _frames(self, setup: Setup) -> Iterator[Frame]:
        """Frames, until another setup is wanted.

        A frame that a press changes is made when it is due, so that it shows presses up to then.
        """
        is_live = self._job.source.is_live
        while not self._is_over.is_set():
            if self._job.source.capabilities.press is not None and not is_live and not self._is_held:
                self._pace.wait_for_next(self._job.source.fps, self._is_over.is_set)
            self._commands.drain(self._carry_out)
            self._use_prepared_setup()
            if self._wanted is not setup:
                return
            if self._is_held and not is_live:
                self._pace.reset()
                self._is_over.wait(LONGEST_SLEEP_S)
                continue
            frame = next(self._job.frames, None)
            if frame is None:
                self._is_over.set()
                return
            if is_live:
                self._count_dropped(frame)
                self.recorder.take(frame)
                if not self._is_held:
                    yield frame
            else:
                yield self._wait_for(frame)

    def _count_dropped(self, frame: Frame) -> None:
        if self._next_index is not None and not self._is_held:
            self._dropped += frame.index - self._next_index
        self._next_index = frame.index + 1

    def _wait_for(self, frame: Frame) -> Frame:
        """Wait until the frame of a file is due; it arrives then, and is recorded."""
        self._pace.wait_for(frame.timestamp_ns, self._is_over.is_set)
        arrived = replace(frame, arrived_ns=time.monotonic_ns())
        self.recorder.take(arrived)
        return arrived

    def _carry_out(self, command: Command) -> None:
        match command:
            case Resume():
                self._is_held = False
            case Pause():
                self._is_held = True
            case Tare():
                self._tare.begin()
            case UndoTare():
                self._undo_tare()
            case UseMethod(method=method):
                pipeline = self._pipeline_for(method)
                if method != self._newest_setup.method:
                    self._change(f"method {method}", pipeline=pipeline, method=method)
            case Tune(parameter=parameter, value=value):
                pipeline = with_parameter(self._newest_setup.pipeline, parameter, value)
                if pipeline != self._newest_setup.pipeline:
                    self._change(f"{parameter} = {value_text(value)}", pipeline=pipeline)
            case Record(path=path):
                self._begin_recording(path)
            case StopRecording():
                self.recorder.end()
            case Press() | Release():
                self._press(command)
            case _:
                self._commands.note(f"{type(command).__name__} is possible only in playback of a recording")

    def _pipeline_for(self, method: str) -> Pipeline:
        """The stages of a method, with those of the requested parameters that it has."""
        require_method_for(self.sensor, method)
        pipeline = pipeline_for(method, self._job.roi_px)
        known, requested = parameters_of(pipeline), self._job.request.parameters
        return with_parameters(pipeline, {name: requested[name] for name in requested if name in known})

    def _begin_recording(self, path: Path | None) -> None:
        setup = self._wanted
        self.recorder.begin(path, setup.sensor, setup.pipeline, setup.method)

    def _press(self, command: Press | Release) -> None:
        press = self._job.source.capabilities.press
        if press is None:
            raise ManytouchError(f"{self._job.text} cannot be pressed: only the simulated sensor can")
        self._is_changed = True
        press(command)

    def _collect_tare(self, tracked: TrackedFrame) -> None:
        """Continue with the sensor that a tare gives, once it has enough frames."""
        setup = self._newest_setup
        try:
            sensor, tare = self._tare.add(tracked, setup.sensor)
        except ManytouchError as error:
            self._commands.note(f"not tared: {error}")
            return
        if tare is not None:
            self._before_tares.append(setup)
            note = "tared: the present marker positions are the reference"
            self._change(note, sensor=sensor, tare=tare, version=setup.version + 1)

    def _undo_tare(self) -> None:
        if not self._before_tares:
            raise ManytouchError("there is no tare to undo")
        note, before = "tare undone: the reference is the one before", self._before_tares.pop()
        self._change(note, sensor=before.sensor, tare=before.tare, version=self._newest_setup.version + 1)

    @property
    def _newest_setup(self) -> Setup:
        """The setup that was requested last, whether it is ready or not."""
        return self._setups.requested() or self._wanted

    def _change(self, note: str, **fields: object) -> None:
        """Continue with another setup once it is ready; until then the present one goes on."""
        setup = replace(self._newest_setup, note=note, estimation=None, **fields)  # type: ignore[arg-type]
        if self._setups.requested() is None and setup.has_stages_of(self._wanted):
            self._use(setup)
        else:
            self._setups.request(setup)

    def _warm_up(self, setup: Setup) -> Setup:
        """Process two frames with a setup and start its estimation.

        Raises:
            ManytouchError: it cannot.
        """
        job = replace(self._job, pipeline=setup.pipeline, sensor=setup.sensor, method=setup.method)
        return replace(setup, estimation=job.warm_up(self._commands.note))

    def _refuse(self, reason: str) -> None:
        self._commands.note(f"not changed: {reason}")

    def _use_prepared_setup(self) -> None:
        """Continue with the setup that is ready, if there is one."""
        if (setup := self._setups.take()) is not None:
            self._use(setup)

    def _use(self, setup: Setup) -> None:
        self._wanted, self._is_changed = setup, True
        self.recorder.describe(setup.sensor, setup.pipeline, setup.method)
        self._commands.note(setup.note)
