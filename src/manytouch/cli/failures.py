"""How an error reaches the user: one clear line on stderr, and a traceback only with --debug."""

import sys
import traceback

from manytouch.errors import ManytouchError

DEBUG_FLAG = "--debug"


def report(error: Exception) -> None:
    """Print what went wrong and what to do."""
    if DEBUG_FLAG in sys.argv:
        traceback.print_exception(error)
    print(f"manytouch: {one_line(_sentence(error))}", file=sys.stderr)


def one_line(text: str) -> str:
    """The text without line breaks and runs of blanks."""
    return " ".join(text.split())


def _sentence(error: Exception) -> str:
    if isinstance(error, ManytouchError):
        return str(error)
    return (
        f"this should not happen: {type(error).__name__}: {error}; "
        f"run again with {DEBUG_FLAG} and report what it prints"
    )
