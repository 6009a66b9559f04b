"""Lines of text about the outputs of a session."""

from collections.abc import Callable

from manytouch.values import Health
from manytouch.values.arrays import count_of


def print_outputs(health: Health, report: Callable[[str], None]) -> None:
    """One line for each output: what was sent and dropped, and what is wrong with it."""
    for output in health.outputs:
        problem = "" if output.status == "ok" else f"; {output.status}"
        report(f"{output.name}: {count_of(output.sent, 'reading')} sent, {output.dropped} dropped{problem}")
