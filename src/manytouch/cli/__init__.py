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
from manytouch.cli import (
    batch,
    calibrate,
    demo,
    design,
    doctor,
    evaluate,
    explain,
    process,
    run,
    simulate,
    view,
)
from manytouch.cli.recordings import export, recording
from manytouch.cli.terminal.failures import DEBUG_FLAG, one_line, report
from manytouch.cli.terminal.interrupt import TERMINATED, StopOnSignal

request_one_blas_thread()  # before anything imports numpy

DONE, FAILED, WRONG_COMMAND_LINE = 0, 1, 2

EPILOGUE = """\
--debug, anywhere on the line, prints the traceback of an error.

Exit status: 0 done, 1 the command failed (one line on stderr gives the cause and
the remedy), 2 the command line is wrong.
"""

app = App(
    name="manytouch",
    help="Estimate every contact on a soft dotted sheet from one camera: position, depth and force.",
    help_epilogue=EPILOGUE,
    version=manytouch.__version__,
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
app.command(demo.demo)
app.command(process.process)
app.command(batch.batch)
app.command(run.run)
app.command(view.view)
app.command(recording.app)
app.command(doctor.doctor)
app.command(evaluate.evaluate)
app.command(explain.explain)
app.command(export.export)
app.command(simulate.simulate)
app.command(calibrate.app)
app.command(design.design)
app.register_install_completion_command(help="Install completion for the shell that calls this.")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status.

    Args:
        arguments: words after the name of the program; None: those of this process.
    """
    StopOnSignal.is_terminated = False
    words = [word for word in (sys.argv[1:] if arguments is None else arguments) if word != DEBUG_FLAG]
    try:
        return _status(app(words, exit_on_error=False, print_error=False, result_action="return_value"))
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
