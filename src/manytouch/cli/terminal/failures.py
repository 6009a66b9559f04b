"""Errors as one line on stderr, with a traceback if --debug is given."""

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from manytouch.errors import ManytouchError

if TYPE_CHECKING:
    from cyclopts import CycloptsError

DEBUG_FLAG = "--debug"


def report(error: Exception, place: str = "") -> None:
    """Print an error on stderr; `place` is printed before it, such as "--hdf5: "."""
    if DEBUG_FLAG in sys.argv:
        traceback.print_exception(error)
    print(f"manytouch: {place}{one_line(_message(error))}", file=sys.stderr)


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
