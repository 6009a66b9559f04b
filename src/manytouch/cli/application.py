"""The parser of the command line, and what its errors are printed as."""

import sys
from collections.abc import Sequence
from inspect import Parameter, signature
from itertools import pairwise

from cyclopts import App, CycloptsError, UnknownCommandError, UnusedCliTokensError

import manytouch
from manytouch.cli import COMMANDS, OPTIONS, SUMMARY
from manytouch.cli.terminal.failures import FAILED, flushed, one_line, report, usage_error
from manytouch.cli.terminal.interrupt import TERMINATED, StopOnSignal

DONE, WRONG_COMMAND_LINE = 0, 2


def application(words: Sequence[str]) -> App:
    """The commands, of which only those named in `words` are imported."""
    app = App(
        name="manytouch",
        help=SUMMARY,
        version=manytouch.__version__,
        help_format="plaintext",
        suppress_keyboard_interrupt=False,
    )
    for name, (path, summary) in COMMANDS.items():
        # a help given here would replace the whole help of the command
        app.command(f"manytouch.cli.{path}", name=name, help=None if name in words else summary)
    app.register_install_completion_command(help=OPTIONS["--install-completion"])
    return app


def run(words: list[str]) -> int:
    """Run a command and return the exit status.

    Args:
        words: those after the name of the program.
    """
    StopOnSignal.is_terminated = False
    try:
        _refuse_empty_words(words)
        result = application(words)(
            list(words), exit_on_error=False, print_error=False, result_action="return_value"
        )
        return flushed(_status(result))
    except CycloptsError as error:
        return _report_usage(error)
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return _status(DONE)
    except Exception as error:  # noqa: BLE001 - reported in one line
        report(error)
        return flushed(FAILED)


def _refuse_empty_words(words: Sequence[str]) -> None:
    """Refuse an empty path, which would be the current folder, and other values without a character.

    Raises:
        CycloptsError: a word is empty, or the value of an option is.
    """
    for before, word in pairwise(["", *words]):
        option, equals, value = word.partition("=")
        is_empty_value = option.startswith("--") and equals and not value
        if not word or is_empty_value:
            after = option if is_empty_value else before
            place = f" after {after}" if after.startswith("-") else ""
            verb = " ".join(each for each in words[:1] if each in COMMANDS)
            raise usage_error(verb, f"there is an empty word{place}: give a path or a value, or omit it")


def _status(result: object) -> int:
    status = result if isinstance(result, int) else DONE
    return TERMINATED if status == DONE and StopOnSignal.is_terminated else status


def _report_usage(error: CycloptsError) -> int:
    help_line = " ".join(("manytouch", *(error.command_chain or ()), "--help"))
    print(f"manytouch: {_usage_error(error)}; see {help_line}", file=sys.stderr)
    return WRONG_COMMAND_LINE


def _inputs_of(error: CycloptsError) -> str:
    """What words without an option a command takes, and where."""
    words = [] if error.target is None else list(signature(error.target).parameters.values())
    words = [word for word in words if word.kind is Parameter.POSITIONAL_ONLY]
    if any("list[" in str(word.annotation) for word in words):
        return "list all inputs before the options"
    verb, count = " ".join(error.command_chain or ()), len(words)
    return f"{verb} takes {('no input', 'one input only')[count] if count < 2 else f'{count} inputs only'}"


def _usage_error(error: CycloptsError) -> str:
    if isinstance(error, UnusedCliTokensError):
        return f"unexpected words: {' '.join(error.unused_tokens or ())} ({_inputs_of(error)})"
    sentence = one_line(str(error))
    if isinstance(error, UnknownCommandError) and error.app is not None:
        known = ", ".join(name for name in error.app if not name.startswith("-"))
        return f"{sentence.partition(' Available')[0]} The commands are {known}"
    return sentence.rstrip(".")
