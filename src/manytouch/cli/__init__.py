"""The command line: one module per command, which parses, calls the package and prints.

No computation is in here; all of it is available in Python too.

Exit status: 0 done, also after Ctrl-C; 1 the work failed; 2 the command line is wrong; 143 ended by SIGTERM.
"""

import os
import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError, UnknownCommandError, UnusedCliTokensError

import manytouch
from manytouch.blas_threads import request_one_blas_thread
from manytouch.cli.terminal.failures import DEBUG_FLAG, one_line, report
from manytouch.cli.terminal.interrupt import TERMINATED, StopOnSignal

request_one_blas_thread()  # before anything imports numpy

DONE, FAILED, WRONG_COMMAND_LINE = 0, 1, 2

EPILOGUE = """\
--debug, anywhere on the line, prints the traceback of an error.

Exit status: 0 done, 1 the command failed (one line on stderr gives the cause and
the remedy), 2 the command line is wrong.
"""

# Name: function or app, and the first sentence of its help, which the list of commands shows without
# importing the command.
COMMANDS = {
    "demo": (
        "demo:demo",
        "Press a simulated sensor with several fingers, and estimate the contacts from its images.",
    ),
    "process": (
        "process:process",
        "Process every frame of recordings of a dotted sheet; write contacts, markers and a summary.",
    ),
    "batch": ("batch:batch", "Process many recordings, and gather their contacts in two tables."),
    "run": ("run:run", "Process a source live and print the contacts as they start and end."),
    "view": (
        "view:view",
        "Play back a recording, a video or images in the viewer, with a timeline, until Ctrl-C.",
    ),
    "recording": ("recordings.recording:app", "Check and repair recordings."),
    "doctor": (
        "doctor:doctor",
        "Diagnose this installation and, if a source is given, how well it can be processed.",
    ),
    "evaluate": (
        "evaluate:evaluate",
        "Compare results with ground truth: dots, depth, contacts, forces, two-point resolution, latency.",
    ),
    "explain": (
        "explain:explain",
        "Explain the method of the paper on one frame: a page with a picture of every step.",
    ),
    "export": (
        "recordings.export:export",
        "Write recordings in the formats of other programs; without an option, list the formats.",
    ),
    "simulate": ("simulate:simulate", "Simulate a scene file; write images, sensor file and ground truth."),
    "calibrate": ("calibrate:app", "Calibrate camera, layout and sheet."),
    "design": (
        "design:design",
        "Choose sheet, markers and camera position; write a sensor file and printable parts.",
    ),
}


def application(words: Sequence[str]) -> App:
    """The commands, of which only those named in `words` are imported."""
    app = App(
        name="manytouch",
        help="Estimate every contact on a soft dotted sheet from one camera: position, depth and force.",
        help_epilogue=EPILOGUE,
        version=manytouch.__version__,
        help_format="plaintext",
        suppress_keyboard_interrupt=False,
    )
    for name, (path, summary) in COMMANDS.items():
        # a help given here would replace the whole help of the command
        app.command(f"manytouch.cli.{path}", name=name, help=None if name in words else summary)
    app.register_install_completion_command(help="Install completion for the shell that calls this.")
    return app


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status.

    Args:
        arguments: words after the name of the program; None: those of this process.
    """
    StopOnSignal.is_terminated = False
    words = [word for word in (sys.argv[1:] if arguments is None else arguments) if word != DEBUG_FLAG]
    try:
        return _status(
            application(words)(words, exit_on_error=False, print_error=False, result_action="return_value")
        )
    except CycloptsError as error:
        return _report_usage(error)
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return _status(DONE)
    except BrokenPipeError:  # the reader of the output, such as `head`, has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except Exception as error:  # noqa: BLE001 - reported in one line
        report(error)
        return FAILED


def _status(result: object) -> int:
    status = result if isinstance(result, int) else DONE
    return TERMINATED if status == DONE and StopOnSignal.is_terminated else status


def _report_usage(error: CycloptsError) -> int:
    help_line = " ".join(("manytouch", *(error.command_chain or ()), "--help"))
    print(f"manytouch: {_usage_error(error)}; see {help_line}", file=sys.stderr)
    return WRONG_COMMAND_LINE


def _usage_error(error: CycloptsError) -> str:
    if isinstance(error, UnusedCliTokensError):
        return f"unexpected words: {' '.join(error.unused_tokens or ())} (list all inputs before the options)"
    sentence = one_line(str(error))
    if isinstance(error, UnknownCommandError) and error.app is not None:
        known = ", ".join(name for name in error.app if not name.startswith("-"))
        return f"{sentence.partition(' Available')[0]} The commands are {known}"
    return sentence.rstrip(".")
