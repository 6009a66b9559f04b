"""`manytouch demo` and `manytouch doctor` from outside."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import cv2
import pyarrow.parquet as pq
import pytest

from clips import pressed_video
from command_line import run_command
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values.sensor_file.write import save_sensor
from osc_receiver import Receiver
from part_of_sheet import part_of_sheet
from results import rows_of
from waiting import wait_until

TABLES = {
    "contacts.csv",
    "contact_list.csv",
    "regions.parquet",
    "markers.parquet",
    "frames.csv",
    "summary.json",
}


def run(*words: object) -> str:
    done = run_command(*words)
    assert done.returncode == 0, done.stderr
    return done.stdout


SMALL = """schema = 1
name = "small"
seconds = 2.0
fps = 20.0
sensor = "sensor.toml"
mechanics = "shell"
[[bodies]]
shape = { kind = "sphere", radius_mm = 6.0 }
motions = [{ kind = "press", at_mm = [8.0, -5.0], depth_mm = 2.5, start_s = 0.4, end_s = 2.0, ramp_s = 0.4 }]
"""


def small_scene(folder: Path) -> Path:
    """A scene on a part of the simulated sheet, in small pictures."""
    save_sensor(part_of_sheet(demo_sensor(640), (64.0, 44.0)), folder / "sensor.toml")
    scene = folder / "small.toml"
    scene.write_text(SMALL, encoding="utf-8")
    return scene


@pytest.mark.parametrize("is_small", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_demo_prints_contacts_with_ground_truth_and_writes_tables_and_a_picture(
    tmp_path: Path, is_small: bool
) -> None:
    pytest.importorskip("matplotlib")
    words = ("--scene", small_scene(tmp_path)) if is_small else ()
    done = run_command("demo", "--seconds", "1.4", "--no-view", *words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    output = done.stdout
    folder = tmp_path / "out" / "demo"
    assert "touches" in output
    assert "truth" in output
    assert str(Path("out") / "demo") in output
    frames = rows_of(folder / "frames.csv")
    assert float(frames[-1]["time_s"]) == pytest.approx(1.4, abs=0.1)
    assert max(int(row["contacts"]) for row in frames) >= 1
    wanted = {
        "contacts.csv",
        "contact_list.csv",
        "regions.parquet",
        "markers.parquet",
        "frames.csv",
        "summary.json",
        "annotated.mp4",
        "picture.png",
    }
    assert {path.name for path in folder.iterdir()} == wanted
    picture = cv2.imread(str(folder / "picture.png"))
    assert min(picture.shape[:2]) > 400


@pytest.mark.slow
def test_demo_sends_readings_to_other_programs_at_the_rate_of_the_sensor(tmp_path: Path) -> None:
    receiver = Receiver()
    done = run_command(
        *("demo", "--no-view", "--seconds", "1.6", "--to", f"osc://127.0.0.1:{receiver.port}"),
        folder=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    wait_until(lambda: receiver.of("/manytouch/frame"))
    receiver.close()
    counts = re.search(rf":{receiver.port}: (\d+) readings sent .*, (\d+) dropped", done.stdout)
    assert counts is not None
    assert sum(map(int, counts.groups())) == 48, "some are dropped where the machine is busy"
    assert (tmp_path / "out" / "demo" / "contacts.csv").is_file()
    wrong = run_command("demo", "--to", "smoke://here", folder=tmp_path)
    assert wrong.returncode == 2
    assert "there is no output smoke://" in wrong.stderr


def test_doctor_without_a_source_describes_the_machine() -> None:
    output = run("doctor")
    for words in (
        "manytouch",
        "Python",
        "numpy",
        "numba",
        "extra lab",
        "extra connect",
        "kernels",
        "solved simulations in",
        "videos",
    ):
        assert words in output


def test_doctor_describes_a_recording(tmp_path: Path) -> None:
    output = run("doctor", pressed_video(tmp_path / "press.avi", frames=20))
    for words in ("dots: 54, darker", "contrast", "focus", "exposure", "6 rows x 9 columns", "noise"):
        assert words in output


def test_help_is_quick_and_has_an_example() -> None:
    for verb in ("demo", "process", "run", "doctor"):
        assert f"Example: manytouch {verb}" in run(verb, "--help")
    assert run("--version").strip().count(".") == 2


LONGEST_HELP_S = 0.3


def processor_s(code: str) -> tuple[float, str]:
    """Processor time of a program, and what it printed; the least of ten runs, if it takes too long."""
    surroundings = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    seconds: list[float] = []
    printed = ""
    while len(seconds) < 10 and min(seconds, default=math.inf) >= LONGEST_HELP_S:
        before = os.times()
        printed = subprocess.run(
            [sys.executable, "-c", code], env=surroundings, capture_output=True, text=True, check=True
        ).stdout
        after = os.times()
        seconds.append(sum(after[2:4]) - sum(before[2:4]))
    return min(seconds), printed


def test_help_is_quick_and_loads_nothing_heavy() -> None:
    spent_s, printed = processor_s(
        "import sys, manytouch.cli; manytouch.cli.main(['--help']);"
        "heavy = ('numpy', 'cv2', 'numba', 'scipy', 'pyarrow', 'cyclopts', 'rich');"
        "print([name for name in heavy if name in sys.modules])"
    )
    assert printed.splitlines()[-1] == "[]"
    assert spent_s < LONGEST_HELP_S


@pytest.mark.slow
def test_demo_serves_the_viewer_until_ctrl_c_and_leaves_tables_and_a_picture(tmp_path: Path) -> None:
    pytest.importorskip("nicegui")
    words = [sys.executable, "-m", "manytouch", "demo"]
    with subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as demo:
        assert demo.stdout is not None
        url = next(
            found[0] for line in demo.stdout if (found := re.search(r"http://127\.0\.0\.1:\d+/", line))
        )
        with urllib.request.urlopen(url, timeout=60) as answer:
            assert b"<title>manytouch</title>" in answer.read()
        demo.send_signal(signal.SIGINT)
        _, complaints = demo.communicate(timeout=900)
    assert demo.returncode == 0, complaints
    assert "Traceback" not in complaints
    folder = tmp_path / "out" / "demo"
    wanted = {
        "contacts.csv",
        "contact_list.csv",
        "regions.parquet",
        "markers.parquet",
        "frames.csv",
        "summary.json",
        "picture.png",
    }
    assert {path.name for path in folder.iterdir()} == wanted
    frames = json.loads((folder / "summary.json").read_text())["counts"]["frames"]
    assert frames == len(rows_of(folder / "frames.csv")) > 0
    assert pq.read_metadata(folder / "markers.parquet").num_rows == 600 * frames
