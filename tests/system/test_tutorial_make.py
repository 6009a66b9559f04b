"""The page "From nothing to newtons": its files and commands, in their order, in an empty folder."""

import csv
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from boards import picture, poses
from manytouch.calibration.camera.board import parse_board
from manytouch.cli import main
from manytouch.values import Camera
from manytouch.values.sensor_file import load_sensor

PAGE = Path(__file__).parents[2] / "docs" / "from-nothing-to-newtons.md"
VIEWS = 15


def blocks() -> list[tuple[str, str]]:
    """Language and text of each fenced block; a file's first line is a comment with its name."""
    if not PAGE.is_file():
        pytest.skip("the pages come with the repository, not with the wheel")
    return re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def take_views(camera: Camera, folder: Path) -> None:
    """Pictures of the printed chessboard through the lens that the simulated sensor has."""
    folder.mkdir()
    board = parse_board("chessboard:9x6", 25.0)
    lens = replace(camera, rotation_vector=np.zeros(3), translation_mm=np.array([0.0, 0.0, 1.0]))
    for number, (turn, shift) in enumerate(poses(VIEWS, seed=3, board=board)):
        shown = picture(lens, board, (turn, shift * [1.0, 1.0, 1.15]), seed=number)
        cv2.imwrite(str(folder / f"{number:02}.png"), shown)


def run_page(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Runs all commands of the page in a folder, and returns what they print."""
    output = []
    for language, text in blocks():
        if language:
            name, body = text.split("\n", 1)
            (folder / name.removeprefix("# ")).write_text(body, encoding="utf-8")
            continue
        for line in text.strip().splitlines():
            program, *arguments = line.split()
            assert program == "manytouch"
            if arguments[:2] == ["calibrate", "camera"]:
                take_views(load_sensor(folder / "my-sensor" / "sensor.toml").camera, folder / "views")
            status = main(arguments)
            printed = capsys.readouterr()
            assert status == 0, f"{line}\n{printed.out}{printed.err}"
            output.append(printed.out)
    return "\n".join(output)


def test_every_command_of_the_page_runs_and_ends_in_newtons(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    output = run_page(tmp_path, capsys)
    for expected in (
        "15 x 20, every 4 mm",
        "clamped outline: 80 x 60 mm",
        "15 x 20 markers, 0 missing",
        "leave-one-out force error",
    ):
        assert expected in output
    designed, made = load_sensor(tmp_path / "my-sensor/sensor.toml"), load_sensor(tmp_path / "sensor.toml")
    assert made.camera.fx_px == pytest.approx(designed.camera.fx_px, rel=5e-3)
    assert made.camera.translation_mm[2] == pytest.approx(designed.camera.translation_mm[2], rel=5e-3)
    assert made.sheet.size_mm == pytest.approx([80.0, 60.0])
    assert 0.5 < made.sheet.young_MPa / designed.sheet.young_MPa < 2.0
    for frame in (20, 36):  # one press, then the other
        (true,), (found,) = (held(tmp_path / place, frame) for place in ("touched/truth", "results/frames"))
        assert found[:2] == pytest.approx(true[:2], abs=1.0)
        assert found[2] == pytest.approx(true[2], rel=0.25)


def held(folder: Path, frame: int) -> list[tuple[float, float, float]]:
    """x, y and force of the contacts in a frame."""
    with (folder / "contacts.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["frame"] == str(frame)]
    return [(float(row["x_mm"]), float(row["y_mm"]), float(row["normal_force_N"])) for row in rows]
