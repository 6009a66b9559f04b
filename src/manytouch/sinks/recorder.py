"""Records a session: frames where they arrive, readings as they are made."""

import errno
import queue
import shutil
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from manytouch.errors import OutputError
from manytouch.pipeline import Pipeline
from manytouch.recording import SCHEMA
from manytouch.recording.writer import OutputFile, RecordingWriter, require_mcap
from manytouch.sinks.files.summary import parameters, versions
from manytouch.values import Frame, Reading, Sensor

MOST_WAITING_BYTES = 64 * 2**20
RESERVE_BYTES = 16 * 2**20  # kept free, for the index at the end and for others
FREE_EVERY = 30  # messages between two looks at the room that is left
_END = object()


class Recorder:
    """A recording that grows; a sink for readings, and a tap for frames.

    Frames and readings are written in a thread of its own. When the disk is full, or fails, the recording
    ends with what it has and `ended` says so; sensing is not disturbed.

    Attributes:
        path: the file.
        ended: None while it records, else a sentence about why it no longer does.
        frames: recorded so far.
        lost: frames that came while too many waited for the disk.
    """

    def __init__(
        self, path: Path, *, source: Mapping[str, Any], fps: float | None, file: OutputFile | None = None
    ) -> None:
        """Begin a recording.

        Args:
            path: a new file, or one that is written anew.
            source: what is known of the input.
            fps: its rate.
            file: written to instead of the path.

        Raises:
            OutputError: the file cannot be written.
            MissingExtraError: the packages for recording are not installed.
        """
        require_mcap()
        self.path = path
        self.ended: str | None = None
        self.frames = self.lost = 0
        self._source = dict(source)
        self._from_index: int | None = None
        self._waiting: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._waiting_bytes = 0
        self._room = threading.Condition()
        self._messages = 0
        self._fps = fps
        try:
            if file is None:
                path.parent.mkdir(parents=True, exist_ok=True)
                file = DirectFile(path)
        except OSError as error:
            raise OutputError(
                f"{str(path)!r} cannot be written: {error.strerror or error}; choose a folder that can be "
                "written and has room"
            ) from error
        self._file = file
        self._writer: RecordingWriter | None = None
        self._thread = threading.Thread(target=self._run, name="manytouch-recorder", daemon=True)
        self._thread.start()

    def describe(self, sensor: Sensor, pipeline: Pipeline, method: str) -> None:
        """What makes the readings from now on; to be called before the first frame."""
        about = {
            "schema": SCHEMA,
            "source": self._source,
            "method": method,
            "parameters": parameters(pipeline),
            "versions": versions(),
        }
        self._waiting.put((sensor, about))

    def take(self, frame: Frame, *, waits: bool = False) -> None:
        """Record a frame.

        Args:
            frame: as it came.
            waits: wait while too much is to be written, instead of leaving the frame out.
        """
        size = (
            len(frame.encoded)
            if frame.encoded is not None
            else 0
            if frame.image is None
            else frame.image.nbytes
        )
        with self._room:
            has_room = self._waiting_bytes == 0 or self._waiting_bytes + size <= MOST_WAITING_BYTES
            if not has_room and waits:
                self._room.wait_for(lambda: self._waiting_bytes + size <= MOST_WAITING_BYTES or self.ended)
            elif not has_room:
                self.lost += 1
                return
            self._waiting_bytes += size
        if self._from_index is None:
            self._from_index = frame.index
        self._waiting.put((frame, size))

    def write(self, reading: Reading) -> None:
        """Record a reading, unless its frame came before the recording began."""
        if self._from_index is not None and reading.frame.index >= self._from_index:
            self._waiting.put(reading)

    def log(self, sentence: str) -> None:
        """Record something there is to tell."""
        self._waiting.put(sentence)

    def close(self) -> None:
        """Write what waits, and the end of the file."""
        self._waiting.put(_END)
        self._thread.join()

    def _run(self) -> None:
        while (item := self._waiting.get()) is not _END:
            size = item[1] if isinstance(item, tuple) and isinstance(item[0], Frame) else 0
            if self.ended is None:
                try:
                    self._put(item)
                except OSError as error:
                    self._fail(error)
                except Exception as error:  # noqa: BLE001 - told in `ended`; sensing goes on without a recording
                    self._finish(f"{type(error).__name__}: {error}: {self.path.name} ended")
            if size:
                with self._room:
                    self._waiting_bytes -= size
                    self._room.notify()
        if self.ended is None:
            self._finish("")

    def _put(self, item: Any) -> None:
        if self._messages % FREE_EVERY == 0 and self._is_full():
            self._finish(f"the disk is full: {self.path.name} ended")
            return
        self._messages += 1
        if isinstance(item, Reading):
            self._begun().reading(item)
        elif isinstance(item, str):
            self._begun().log(item)
        elif isinstance(item[0], Frame):
            encoded, suffix = encoded_of(item[0])
            self._begun().frame(item[0], encoded, suffix)
            self.frames += 1
        else:
            self._begun().session(*item)

    def _begun(self) -> RecordingWriter:
        if self._writer is None:
            self._writer = RecordingWriter(self._file, started_unix_ns=time.time_ns(), fps=self._fps)
        return self._writer

    def _is_full(self) -> bool:
        try:
            return free_bytes(self.path.parent) < RESERVE_BYTES
        except OSError:
            return False  # not known here; writing will tell

    def _finish(self, why: str) -> None:
        """End the file with its index."""
        try:
            self._begun().finish()
            self._file.close()
        except OSError as error:
            self._fail(error)
            return
        self._tell_end(why)

    def _fail(self, error: OSError) -> None:
        """End the file after the last message that is whole."""
        whole = 0 if self._writer is None else self._writer.valid_bytes
        try:
            self._file.truncate(whole)
            self._file.close()
        except OSError:
            error.add_note("and the file could not be cut after its last whole message")
        what = (
            "the disk is full"
            if error.errno in (errno.ENOSPC, errno.EDQUOT)
            else f"{error.strerror or error}"
        )
        self._tell_end(f"{what}: {self.path.name} ended")

    def _tell_end(self, why: str) -> None:
        kept = f"{self.frames} frames are kept"
        lost = f", {self.lost} were lost since the disk was too slow" if self.lost else ""
        with self._room:
            self.ended = f"{why or f'recorded {self.path.name}'}; {kept}{lost}"
            self._room.notify_all()


class DirectFile:
    """A file without a buffer: what is written is with the operating system at once."""

    def __init__(self, path: Path) -> None:
        self._raw = path.open("wb", buffering=0)

    def write(self, data: bytes) -> int:
        """Write all of it."""
        left = memoryview(data)
        while left:
            left = left[self._raw.write(left) or 0 :]
        return len(data)

    def flush(self) -> None:
        """Nothing waits."""

    def tell(self) -> int:
        """How much is written."""
        return self._raw.tell()

    def truncate(self, size: int) -> int:
        """Cut it."""
        return self._raw.truncate(size)

    def close(self) -> None:
        """Close it."""
        self._raw.close()


def _bytes_of(frame: Frame) -> int:
    """What a frame takes in memory."""
    if frame.encoded is not None:
        return len(frame.encoded)
    return 0 if frame.image is None else frame.image.nbytes


def encoded_of(frame: Frame) -> tuple[bytes, str]:
    """A frame's bytes as the camera gave them, else as PNG; and which of the two it is."""
    if frame.encoded is not None:
        return frame.encoded, "png" if frame.encoded.startswith(b"\x89PNG") else "jpeg"
    if frame.image is None:
        return b"", "png"
    import cv2

    done, encoded = cv2.imencode(".png", frame.image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    return (encoded.tobytes() if done else b""), "png"


def free_bytes(folder: Path) -> int:
    """Room on the disk that holds a folder."""
    return shutil.disk_usage(folder).free
