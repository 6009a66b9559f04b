"""Records a session: frames when they arrive, readings when they are computed."""

import errno
import os
import queue
import shutil
import sys
import threading
import time
from collections.abc import Mapping
from io import FileIO
from pathlib import Path
from typing import Any

from manytouch.errors import OutputError
from manytouch.limits import MAX_FRAME_TIME_NS
from manytouch.pipeline import Pipeline
from manytouch.recording import SCHEMA
from manytouch.recording.writer import OutputFile, RecordingWriter, require_mcap
from manytouch.sinks.files.summary import parameters, versions
from manytouch.values import Frame, Reading, Sensor
from manytouch.values.frame import image_format

MAX_QUEUED_BYTES = 64 * 2**20
RESERVE_BYTES = 16 * 2**20  # of the disk that stay free, for the index of the file and for other programs
SPACE_CHECK_INTERVAL = 30  # messages
_END = object()


class Recorder:
    """Writes a recording: a sink for readings that accepts frames too.

    Frames and readings are written in a separate thread. If the disk is full or fails, the recording ends
    with what was written, and `ended` states the reason; the session continues.

    Attributes:
        path: the file.
        ended: None while recording, afterwards a sentence with the reason for the end.
        is_lost: whether it ended with an error before it had a frame.
        frames: number of recorded frames.
        lost: number of frames that were not recorded, because encoding or the disk was too slow.
        repeated: number of recorded frames whose number is not larger than all before.
    """

    def __init__(self, path: Path, *, source: Mapping[str, Any], file: OutputFile | None = None) -> None:
        """Start a recording.

        Args:
            path: the file to create or replace.
            source: a description of the input.
            file: receives the data instead of a file at `path`.

        Raises:
            OutputError: the file cannot be written.
            MissingExtraError: the packages for recording are not installed.
        """
        require_mcap()
        self.path = path
        self.ended: str | None = None
        self.is_lost = False
        self.frames = self.lost = self.repeated = 0
        self._source = dict(source)
        self._from_index: int | None = None
        self._largest_index = -1
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._queued_bytes = 0
        self._room = threading.Condition()
        self._messages = 0
        self._started_unix_ns: int | None = None
        self._early: list[Any] = []
        try:
            if file is None:
                path.parent.mkdir(parents=True, exist_ok=True)
                file = UnbufferedFile(path)
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
        """Record by what readings are made from now on; call it before the first frame."""
        about = {
            "schema": SCHEMA,
            "source": self._source,
            "method": method,
            "parameters": parameters(pipeline),
            "versions": versions(),
        }
        self._queue.put((sensor, about))

    def take(self, frame: Frame, *, waits: bool = False) -> None:
        """Record a frame.

        Args:
            frame: as it arrived.
            waits: whether to wait while too much is queued, instead of omitting the frame.
        """
        size = _byte_count(frame)
        with self._room:
            has_room = self._queued_bytes == 0 or self._queued_bytes + size <= MAX_QUEUED_BYTES
            if not has_room and waits:
                self._room.wait_for(lambda: self._queued_bytes + size <= MAX_QUEUED_BYTES or self.ended)
            elif not has_room:
                self.lost += 1
                return
            self._queued_bytes += size
        if self._from_index is None:
            self._from_index = frame.index
            self._started_unix_ns = max(started_unix_ns(frame), 0)
        self._queue.put((frame, size))

    def write(self, reading: Reading) -> None:
        """Record a reading, unless its frame came before the recording began."""
        if self._from_index is not None and reading.frame.index >= self._from_index:
            self._queue.put(reading)

    def log(self, sentence: str) -> None:
        """Record a message of the session."""
        self._queue.put(sentence)

    def close(self) -> None:
        """Write what is queued, and complete the file."""
        self._queue.put(_END)
        self._thread.join()

    def _run(self) -> None:
        while (item := self._queue.get()) is not _END:
            size = item[1] if isinstance(item, tuple) and isinstance(item[0], Frame) else 0
            if self.ended is None:
                try:
                    self._put(item)
                except OSError as error:
                    self._fail(error)
                except OutputError as error:
                    self._finish(f"{error}: {self.path.name} ended")
                except Exception as error:  # noqa: BLE001 - reported in `ended`; the session continues without a recording
                    self._finish(f"{type(error).__name__}: {error}: {self.path.name} ended")
            if size:
                with self._room:
                    self._queued_bytes -= size
                    self._room.notify()
        if self.ended is None:
            self._finish("")

    def _put(self, item: Any) -> None:
        if self._started_unix_ns is None:
            self._early.append(item)  # its log time follows from the first frame
            return
        self._put_early()
        if self.ended is None:
            self._put_now(item)

    def _put_early(self) -> None:
        early, self._early = self._early, []
        for item in early:
            if self.ended is None:
                self._put_now(item)

    def _put_now(self, item: Any) -> None:
        if self._messages % SPACE_CHECK_INTERVAL == 0 and self._is_disk_full():
            self._finish(f"the disk is full: {self.path.name} ended, {self._space()}")
            return
        self._messages += 1
        if isinstance(item, Reading):
            self._started_writer().reading(item)
        elif isinstance(item, str):
            self._started_writer().log(item)
        elif isinstance(item[0], Frame):
            _require_time(item[0])
            encoded, suffix = encode_frame(item[0])
            self._started_writer().frame(item[0], encoded, suffix)
            self.frames += 1
            self.repeated += item[0].index <= self._largest_index
            self._largest_index = max(self._largest_index, item[0].index)
        else:
            self._started_writer().session(*item)

    def _started_writer(self) -> RecordingWriter:
        if self._writer is None:
            begin_ns = time.time_ns() if self._started_unix_ns is None else self._started_unix_ns
            self._writer = RecordingWriter(self._file, started_unix_ns=begin_ns)
        return self._writer

    def _space(self) -> str:
        """How much was written, and how much is free."""
        written = 0 if self._writer is None else self._writer.valid_bytes
        reserve = f"{RESERVE_BYTES / 1e6:.0f} MB of the disk stay free"
        try:
            free = f"{_megabytes(free_bytes(self.path.parent))} MB were free"
        except OSError:
            free = "the free space is unknown"
        return f"when {_megabytes(written)} MB were written and {free} ({reserve})"

    def _is_disk_full(self) -> bool:
        try:
            return free_bytes(self.path.parent) < RESERVE_BYTES
        except OSError:
            return False  # unknown here; a failing write ends the recording

    def _finish(self, why: str) -> None:
        """Complete the file with its index."""
        try:
            self._put_early()
            if self.ended is not None:
                return
            self._started_writer().finish()
            self._file.close()
        except Exception as error:  # noqa: BLE001 - reported in `ended`
            self._fail(error)
            return
        self._set_ended(why)

    def _fail(self, error: Exception) -> None:
        """End the file after its last complete message."""
        complete_bytes = 0 if self._writer is None else self._writer.valid_bytes
        try:
            self._file.truncate(complete_bytes)
            self._file.close()
        except OSError:
            error.add_note("the file could not be truncated after its last complete message either")
        what = f"{error}"
        if isinstance(error, OSError):
            is_full = error.errno in (errno.ENOSPC, errno.EDQUOT)
            what = "the disk is full" if is_full else error.strerror or what
        self._set_ended(f"{what}: {self.path.name} ended, {self._space()}")

    def _set_ended(self, why: str) -> None:
        kept = f"{self.frames} frames were recorded"
        lost = f", {self.lost} were lost because encoding or the disk was too slow" if self.lost else ""
        repeated = (
            f", {self.repeated} of them with numbers that are not larger than all before: of frames with one "
            "number only the first can be read"
            if self.repeated
            else ""
        )
        self.is_lost = bool(why) and self.frames == 0
        with self._room:
            self.ended = f"{why or f'recorded {self.path.name}'}; {kept}{repeated}{lost}"
            self._room.notify_all()


def _megabytes(count: int) -> str:
    """Bytes as MB, without an exponent."""
    return f"{count / 1e6:.{0 if count >= 100_000_000 else 1 if count >= 1_000_000 else 3}f}"


class UnbufferedFile:
    """A file without a buffer: written data reach the operating system at once. One process writes it."""

    def __init__(self, path: Path) -> None:
        """Create the file, or empty one that no other session is writing.

        Raises:
            OutputError: another session has begun to record under this name.
            OSError: it cannot be written.
        """
        self._raw = FileIO(path, "w", opener=lambda name, flags: os.open(name, flags & ~os.O_TRUNC, 0o666))
        try:
            _lock(self._raw)
        except BlockingIOError as error:
            self._raw.close()
            raise OutputError(
                f"{str(path)!r} is being recorded by another session: record under another name"
            ) from error
        self._raw.truncate(0)

    def write(self, data: bytes) -> int:
        """Write all of the data."""
        left = memoryview(data)
        while left:
            left = left[self._raw.write(left) or 0 :]
        return len(data)

    def flush(self) -> None:
        """Nothing to do: there is no buffer."""

    def tell(self) -> int:
        """Number of bytes written."""
        return self._raw.tell()

    def truncate(self, size: int) -> int:
        """Cut the file to a size."""
        return self._raw.truncate(size)

    def close(self) -> None:
        """Close the file."""
        self._raw.close()


def _lock(file: FileIO) -> None:
    """Lock a file until it is closed, where the system and the file system can without hindering readers.

    Raises:
        BlockingIOError: another process has locked it.
    """
    if sys.platform != "win32":
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            return  # a network disk without locks


def _require_time(frame: Frame) -> None:
    """Refuse a time that is not read back.

    Raises:
        OutputError: it cannot be counted from the start of the source.
    """
    if abs(frame.timestamp_ns) >= MAX_FRAME_TIME_NS:
        raise OutputError(
            f"frame {frame.index} has the time {frame.timestamp_ns * 1e-9:.0f} s, but times count from the "
            "start of the source: give a timestamp_ns of less than 10 years"
        )


def _byte_count(frame: Frame) -> int:
    """Size of a frame in memory."""
    if frame.encoded is not None:
        return len(frame.encoded)
    return 0 if frame.image is None else frame.image.nbytes


def started_unix_ns(frame: Frame) -> int:
    """Unix time at timestamp 0, from the arrival of a frame by the monotonic clock."""
    now_ns = time.monotonic_ns()
    unix_minus_monotonic_ns = time.time_ns() - now_ns
    arrived_ns = now_ns if frame.arrived_ns is None else frame.arrived_ns
    return unix_minus_monotonic_ns + arrived_ns - frame.timestamp_ns


def encode_frame(frame: Frame) -> tuple[bytes, str]:
    """The encoded image of a frame as the camera sent it, else as PNG, and the format: "jpeg" or "png".

    There are no bytes of a frame without an image, or whose image has no pixels.
    """
    if frame.encoded is not None:
        return frame.encoded, image_format(frame.encoded)
    if frame.image is None or frame.image.size == 0:
        return b"", "png"
    import cv2

    options = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
    # One filter and runs only: without them it takes more than twice as long, for files within 10 % of these.
    if "IMWRITE_PNG_FILTER" in dir(cv2):  # not before OpenCV 4.11
        options += [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]
    done, encoded = cv2.imencode(".png", frame.image, options)
    return (encoded.tobytes() if done else b""), "png"


def free_bytes(folder: Path) -> int:
    """Free space on the disk of a folder."""
    return shutil.disk_usage(folder).free
