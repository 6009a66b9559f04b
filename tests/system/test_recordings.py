"""Recordings from the command line: made, replayed, processed again, cut off."""

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from clips import pressed_video
from manytouch.cli import main
from results import rows_of

pytest.importorskip("mcap")


@dataclass(frozen=True)
class Done:
    """A command that has ended."""

    returncode: int
    stdout: str
    stderr: str


class CommandLine:
    """Runs commands in this process, which has imported and compiled everything already."""

    def __init__(self, capture: pytest.CaptureFixture[str]) -> None:
        self._capture = capture

    def __call__(self, *words: object) -> Done:
        self._capture.readouterr()
        status = main([str(word) for word in words])
        printed = self._capture.readouterr()
        return Done(returncode=status, stdout=printed.out, stderr=printed.err)


@pytest.fixture
def manytouch(capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(capsys)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A recording of a run in a process of its own, and what the run printed."""
    folder = tmp_path_factory.mktemp("made")
    video = pressed_video(folder / "press.mp4")
    words = ["run", video, "--no-view", "--fps", 120, "--record", folder / "x.mcap", "--out", folder / "live"]
    done = subprocess.run(
        [sys.executable, "-m", "manytouch", *map(str, words)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / "x.mcap", done.stdout


def contact_lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if re.search(r"#0 (touches|gone)", line)]


def test_a_run_is_recorded_and_replayed_as_it_was(made: tuple[Path, str], manytouch: CommandLine) -> None:
    path, printed = made
    assert "recording x.mcap" in printed
    assert "recorded x.mcap; 60 frames were recorded" in printed
    again = manytouch("run", path, "--no-view")
    assert again.returncode == 0, again.stderr
    assert len(contact_lines(printed)) == 2
    assert contact_lines(again.stdout) == contact_lines(printed)


def test_a_recording_processed_gives_the_tables_of_the_run(
    made: tuple[Path, str], manytouch: CommandLine, tmp_path: Path
) -> None:
    path, _ = made
    done = manytouch("process", path, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    live = path.parent / "live" / "press"
    assert (tmp_path / "x" / "contacts.csv").read_bytes() == (live / "contacts.csv").read_bytes()
    assert (tmp_path / "x" / "markers.parquet").read_bytes() == (live / "markers.parquet").read_bytes()


def test_a_recording_that_was_cut_off_is_reported_and_its_whole_frames_are_processed(
    made: tuple[Path, str], manytouch: CommandLine, tmp_path: Path
) -> None:
    path, _ = made
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    done = manytouch("process", cut, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "cut.mcap was cut off" in done.stdout
    assert 10 < len(rows_of(tmp_path / "out" / "cut" / "frames.csv")) < 60
    again = manytouch("run", cut, "--no-view")
    assert again.returncode == 0, again.stderr
    assert "cut.mcap was cut off" in again.stdout


def test_a_recording_is_not_recorded_over_while_it_is_read(
    made: tuple[Path, str], manytouch: CommandLine, tmp_path: Path
) -> None:
    own = tmp_path / "own.mcap"
    own.write_bytes(made[0].read_bytes())
    done = manytouch("run", own, "--no-view", "--fps", "200", "--record", own)
    assert done.returncode == 1
    assert done.stderr.endswith("is the recording that is read: record under another name\n")
    assert own.read_bytes() == made[0].read_bytes()


def test_existing_recordings_are_kept_under_the_next_free_name(
    made: tuple[Path, str], manytouch: CommandLine, tmp_path: Path
) -> None:
    old = {"x.mcap": b"older", "x-1.mcap": b"oldest"}
    for name, content in old.items():
        (tmp_path / name).write_bytes(content)
    done = manytouch("run", made[0], "--no-view", "--fps", "500", "--record", tmp_path / "x.mcap")
    assert done.returncode == 0, done.stderr
    assert "the existing x.mcap was renamed to x-2.mcap" in done.stdout
    assert (tmp_path / "x-2.mcap").read_bytes() == b"older"
    assert (tmp_path / "x-1.mcap").read_bytes() == b"oldest"
    assert (tmp_path / "x.mcap").stat().st_size > 1000


def test_another_method_is_named(made: tuple[Path, str], manytouch: CommandLine, tmp_path: Path) -> None:
    path, _ = made
    done = manytouch("run", path, "--method", "paper", "--no-view", "--fps", "500", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert '"method": "paper"' in (tmp_path / "x" / "summary.json").read_text()


@pytest.mark.parametrize(
    "words", [("view", "absent.mcap"), ("run", "absent.mcap"), ("process", "0", "--out", "o")]
)
def test_what_cannot_be_opened_is_one_sentence(
    words: tuple[str, ...], manytouch: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = manytouch(*words)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "Traceback" not in done.stderr
