"""The recording of a session: begun, fed and ended while it runs."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from manytouch.errors import ManytouchError, OutputError
from manytouch.pipeline import Pipeline
from manytouch.session.prepare import Job
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.recorder import Recorder
from manytouch.sources.source import Device
from manytouch.values import Frame, Reading, Sensor

NAME = "recording-%Y%m%d-%H%M%S.mcap"


class SessionRecorder:
    """At most one recording at a time; a camera's frames are taken as they arrive, before any is dropped."""

    def __init__(self, job: Job, folder: Path, note: Callable[[str], None]) -> None:
        """Nothing is recorded yet.

        Args:
            job: of the session.
            folder: for recordings without a name.
            note: told what begins and ends.
        """
        self._job = job
        self._folder = folder
        self._note = note
        self._recorder: Recorder | None = None
        self._change = threading.Lock()

    @property
    def name(self) -> str | None:
        """Of the file that is being written."""
        recorder = self._recorder
        return None if recorder is None else recorder.path.name

    def begin(self, path: Path | None, sensor: Sensor, pipeline: Pipeline, method: str) -> None:
        """Record what comes from now on.

        Raises:
            ManytouchError: something is being recorded; OutputError: the file cannot be written, or is
                the one that is read. What was recorded under that name before gets another.
        """
        if self._recorder is not None:
            raise ManytouchError(f"{self.name} is being recorded; stop it first")
        path = path or self._folder / time.strftime(NAME)
        read = Path(self._job.text).expanduser()
        if path.exists() and read.exists() and path.samefile(read):
            raise OutputError(f"{str(path)!r} is the recording that is read: record under another name")
        before = _moved_aside(path)
        try:
            recorder = Recorder(path, source=self._job.recording, fps=self._job.source.fps)
        except ManytouchError:
            if before is not None:
                before.replace(path)
            raise
        if before is not None:
            self._note(f"the {path.name} that was there is {before.name} now")
        recorder.describe(sensor, pipeline, method)
        self._recorder = recorder
        if isinstance(self._job.source, Device):
            self._job.source.listen(recorder.take)
        self._note(f"recording {path.name}")

    def describe(self, sensor: Sensor, pipeline: Pipeline, method: str) -> None:
        """Readings are made otherwise from now on."""
        if self._recorder is not None:
            self._recorder.describe(sensor, pipeline, method)

    def take(self, frame: Frame) -> None:
        """A frame of a source that waits; a camera's are taken as they arrive."""
        if self._recorder is not None and not isinstance(self._job.source, Device):
            self._recorder.take(frame, waits=True)

    def write(self, reading: Reading) -> None:
        """A reading; a recording that has ended by itself is told about."""
        recorder = self._recorder
        if recorder is None:
            return
        recorder.write(reading)
        if recorder.ended is not None:
            self.end()

    def end(self) -> None:
        """End the recording, if there is one."""
        with self._change:
            recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        if isinstance(self._job.source, Device):
            self._job.source.listen(None)
        recorder.close()
        self._note(recorder.ended or f"recorded {recorder.path.name}")


def _moved_aside(path: Path) -> Path | None:
    """Renames a file that is there: press.mcap to press-1.mcap, or the next that is free; its new name."""
    if not path.is_file() or path.stat().st_size == 0:
        return None
    number = 1
    while (aside := path.with_name(f"{path.stem}-{number}{path.suffix}")).exists():
        number += 1
    with output_errors(path):
        path.rename(aside)
    return aside
