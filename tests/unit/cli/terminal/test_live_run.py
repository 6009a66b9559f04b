"""A file stays open in the viewer after everything that is written of it is complete."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from clips import pressed_video
from manytouch.cli.terminal import live_run
from manytouch.cli.terminal.console import Reporter
from manytouch.cli.terminal.live_run import Outputs, run_live
from manytouch.cli.terminal.viewing import ViewerAddress
from manytouch.pipeline import Controls
from manytouch.recording.repair import check
from manytouch.session import Live, prepare
from manytouch.sinks import recorder
from manytouch.values import Reading, Seek
from results import rows_of

FRAMES = 60


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pressed_video(tmp_path_factory.mktemp("clips") / "press.avi")


class Page:
    """A viewer that keeps what it was given."""

    def __init__(self) -> None:
        self.readings: list[Reading] = []
        self.is_closed = False
        self.controls: Controls | None = None

    def start(self, controls: Controls, address: object, report: Callable[[str], None]) -> list["Page"]:
        self.controls = controls
        return [self]

    def write(self, reading: Reading) -> None:
        assert not self.is_closed
        self.readings.append(reading)

    def close(self) -> None:
        self.is_closed = True


def test_files_are_complete_before_the_timeline_is_shown(video, tmp_path, monkeypatch, capsys) -> None:
    page = Page()
    monkeypatch.setattr(live_run, "viewers", page.start)
    live = Live(prepare(video, fps=500.0), record=tmp_path / "press.mcap")
    complete: list[object] = []

    def is_over() -> bool:
        assert page.controls is not None
        health = page.controls.health()
        if health.frame_count is not None and not complete:
            assert not page.is_closed
            assert (health.frame_count, health.frame, health.is_running) == (FRAMES, FRAMES - 1, False)
            summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
            complete.extend((summary["complete"], check(tmp_path / "press.mcap").is_whole))
            page.controls.send(Seek(frame=FRAMES - 5))
        return len(page.readings) == 2 * FRAMES

    outputs = Outputs(to=(), address=ViewerAddress(), reporter=Reporter(bar=False))
    assert run_live(live, tmp_path / "out", outputs, is_over) == 0
    assert complete == [True, True]
    assert page.is_closed
    first, again = page.readings[:FRAMES], page.readings[FRAMES:]
    assert [each.frame.index for each in again] == list(range(FRAMES))
    # the same numbers of contacts as in the tables
    for one, other in zip(first, again, strict=True):
        assert [each.id for each in one.contacts.contacts] == [each.id for each in other.contacts.contacts]
    assert len(rows_of(tmp_path / "out" / "frames.csv")) == FRAMES
    printed = capsys.readouterr().out
    assert printed.index("results in") < printed.index("it stays open with a timeline until Ctrl-C")
    assert printed.count("#0 touches") == 1


@pytest.mark.parametrize("free", [5_000_000, 58_000_000_000])
def test_a_recording_without_a_frame_for_lack_of_space_is_stated_on_stderr(
    video, tmp_path, monkeypatch, capsys, free: int
) -> None:
    monkeypatch.setattr(recorder, "free_bytes", lambda path: free)
    monkeypatch.setattr(recorder, "RESERVE_BYTES", 60_000_000_000)
    live = Live(prepare(video, fps=500.0), record=tmp_path / "press.mcap")
    run_live(live, None, Outputs(to=(), address=None, reporter=Reporter(bar=False)), lambda: False)
    found = capsys.readouterr().err
    assert found.startswith("manytouch: the disk is full: press.mcap ended, when 0.000 MB were written")
    assert f"and {free // 10**6}{'.0' if free < 10**8 else ''} MB were free" in found
    assert found.endswith("; 0 frames were recorded\n")


def test_a_recording_is_not_stated_on_stderr(video, tmp_path, capsys) -> None:
    live = Live(prepare(video, fps=500.0), record=tmp_path / "press.mcap")
    run_live(live, None, Outputs(to=(), address=None, reporter=Reporter(bar=False)), lambda: False)
    assert capsys.readouterr().err == ""


def test_a_run_that_is_ended_early_does_not_stay(video, tmp_path, monkeypatch, capsys) -> None:
    page = Page()
    monkeypatch.setattr(live_run, "viewers", page.start)
    outputs = Outputs(to=(), address=ViewerAddress(), reporter=Reporter(bar=False))
    live = Live(prepare(video, fps=500.0))
    assert run_live(live, tmp_path / "out", outputs, lambda: len(page.readings) >= 10) == 0
    assert page.is_closed
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["complete"] is False
    assert "stays open" not in capsys.readouterr().out


def test_ctrl_c_ends_a_run_that_stays_with_status_0(video, tmp_path) -> None:
    pytest.importorskip("nicegui")
    words = ["run", str(video), "--fps", "500", "--out", str(tmp_path / "out"), "--record", "press.mcap"]
    with subprocess.Popen(
        [sys.executable, "-m", "manytouch", *words], stdout=subprocess.PIPE, text=True, cwd=tmp_path
    ) as session:
        assert session.stdout is not None
        lines = iter(session.stdout.readline, "")
        assert any("it stays open with a timeline" in line for line in lines)
        assert (tmp_path / "out" / "press" / "summary.json").is_file()
        assert check(tmp_path / "press.mcap").is_whole
        session.send_signal(signal.SIGINT)
        assert session.wait(30) == 0
