"""A process of this program that exchanges pickled values with the one that has started it, through pipes.

Both ends belong to one version of the program, so that values are not checked again.
"""

import io
import os
import pickle
import struct
import subprocess
import sys
import traceback
from contextlib import suppress
from dataclasses import dataclass
from io import BufferedReader, FileIO
from typing import Any, cast

from manytouch.blas_threads import ONE_THREAD
from manytouch.errors import ManytouchError

MOST_PARTS = 1000
"""Largest number of parts of a message that is written at once; a little less than systems allow."""
PIPE_BYTES = 1 << 20
"""So that a message is written at once, where the system allows it (Linux)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused:
    """An error that has ended the process.

    Attributes:
        kind: class of the error.
        sentence: its message.
        trace: where it was raised, as text, which is shown to those who search for the cause.
    """

    kind: type[ManytouchError]
    sentence: str
    trace: str


class ChildProcess:
    """A process that runs a module of this package, apart from the terminal: Ctrl-C does not reach it.

    Its BLAS has one thread, whatever is imported first here.
    It ends by itself when its standard input is closed, as it is when this process ends, in whatever way.

    Attributes:
        pid: number of the process.
    """

    def __init__(self, module: str, *, is_background: bool = False) -> None:
        """Start it.

        Args:
            module: its name; it is run as a program and calls `pipes_to_parent`.
            is_background: whether it is less important than this process. On POSIX systems it sets its
                priority itself.
        """
        detached: dict[str, Any] = {"start_new_session": True}
        if sys.platform == "win32":
            lower = subprocess.BELOW_NORMAL_PRIORITY_CLASS if is_background else 0
            detached = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | lower}
        paths = os.pathsep.join(path for path in sys.path if path)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": paths},
            bufsize=0,
            **detached,
        )
        self.pid = self._process.pid
        self._to_child = cast(io.FileIO, self._process.stdin)
        self._from_child = cast(io.BufferedReader, io.BufferedReader(cast(io.FileIO, self._process.stdout)))
        if sys.platform == "linux":
            import fcntl

            for pipe in (self._to_child, self._from_child):
                with suppress(OSError):
                    fcntl.fcntl(pipe.fileno(), fcntl.F_SETPIPE_SZ, PIPE_BYTES)

    def send(self, value: object) -> None:
        """Send a value.

        Raises:
            OSError: the process has ended.
        """
        if self._to_child.closed:
            raise BrokenPipeError("the process has been ended")
        send(self._to_child, value)

    def receive(self) -> Any:
        """Wait for a value; None if the process has ended."""
        return receive(self._from_child)

    def end(self, timeout_s: float) -> str:
        """Close its standard input and wait until it has ended; its exit status, in words."""
        with suppress(OSError):
            self._to_child.close()
        try:
            status = self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            status = self._process.wait()
        return f"exit status {status}"

    def close(self) -> None:
        """Close the pipe of its answers; after `end`."""
        self._from_child.close()


def pipes_to_parent() -> tuple[BufferedReader, FileIO]:
    """What the parent sends, and where answers to it go, in a process that `ChildProcess` has started.

    What libraries print goes to standard error from then on, as it is no answer.
    """
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return os.fdopen(sys.stdin.fileno(), "rb", closefd=False), answers


def refusal(error: Exception, kind: type[ManytouchError]) -> Refused:
    """The message about an error; one that no user has caused is an internal error of a kind."""
    trace = "".join(traceback.format_exception(error))
    if isinstance(error, ManytouchError):
        return Refused(kind=type(error), sentence=str(error), trace=trace)
    sentence = f"internal error: {type(error).__name__}: {error}; please report it"
    return Refused(kind=kind, sentence=sentence, trace=trace)


def error_of(refused: Refused, process: str) -> ManytouchError:
    """The error that a process had; a note on it states where, for --debug.

    Args:
        refused: its message.
        process: what it is, such as "the process of the outputs".
    """
    error = refused.kind.__new__(refused.kind)  # some are made of other arguments than their sentence
    error.args = (refused.sentence,)
    error.add_note(f"In {process}:\n{refused.trace}")
    return error


def send(to: FileIO, value: object) -> None:
    """Write a value to an unbuffered file; arrays are not copied before.

    Raises:
        OSError: the other end is closed.
    """
    arrays: list[pickle.PickleBuffer] = []
    pickled = pickle.dumps(value, pickle.HIGHEST_PROTOCOL, buffer_callback=arrays.append)
    contents = [memoryview(pickled), *(array.raw() for array in arrays)]
    heading = [len(contents), *(len(each) for each in contents)]
    parts = [memoryview(struct.pack(f"<{len(heading)}Q", *heading)), *contents]
    written = os.writev(to.fileno(), parts) if len(parts) <= MOST_PARTS and hasattr(os, "writev") else 0
    if written < sum(len(part) for part in parts):
        rest = memoryview(b"".join(parts))[written:]
        while rest:
            rest = rest[to.write(rest) or 0 :]


def receive(source: BufferedReader) -> Any:
    """Read a value from a buffered file; None if the other end is closed. Its arrays are read-only."""
    try:
        (count,) = _numbers(source, 1)
        pickled, *arrays = [_bytes(source, length) for length in _numbers(source, count)]
    except EOFError:
        return None
    return pickle.loads(pickled, buffers=arrays)


def _numbers(source: BufferedReader, count: int) -> tuple[int, ...]:
    return struct.unpack(f"<{count}Q", _bytes(source, 8 * count))


def _bytes(source: BufferedReader, length: int) -> bytes:
    data = source.read(length)
    if len(data) < length:
        raise EOFError
    return data
