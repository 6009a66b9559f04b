"""The recording of a session: begun, written and ended while the session runs."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from manytouch.errors import ManytouchError, OutputError
from manytouch.pipeline import Pipeline
from manytouch.session.prepare import Job
from manytouch.sinks.files.atomic_output import rename_existing
from manytouch.sinks.recorder import Recorder
from manytouch.values import Frame, Reading, Sensor

NAME = "recording-%Y%m%d-%H%M%S.mcap"


class SessionRecorder:
    """A sink with at most one recording at a time.

    Frames of a device are recorded as they arrive, before any is dropped; all others when they are processed.

    Attributes:
        lost: why the last recording that could not be written has no frame; None: there was none.
    """

    def __init__(self, job: Job, folder: Path, note: Callable[[str], None]) -> None:
        """Nothing is recorded yet.

        Args:
            job: of the session.
            folder: for recordings without a name.
            note: gets a sentence when a recording begins and when it ends.
        """
        self._job = job
        self._folder = folder
        self._note = note
        self.lost: str | None = None
        self._recorder: Recorder | None = None
        self._change = threading.Lock()

    @property
    def name(self) -> str | None:
        """Name of the file that is being written."""
        recorder = self._recorder
        return None if recorder is None else recorder.path.name

    def begin(self, path: Path | None, sensor: Sensor, pipeline: Pipeline, method: str) -> None:
        """Record frames and readings from now on. A file of that name is renamed first.

        Raises:
            ManytouchError: a recording is running.
            OutputError: the file cannot be written, or is the input.
        """
        if self._recorder is not None:
            raise ManytouchError(f"{self.name} is being recorded: stop it first")
        path = path or self._folder / time.strftime(NAME)
        files = self._job.source.capabilities.files
        if path.exists() and any(file.exists() and path.samefile(file) for file in files):
            raise OutputError(f"{str(path)!r} is the recording that is read: record under another name")
        renamed = rename_existing(path)
        try:
            recorder = Recorder(path, source=self._job.input_info)
        except ManytouchError:
            if renamed is not None:
                renamed.replace(path)
            raise
        if renamed is not None:
            self._note(f"the existing {path.name} was renamed to {renamed.name}")
        recorder.describe(sensor, pipeline, method)
        self._recorder = recorder
        device = self._job.source.capabilities.device
        if device is not None:
            device.listen(recorder.take)
        self._note(f"recording {path.name}")

    def describe(self, sensor: Sensor, pipeline: Pipeline, method: str) -> None:
        """Record what produces the readings from now on."""
        if self._recorder is not None:
            self._recorder.describe(sensor, pipeline, method)

    def take(self, frame: Frame) -> None:
        """Record a frame that is about to be processed, unless a device passes its frames on itself.

        If the disk is slow, a frame of a file waits; one of a live source is omitted and counted.
        """
        source = self._job.source
        if self._recorder is not None and source.capabilities.device is None:
            self._recorder.take(frame, waits=not source.is_live)

    def write(self, reading: Reading) -> None:
        """Record a reading; end a recording that has failed."""
        recorder = self._recorder
        if recorder is None:
            return
        recorder.write(reading)
        if recorder.ended is not None:
            self.end()

    def close(self) -> None:
        """End the recording, if there is one."""
        self.end()

    def end(self) -> None:
        """End the recording, if there is one."""
        with self._change:
            recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        device = self._job.source.capabilities.device
        if device is not None:
            device.listen(None)
        recorder.close()
        if recorder.is_lost:
            self.lost = recorder.ended
        self._note(recorder.ended or f"recorded {recorder.path.name}")
