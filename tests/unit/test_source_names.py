"""What the name of a source is, read without opening it."""

import subprocess
import sys
from pathlib import Path

import pytest

from manytouch.errors import SourceError
from manytouch.source_names import require_existing, require_file


def test_what_is_no_path_or_exists_is_accepted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hand.mcap").touch()
    (tmp_path / "a#b.mp4").touch()
    names = ("0", "/dev/video9", "rtsp://host/x", "sim:", "sim:nothing", "hand.mcap", "hand.mcap#index", "")
    require_existing([*names, "a#b.mp4", str(tmp_path), "views:0,hand.mcap"])


@pytest.mark.parametrize("name", ["gone.mp4", "gone.mcap#index", "views:here.mp4,gone.mp4", "nowhere/a.mp4"])
def test_a_missing_path_is_refused_with_what_to_do(name, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here.mp4").touch()
    with pytest.raises(SourceError, match=r"There is no '.*(check the path\.|did you mean 'here.mp4'\?)$"):
        require_existing([name])


def test_a_name_that_no_file_can_have_is_refused() -> None:
    with pytest.raises(SourceError, match="cannot be read: "):
        require_existing(["x" * 5000])


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"is a folder: give a recording \(\.mcap\)\."):
        require_file(tmp_path, "a recording (.mcap)")


@pytest.mark.parametrize(
    "words",
    [
        ["process", "gone", "--out", "results"],
        ["process", "gone", "gone-too", "--out", "results"],
        ["run", "gone", "--no-view"],
        ["view", "gone"],
        ["doctor", "gone"],
        ["explain", "gone", "--out", "results"],
        ["recording", "check", "gone"],
        ["recording", "repair", "gone"],
        ["calibrate", "rest", "gone", "--sensor", "s.toml", "--out", "o.toml"],
        ["calibrate", "sheet", "gone", "--sensor", "s.toml", "--out", "o.toml"],
        ["export", "gone", "--parquet", "results"],
    ],
    ids=" ".join,
)
def test_commands_refuse_a_missing_path_before_they_import_what_computes(words, tmp_path: Path) -> None:
    program = (
        "import sys; from manytouch.cli import main; status = main(sys.argv[1:]); "
        "print(status, 'numpy' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert done.stderr.startswith("manytouch: There is no 'gone' in the folder ")
    assert done.stdout.splitlines()[-1] == "1 False"
    assert not list(tmp_path.iterdir())
