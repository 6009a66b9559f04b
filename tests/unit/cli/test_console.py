"""What is printed at the end of a run."""

from collections import Counter

import pytest

from layouts import lattice_layout
from manytouch.cli.terminal.console import Steps, describe_results
from manytouch.session import pipeline_for
from manytouch.sinks.files.summary import Summary
from manytouch.values import Sensor, Status
from straight import straight_camera


@pytest.mark.parametrize(
    ("ok", "words"), [(100, "no contact in any frame"), (50, "no contact in any frame"), (49, "not valid")]
)
def test_few_valid_frames_are_not_called_untouched(ok: int, words: str) -> None:
    sensor = Sensor(
        name="bench",
        camera=straight_camera(320, 240, focal_px=400.0, distance_mm=50.0),
        layout=lattice_layout(4, 6, (5.0, 4.0), radius_mm=0.8, polarity="dark"),
    )
    summary = Summary(sensor=sensor, pipeline=pipeline_for("paper"), method="paper", recording={})
    summary._status = Counter({Status.OK: ok, Status.FEW_MARKERS: 100 - ok})
    assert any(words in line for line in describe_results(summary))


def test_steps_are_lines_without_a_terminal_and_a_bar_on_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for is_terminal in (False, True):
        steps = Steps()
        monkeypatch.setattr(type(steps._console), "is_terminal", is_terminal)
        if is_terminal:
            steps = Steps()  # with a bar that is shown
        with steps:
            show = steps.follow(total=2)
            show("first")
            show("second")
            (task,) = steps._bar.tasks
            assert (task.completed, task.total) == ((2, 2) if is_terminal else (0, 2))
            assert list(steps.count("frames", iter("abc"), None)) == ["a", "b", "c"]
        printed = capsys.readouterr().out
        assert ("  first\n  second\n" in printed) is not is_terminal
