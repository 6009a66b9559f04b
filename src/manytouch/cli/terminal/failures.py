"""Errors as one line on stderr, with a traceback if --debug is given; also that of standard output."""

import io
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ClassVar

from manytouch.errors import ManytouchError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer
    from cyclopts import CycloptsError

DEBUG_FLAG = "--debug"
FAILED = 1


def report(error: Exception, place: str = "") -> None:
    """Print an error on stderr; `place` is printed before it, such as "--hdf5: "."""
    if DEBUG_FLAG in sys.argv:
        traceback.print_exception(error)
    print(f"manytouch: {place}{one_line(_message(error))}", file=sys.stderr)


class StandardOutput(io.FileIO):
    """Standard output that drops what cannot be printed, so that the command still completes its files.

    Attributes:
        error: the first of printing; None while there is none.
    """

    error: ClassVar[OSError | None] = None

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write, or drop the data if that failed once."""
        if StandardOutput.error is None:
            try:
                return super().write(data)
            except OSError as error:
                StandardOutput.error = error
        return memoryview(data).nbytes


def complete_without_output() -> None:
    """Let errors of standard output, such as a full disk or `| head`, not end the command."""
    given = sys.stdout
    if not isinstance(given, io.TextIOWrapper) or given is not sys.__stdout__:
        return
    raw = given.buffer.raw if isinstance(given.buffer, io.BufferedWriter) else given.buffer
    if type(raw) is not io.FileIO:
        return
    own: Any = StandardOutput(given.fileno(), "wb", closefd=False)
    sys.stdout = io.TextIOWrapper(
        own if raw is given.buffer else io.BufferedWriter(own),
        encoding=given.encoding,
        errors="replace",
        line_buffering=given.line_buffering,
        write_through=given.write_through,
    )


def has_no_reader() -> bool:
    """Whether what reads the standard output, such as `head`, has ended."""
    return isinstance(StandardOutput.error, BrokenPipeError)


def flushed(status: int) -> int:
    """The exit status of a command after its standard output is flushed.

    It is `FAILED` if something could not be printed, for which the reason is printed on stderr. That nobody
    reads any more, as after `| head`, is no failure.

    Args:
        status: if everything could be printed.
    """
    if sys.stdout is None or sys.stdout.closed:
        return status
    sys.stdout.flush()
    error = StandardOutput.error
    if error is None or has_no_reader():
        return status
    print(
        f"manytouch: cannot print to standard output ({error.strerror or error}): free some space "
        "there, or send it elsewhere",
        file=sys.stderr,
    )
    return FAILED


def usage_error(verb: str, sentence: str) -> "CycloptsError":
    """An error of the command line, which ends with status 2 and a reference to the help of the command."""
    from cyclopts import CycloptsError

    return CycloptsError(msg=sentence, command_chain=tuple(verb.split()))


@contextmanager
def usage_errors(verb: str) -> Iterator[None]:
    """Report what is wrong with the words of the command line as an error of it.

    Raises:
        CycloptsError: instead of any ManytouchError inside.
    """
    try:
        yield
    except ManytouchError as error:
        raise usage_error(verb, str(error)) from error


def one_line(text: str) -> str:
    """The text without line breaks and repeated spaces."""
    return " ".join(text.split())


def _message(error: Exception) -> str:
    if isinstance(error, ManytouchError):
        return str(error)
    return (
        f"internal error: {type(error).__name__}: {error}; "
        f"please report it with the output of the same command with {DEBUG_FLAG}"
    )
