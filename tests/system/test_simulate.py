"""`manytouch simulate` from outside."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from command_line import Done, run_command
from manytouch.calibration.sheet.press_table import read_press_table
from manytouch.cli import main
from manytouch.sinks.files.tables import contact_column_names, marker_column_names
from manytouch.values.sensor_file.read import load_sensor
from results import rows_of

SENSOR = """
schema = 1
name = "small sheet"
[camera]
width_px = 320
height_px = 240
fx_px = 300.0
fy_px = 300.0
cx_px = 159.5
cy_px = 119.5
[camera.pose]
translation_mm = [0.0, 0.0, 60.0]
[sheet]
size_mm = [48.0, 36.0]
thickness_mm = 3.0
young_MPa = 1.0
poisson = 0.45
[markers]
rows = 8
columns = 11
pitch_mm = 4.0
radius_mm = 1.0
polarity = "light"
"""
SCENE = """
schema = 1
name = "closing in"
seconds = 1.0
fps = 10.0
sensor = "sensor.toml"
seed = 3
[solid]
element_mm = 4.0
step_mm = 2.0
[faults]
missing = 1
[[bodies]]
shape = { kind = "sphere", radius_mm = 5.0 }
friction = 0.3
[[bodies.motions]]
kind = "close_in"
centre_mm = [0.0, 0.0]
direction_deg = 0.0
from_distance_mm = 20.0
to_distance_mm = 16.0
depth_mm = 2.0
start_s = 0.2
end_s = 0.85
ramp_s = 0.2
"""
PRESSES = """
schema = 1
seconds = 1.6
fps = 10.0
sensor = "sensor.toml"
mechanics = "shell"
[[bodies]]
shape = { kind = "sphere", radius_mm = 5.0 }
motions = [
    { kind = "press", at_mm = [-6, 2], depth_mm = 1.0, start_s = 0.3, end_s = 0.9, ramp_s = 0.2 },
    { kind = "slide", from_mm = [0, 0], to_mm = [1, 1], depth_mm = 1.0, start_s = 2.0, end_s = 2.6 },
    { kind = "tap", at_mm = [0, 0], depth_mm = 1.0, start_s = 3.0, touch_s = 0.2 },
]
[[bodies]]
shape = { kind = "sphere", radius_mm = 5.0 }
motions = [{ kind = "press", at_mm = [5, -3], depth_mm = 1.0, start_s = 0.9, end_s = 1.5, ramp_s = 0.2 }]
"""
FILES = {"frames", "sensor.toml", "truth"}


def written(folder: Path, scene: str = SCENE) -> list[str]:
    (folder / "sensor.toml").write_text(SENSOR)
    (folder / "scene.toml").write_text(scene)
    words = ["simulate", "scene.toml", "--out", "out", "--states", "states"]
    return [sys.executable, "-m", "manytouch", *words]


def simulate(folder: Path, scene: str = SCENE) -> Done:
    return run_command(*written(folder, scene)[3:], folder=folder)


def test_it_leaves_pictures_sensor_and_truth_and_solves_nothing_twice(tmp_path: Path) -> None:
    done = simulate(tmp_path)
    assert done.returncode == 0, done.stderr
    assert "10 frames" in done.stdout
    out = tmp_path / "out"
    assert {path.name for path in out.iterdir()} == FILES
    frames = sorted(path.name for path in (out / "frames").iterdir())
    assert frames == [f"{index:06d}.png" for index in range(10)]
    assert cv2.imread(str(out / "frames" / frames[0]), cv2.IMREAD_UNCHANGED).shape == (240, 320)
    assert load_sensor(out / "sensor.toml").name == "small sheet"

    contacts = rows_of(out / "truth" / "contacts.csv")
    assert tuple(contacts[0]) == contact_column_names("mm")
    assert {row["contact"] for row in contacts} == {"0", "1"}
    assert [row["phase"] for row in contacts if row["contact"] == "0"][:2] == ["start", "move"]
    pressed = [row for row in contacts if row["frame"] == "5"]
    assert [np.sign(float(row["x_mm"])) for row in pressed] == [-1.0, 1.0]
    assert all(float(row["normal_force_N"]) > 0.2 for row in pressed)
    assert all(1.0 < float(row["depth_mm"]) < 2.0 for row in pressed)

    markers = pq.read_table(out / "truth" / "markers.parquet")
    assert tuple(markers.column_names) == marker_column_names("mm")
    assert markers.num_rows == 10 * 88
    assert np.sum(~markers["seen"].to_numpy(zero_copy_only=False)) == 10
    still = {path: path.stat().st_mtime_ns for path in (tmp_path / "states").iterdir()}
    first = (out / "frames" / "000007.png").read_bytes()
    assert simulate(tmp_path).returncode == 0
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "states").iterdir()} == still
    assert (out / "frames" / "000007.png").read_bytes() == first


def test_presses_that_are_held_are_listed_as_a_table_for_the_calibration(tmp_path: Path) -> None:
    (tmp_path / "sensor.toml").write_text(SENSOR)
    (tmp_path / "presses.toml").write_text(PRESSES)
    assert main(["simulate", str(tmp_path / "presses.toml"), "--out", str(tmp_path / "out")]) == 0
    rows = read_press_table(tmp_path / "out" / "truth" / "presses.csv")
    assert [(row.x_mm, row.y_mm) for row in rows] == [(-6.0, 2.0), (5.0, -3.0)]
    # images are read at 30 frames per second, the scene has 10
    assert [row.time_s for row in rows] == [0.2, 0.4]
    contacts = rows_of(tmp_path / "out" / "truth" / "contacts.csv")
    for row, frame in zip(rows, ("6", "12"), strict=True):
        true = next(one for one in contacts if one["frame"] == frame)
        assert row.force_N == pytest.approx(float(true["normal_force_N"]), rel=1e-3)
        assert row.radius_mm == pytest.approx(np.sqrt(float(true["area_mm2"]) / np.pi), rel=1e-3)


def test_ctrl_c_leaves_what_is_whole_and_the_same_command_goes_on(tmp_path: Path) -> None:
    slow = SCENE.replace("step_mm = 2.0", "step_mm = 0.1")
    surroundings = os.environ | {"PYTHONUNBUFFERED": "1"}
    running = subprocess.Popen(
        written(tmp_path, slow), cwd=tmp_path, env=surroundings, stdout=subprocess.PIPE, text=True
    )
    states = tmp_path / "states"
    deadline = time.monotonic() + 240
    while not states.is_dir() or len(list(states.glob("[!.]*.npz"))) < 2:
        assert time.monotonic() < deadline
        assert running.poll() is None
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    printed, _ = running.communicate(timeout=240)
    assert running.returncode == 0
    assert "run the same command again to continue" in printed
    assert not (tmp_path / "out").exists()
    kept = {path.name for path in states.iterdir()}
    assert all(name.endswith(".npz") and not name.startswith(".") for name in kept)


def test_what_is_wrong_is_one_line(tmp_path: Path) -> None:
    done = simulate(tmp_path, SCENE.replace("fps = 10.0", "fsp = 10.0"))
    assert done.returncode == 1
    assert "unknown key fsp" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_unwritable_folder_is_reported_before_anything_is_solved(tmp_path: Path) -> None:
    (tmp_path / "sensor.toml").write_text(SENSOR)
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "file").write_text("no folder")
    words = ["simulate", "scene.toml", "--out", "file/out", "--states", "states"]
    done = run_command(*words, folder=tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith("manytouch: cannot write file/out: ")
    assert not (tmp_path / "states").exists()
