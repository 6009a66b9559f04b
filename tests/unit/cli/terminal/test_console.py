"""What is printed at the end of a run."""

from dataclasses import replace

import pytest
from rich.console import Console

from manytouch.cli.terminal.console import Steps, describe_results
from manytouch.session import pipeline_for
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.files.summary import Summary
from manytouch.values import Contacts, Status
from viewer_session import reading_of


@pytest.mark.parametrize(
    ("ok", "words"), [(10, "no contact in any frame"), (5, "no contact in any frame"), (4, "not valid")]
)
def test_few_valid_frames_are_not_called_untouched(ok: int, words: str) -> None:
    summary = Summary(
        sensor=demo_sensor(320), pipeline=pipeline_for("paper"), method="paper", recording={"source": "x.mp4"}
    )
    untouched = replace(reading_of(0), contacts=Contacts(contacts=()))
    few = replace(untouched, grid=replace(untouched.grid, status=Status.FEW_MARKERS))
    for number in range(10):
        summary.write(untouched if number < ok else few)
    assert any(words in line for line in describe_results(summary))


def test_steps_are_lines_without_a_terminal_and_a_bar_on_one(capsys: pytest.CaptureFixture[str]) -> None:
    for is_terminal in (False, True):
        steps = Steps(Console(highlight=False, soft_wrap=True, force_terminal=is_terminal))
        with steps:
            show = steps.step_reporter(total=2)
            show("first")
            show("second")
            (task,) = steps.bar.tasks
            assert (task.completed, task.total) == ((2, 2) if is_terminal else (0, 2))
            assert list(steps.count("frames", iter("abc"), None)) == ["a", "b", "c"]
        printed = capsys.readouterr().out
        assert ("  first\n  second\n" in printed) is not is_terminal
