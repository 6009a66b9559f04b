"""Outputs of a session: whether their paths can be written, and lines of text about them."""

from collections.abc import Callable
from pathlib import Path

from manytouch.values import Health
from manytouch.values.arrays import count_of


def print_outputs(health: Health, report: Callable[[str], None]) -> None:
    """One line for each output: what was sent and dropped, and what is wrong with it."""
    for output in health.outputs:
        problem = "" if output.problem is None else f"; {output.problem}"
        report(f"{output.name}: {count_of(output.sent, 'reading')} sent, {output.dropped} dropped{problem}")


def check_outputs(folder: Path | None, recording: Path | None) -> None:
    """Check, before anything is computed, that a folder of results and a recording can be written.

    Raises:
        OutputError: one of them cannot.
    """
    from manytouch.sinks.files.atomic_output import check_file_writable, check_writable

    if folder is not None:
        check_writable(folder)
    if recording is not None:
        check_file_writable(recording)
