"""Outputs of a session: whether their paths can be written, and lines of text about them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from manytouch.cli.terminal.failures import usage_errors

if TYPE_CHECKING:
    from manytouch.pipeline import Controls
    from manytouch.sinks.output_process.process import OutputProcess
    from manytouch.sources import Source
    from manytouch.values import Health


UDP = ("osc://", "tuio://")


def described_outputs(
    urls: Sequence[str], controls: "Controls", report: Callable[[str], None]
) -> "list[OutputProcess]":
    """Start outputs, and print a line for each: what is sent where.

    Raises:
        ManytouchError: see `start_outputs`.
    """
    from manytouch.sinks.output_process.process import start_outputs

    outputs = start_outputs(urls, controls)
    for description in (each for output in outputs for each in output.descriptions):
        report(description)
    return outputs


def print_end_of_scene(source: "Source", report: Callable[[str], None]) -> None:
    """A line about the length of a simulated scene; nothing for other sources."""
    from manytouch.values.display.text import count_of

    if source.capabilities.truth is not None and source.frame_count:
        report(
            f"the scene ends after {count_of(source.frame_count, 'frame')}; `manytouch demo` stays open, "
            "can be pressed with the mouse, and takes --to"
        )


def print_outputs(health: "Health", report: Callable[[str], None]) -> None:
    """One line for each output: what was sent and dropped, and what is wrong with it."""
    from manytouch.values.display.text import count_of

    for output in health.outputs:
        problem = "" if output.problem is None else f"; {output.problem}"
        arrival = " (over UDP, which does not report what arrived)" if output.name.startswith(UDP) else ""
        sent = f"{count_of(output.sent, 'reading')} sent{arrival}"
        report(f"{output.name}: {sent}, {output.dropped} dropped{problem}")


def check_urls(verb: str, urls: Sequence[str]) -> None:
    """Check the addresses of --to.

    Raises:
        CycloptsError: one of them is wrong.
    """
    if not urls:
        return
    from manytouch.sinks.publishers.registry import check_addresses

    with usage_errors(verb):
        check_addresses(urls)


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
