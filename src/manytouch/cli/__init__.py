"""The command line: one module per command, which parses, calls the package and prints.

No computation is in here; all of it is available in Python too.

Exit status: 0 done, also after Ctrl-C; 1 the work failed; 2 the command line is wrong; 143 ended by SIGTERM.
"""

import gc
import io
import shutil
import sys
import textwrap
from collections.abc import Sequence

from manytouch.blas_threads import request_one_blas_thread
from manytouch.cli.terminal.failures import DEBUG_FLAG, complete_without_output, flushed

request_one_blas_thread()  # before anything imports numpy

SUMMARY = "Estimate every contact on a soft dotted sheet from one camera: position, depth and force."

OBJECTS_PER_COLLECTION = 100_000
"""Importing makes several 100 000 objects that stay; each search through them for garbage takes time."""

EPILOGUE = """\
manytouch COMMAND --help describes the options of a command.
--debug, anywhere on the line, prints the traceback of an error.

Exit status: 0 done, 1 the command failed (one line on stderr gives the cause and
the remedy), 2 the command line is wrong."""

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
    "calibrate": ("calibrate:app", "Calibrate camera, rest and sheet."),
    "design": (
        "design:design",
        "Choose sheet, markers and camera position; write a sensor file and printable parts.",
    ),
}

OPTIONS = {
    "--help, -h": "Display this list.",
    "--install-completion": "Install completion for the shell that calls this.",
    "--version": "Display the version.",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status.

    Args:
        arguments: words after the name of the program; None: those of this process.
    """
    words = [word for word in (sys.argv[1:] if arguments is None else arguments) if word != DEBUG_FLAG]
    complete_without_output()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal may lack ± and letters of names
    if words in ([], ["--help"], ["-h"]):  # without the parser, whose import takes longer than a user expects
        print(_overview(shutil.get_terminal_size().columns))
        return flushed(0)
    gc.set_threshold(OBJECTS_PER_COLLECTION, 10, 10)
    try:
        from manytouch.cli.application import run
    except KeyboardInterrupt:  # importing takes a tenth of a second
        print("stopped", file=sys.stderr)
        return 0
    return run(words)


def _overview(columns: int) -> str:
    """The commands and the options that belong to none, in lines of at most so many characters."""
    width = max(40, min(columns, 100))
    indent = max(map(len, [*COMMANDS, *OPTIONS])) + 4
    listed = [(name, summary) for name, (_, summary) in sorted(COMMANDS.items())]

    def table(rows: Sequence[tuple[str, str]]) -> str:
        return "\n".join(
            textwrap.fill(
                summary,
                width,
                initial_indent=f"  {name:{indent - 2}}",
                subsequent_indent=" " * indent,
                break_on_hyphens=False,
            )
            for name, summary in rows
        )

    return "\n\n".join(
        (
            "Usage: manytouch COMMAND",
            textwrap.fill(SUMMARY, width),
            f"Commands:\n{table(listed)}",
            f"Options:\n{table(tuple(OPTIONS.items()))}",
            EPILOGUE,
        )
    )
