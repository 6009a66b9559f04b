"""Errors as one line on stderr, with a traceback if --debug is given; also that of standard output."""

import errno
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from manytouch.errors import ManytouchError

if TYPE_CHECKING:
    from cyclopts import CycloptsError

DEBUG_FLAG = "--debug"
FAILED = 1
_OF_WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG, errno.EPIPE)


def report(error: Exception, place: str = "") -> None:
    """Print an error on stderr; `place` is printed before it, such as "--hdf5: "."""
    if DEBUG_FLAG in sys.argv:
        traceback.print_exception(error)
    print(f"manytouch: {place}{one_line(_message(error))}", file=sys.stderr)


def flushed(status: int, error: BaseException | None = None) -> int:
    """The exit status of a command after its standard output is flushed; `FAILED` if that fails.

    What cannot be printed is dropped. The reason is printed on stderr, except that the reader, such as
    `head`, has closed its end.

    Args:
        status: if everything could be printed.
        error: that has ended the command. If an error of writing caused it, a line break is printed, which
            shows whether that was of standard output: unbuffered, nothing is left to be flushed.
    """
    if sys.stdout is None or sys.stdout.closed:
        return status
    try:
        if _is_of_writing(error):
            sys.stdout.write("\n")
        sys.stdout.flush()
    except OSError as failed:
        _drop_output()
        if not isinstance(failed, BrokenPipeError):
            print(
                f"manytouch: cannot print to standard output ({failed.strerror or failed}): free some space "
                "there, or send it elsewhere",
                file=sys.stderr,
            )
        return FAILED
    return status


def _is_of_writing(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, OSError) and error.errno in _OF_WRITING:
            return True
        error = error.__cause__ or error.__context__
    return False


def _drop_output() -> None:
    """Send to nowhere what standard output still has: Python writes it when the process ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
    sys.stdout.flush()


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
