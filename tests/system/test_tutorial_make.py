"""The page "From nothing to newtons": its files and commands, in their order, in an empty folder."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from manytouch.cli import main
from manytouch.design.parts import pictures
from manytouch.values.sensor_file.read import load_sensor

PAGE = Path(__file__).parents[2] / "docs" / "from-nothing-to-newtons.md"


def commands() -> list[str]:
    """The lines of the blocks without a language."""
    if not PAGE.is_file():
        pytest.skip("the pages come with the repository, not with the wheel")
    text = PAGE.read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [line for language, block in blocks if not language for line in block.strip().splitlines()]


def run_page(capsys: pytest.CaptureFixture[str]) -> str:
    """Runs all commands of the page as printed, the scenes with fewer frames; returns what they print."""
    output = []
    for line in commands():
        program, *arguments = line.split()
        assert program == "manytouch"
        status = main(arguments)
        printed = capsys.readouterr()
        assert status == 0, f"{line}\n{printed.out}{printed.err}"
        output.append(printed.out)
        if arguments[0] == "design":
            for name, fps in {"presses": 10, "touches": 15}.items():
                scene = Path(f"my-sensor/scenes/{name}.toml")
                scene.write_text(f"fps = {fps}\n{scene.read_text()}")
    return "\n".join(output)


@pytest.mark.slow
def test_every_command_of_the_page_runs_and_ends_in_newtons(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pictures, "SAMPLES_PER_PX", 0.3)
    output = run_page(capsys)
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
    assert 0.0 < made.sheet.outline_std_mm < 0.3  # the outline is fitted to the presses
    np.testing.assert_allclose(made.sheet.size_mm, [80.0, 60.0], atol=2.0 * made.sheet.outline_std_mm)
    assert made.sheet.young_MPa == pytest.approx(designed.sheet.young_MPa, rel=0.15)
    for frame in (21, 36):  # one touch, then the other
        (true,), (found,) = (held(tmp_path / place, frame) for place in ("touched/truth", "results/frames"))
        assert found[:2] == pytest.approx(true[:2], abs=0.3)
        assert found[2] == pytest.approx(true[2], rel=0.05)


def held(folder: Path, frame: int) -> list[tuple[float, float, float]]:
    """x, y and force of the contacts in a frame."""
    with (folder / "contacts.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["frame"] == str(frame)]
    return [(float(row["x_mm"]), float(row["y_mm"]), float(row["normal_force_N"])) for row in rows]
