"""Output paths and packages are checked before anything is computed."""

from dataclasses import replace
from pathlib import Path

import pytest

from manytouch.cli import main
from manytouch.cli.terminal.outputs import print_outputs
from manytouch.values import OutputState
from viewer_session import HEALTH


@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", "camera", "absent.png", "--board", "chessboard:9x6", "--square-mm", "25", "--out"],
        ["calibrate", "rest", "absent.mp4", "--sensor", "gelsight-mini", "--out"],
        ["calibrate", "sheet", "absent.csv", "--sensor", "gelsight-mini", "--out"],
        ["calibrate", "sheet", "--sensor", "gelsight-mini", "--plan"],
        ["design", "--area-mm", "60,40", "--force-N", "0.2,6", "--out"],
        ["design", "--paper", "--out"],
        ["process", "absent.mp4", "--out"],
        ["run", "absent.mp4", "--no-view", "--out"],
        ["run", "absent.toml", "--no-view", "--out"],
        ["batch", "absent.mp4", "--out"],
        ["demo", "--no-view", "--out"],
        ["evaluate", "--quick", "--out"],
        ["explain", "absent.mp4", "--out"],
        ["export", "absent.mcap", "--hdf5"],
    ],
)
def test_a_path_that_cannot_be_written_is_refused_before_anything_is_read(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert main([*words, str(tmp_path / "file" / "out.toml")]) == 1
    assert "file is a file, not a folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_recordings_are_refused_first_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    path = str(tmp_path / "file" / "out.mcap")
    assert main(["run", "absent.mp4", "--no-view", "--record", path]) == 1
    assert "file is a file, not a folder" in capsys.readouterr().err


def test_a_folder_is_not_a_sensor_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["calibrate", "rest", "absent.mp4", "--sensor", "gelsight-mini", "--out", str(tmp_path)]
    assert main(words) == 1
    assert "it is a folder" in capsys.readouterr().err


def test_what_is_sent_over_udp_is_not_called_received() -> None:
    lines: list[str] = []
    outputs = tuple(
        OutputState(name=name, sent=3, dropped=1, problem=None) for name in ("osc://h:1", "ros2://skin")
    )
    print_outputs(replace(HEALTH, outputs=outputs), lines.append)
    assert lines == [
        "osc://h:1: 3 readings sent (over UDP, which does not report what arrived), 1 dropped",
        "ros2://skin: 3 readings sent, 1 dropped",
    ]


def test_design_without_its_packages_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("manytouch.design.write.find_spec", lambda name: None if name == "trimesh" else name)
    assert main(["design", "--area-mm", "60,40", "--force-N", "0.2,6", "--out", str(tmp_path / "my")]) == 1
    assert "manytouch[parts]" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_repair_refuses_a_copy_that_cannot_be_written_before_it_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, existing = tmp_path / "press.mcap", tmp_path / "file"
    recording.write_bytes(b"")
    existing.write_text("", encoding="utf-8")
    monkeypatch.setattr(
        "manytouch.recording.repair.repair", lambda *_: pytest.fail("it was read before the path was checked")
    )
    for out, words in (
        (existing / "out.mcap", "file is a file, not a folder"),
        (tmp_path, "it is a folder"),
        (existing, "exists already: choose another name with --out"),
    ):
        assert main(["recording", "repair", str(recording), "--out", str(out)]) == 1
        assert words in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "press.mcap"]
