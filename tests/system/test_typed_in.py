"""Presses typed in on a terminal, of one recording; and the table that is kept of them."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from manytouch.cli import main
from manytouch.design.choose import design_sensor
from manytouch.design.requirements import CameraSpecification, Requirements
from manytouch.session import prepare
from manytouch.sinks.recorder import Recorder
from manytouch.values import Sensor
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.write import save_sensor
from results import rows_of

pty = pytest.importorskip("pty", reason="there are pseudo-terminals on POSIX only")
pytest.importorskip("mcap")
PLACES = ((0, 0), (-14, -9), (14, -9), (-14, 9), (10, 0))
SCENE = """schema = 1
name = "presses"
seconds = 9.2
fps = 5.0
sensor = "sensor.toml"
mechanics = "shell"
[[bodies]]
shape = {{ kind = "round_punch", radius_mm = 4.0 }}
motions = [
{motions}]
"""
MOTION = (
    '{{ kind = "press", at_mm = [{x}, {y}], depth_mm = 2.5, start_s = {start}, end_s = {end}, '
    "ramp_s = 0.2 }},\n"
)


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Sensor]:
    """A folder with a sensor and presses.mcap, five presses held at 2.6, 4.0, 5.4, 6.8 and 8.2 s."""
    folder = tmp_path_factory.mktemp("pressed")
    camera = CameraSpecification(width_px=640, height_px=480, hfov_deg=60.0, least_focus_mm=30.0)
    sensor = design_sensor(
        Requirements(area_mm=(40.0, 25.0), force_N=(0.5, 4.0), thickness_mm=2.0, camera=camera)
    ).sensor
    save_sensor(sensor, folder / "sensor.toml")
    motions = "".join(
        MOTION.format(x=x, y=y, start=2.2 + 1.4 * number, end=2.9 + 1.4 * number)
        for number, (x, y) in enumerate(PLACES)
    )
    (folder / "presses.toml").write_text(SCENE.format(motions=motions))
    record(f"sim:{folder / 'presses.toml'}", folder / "presses.mcap")
    assert main(["simulate", str(folder / "presses.toml"), "--out", str(folder / "truth")]) == 0
    return folder, sensor


def record(source: str, path: Path) -> None:
    """A recording as `run` makes it, but not at the pace of the clock."""
    job = prepare(source, method="perimeter")
    recorder = Recorder(path, source=job.input_info)
    recorder.describe(job.sensor, job.pipeline, job.method)
    for reading in job.readings():
        recorder.take(reading.frame)
        recorder.write(reading)
    recorder.close()


def forces_N(folder: Path) -> Iterator[float]:
    rows = rows_of(folder / "truth" / "truth" / "contacts.csv")
    for number in range(len(PLACES)):
        time_s = round(2.6 + 1.4 * number, 1)
        yield next(float(row["normal_force_N"]) for row in rows if abs(float(row["time_s"]) - time_s) < 0.01)


def typed(lines: list[str], *words: str, cwd: Path) -> tuple[int, str]:
    """Run manytouch on a terminal and type lines, each at its prompt."""
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-m", "manytouch", *words], cwd=cwd, stdin=theirs, stdout=theirs, stderr=theirs
    ) as process:
        os.close(theirs)
        shown, waiting = b"", list(lines)
        while True:
            try:
                shown += os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
            if waiting and shown.endswith(b": ") and b"press " in shown[-12:]:
                os.write(ours, waiting.pop(0).encode() + b"\n")
        os.close(ours)
    return process.returncode, shown.decode()


@pytest.mark.slow
def test_presses_of_one_recording_are_typed_in_and_give_what_their_table_gives(
    pressed: tuple[Path, Sensor],
) -> None:
    folder, sensor = pressed
    forces = list(forces_N(folder))
    lines = [
        f"{x},{y} {1e3 * force / 9.81:.2f} g {2.6 + 1.4 * number:.1f} s radius 4 mm"
        for number, ((x, y), force) in enumerate(zip(PLACES, forces, strict=True))
    ]
    wrong = ["0,0 3 pounds 2.6 s", "0,0 100 g"]
    words = ["calibrate", "sheet", "presses.mcap", "--sensor", "sensor.toml", "--out", "calibrated.toml"]
    status, shown = typed([*wrong, *lines, "done"], *words, cwd=folder)
    assert status == 0, shown
    assert "'pounds' is not understood" in shown
    assert "the time is missing: add the time in presses.mcap" in shown
    assert "leave-one-out force error" in shown
    rows = rows_of(folder / "calibrated-presses.csv")
    assert {row["input"] for row in rows} == {"presses.mcap"}
    assert [float(row["normal_force_N"]) for row in rows] == pytest.approx(forces, rel=2e-3)
    words = ["--sensor", str(folder / "sensor.toml"), "--out", str(folder / "again.toml")]
    assert main(["calibrate", "sheet", str(folder / "calibrated-presses.csv"), *words]) == 0
    requested, read = (load_sensor(folder / name).sheet for name in ("calibrated.toml", "again.toml"))
    given = (requested.thickness_mm, requested.young_MPa)
    assert given == pytest.approx((read.thickness_mm, read.young_MPa), rel=1e-6)
    assert requested.thickness_mm == pytest.approx(sensor.sheet.thickness_mm, rel=0.1)
    assert np.isfinite(requested.young_MPa)
    assert requested.young_MPa != sensor.sheet.young_MPa


@pytest.mark.slow
def test_too_few_presses_end_in_a_sentence_and_stay(pressed: tuple[Path, Sensor]) -> None:
    folder, _ = pressed
    words = ["calibrate", "sheet", "presses.mcap", "--sensor", "sensor.toml", "--out", "few.toml"]
    status, shown = typed(["0,0 100 g 2.6 s", "done", "\x04"], *words, cwd=folder)
    assert status == 1
    assert "1 press is too few, at least 4 are needed" in shown
    assert "run the same command again to add more" in shown
    assert len(rows_of(folder / "few-presses.csv")) == 1
    assert not (folder / "few.toml").exists()
