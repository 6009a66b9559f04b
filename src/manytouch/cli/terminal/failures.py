"""How an error reaches the user: one clear line on stderr, and a traceback only with --debug."""

import sys
import traceback

from cyclopts import CycloptsError

from manytouch.errors import ManytouchError

DEBUG_FLAG = "--debug"


def report(error: Exception) -> None:
    """Print what went wrong and what to do."""
    if DEBUG_FLAG in sys.argv:
        traceback.print_exception(error)
    print(f"manytouch: {one_line(_sentence(error))}", file=sys.stderr)


def wrong_words(verb: str, sentence: str) -> CycloptsError:
    """An error of the command line itself, which ends with status 2 and names the verb's help."""
    return CycloptsError(msg=sentence, command_chain=tuple(verb.split()))


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
