"""`manytouch process` from outside: its files, their columns, and what happens when it is interrupted."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import pyarrow.parquet as pq
import pytest

from clips import COLUMNS, PITCH_PX, ROWS, picture, press_of, pressed_video, write_video
from command_line import run_command
from results import rows_of
from small_disk import fill, small_disk_at

CONTACT_COLUMNS = (
    "frame,time_s,contact,phase,x_{0},y_{0},depth_{0},normal_force_N,shear_x_N,shear_y_N,area_{0}2,"
    "x_std_{0},y_std_{0},force_std_N,x_px,y_px,depth_std_{0},normal_force_over_E_{0}2,shear_x_std_N,"
    "shear_y_std_N,torque_Nmm,torque_std_Nmm,area_std_{0}2,slip,"
    "half_major_{0},half_minor_{0},orientation_rad,shape,shape_probability"
)
MARKER_COLUMNS = "frame,time_s,marker,row,column,x_px,y_px,seen,dx_{0},dy_{0},depth_{0},depth_std_{0}"
FRAME_COLUMNS = "frame,time_s,status,markers_seen,contacts,milliseconds,lost_ids,new_ids,method"
FILES = {
    "contacts.csv",
    "contact_list.csv",
    "regions.parquet",
    "markers.parquet",
    "frames.csv",
    "summary.json",
}
LONG = 400


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "manytouch", *map(str, words)]


def run(*words: object) -> str:
    done = run_command(*words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def columns_of(path: Path) -> str:
    with path.open(newline="") as file:
        return ",".join(next(csv.reader(file)))


def contents_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*")}


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pressed_video(tmp_path_factory.mktemp("video") / "press.mp4")


@pytest.fixture(scope="module")
def long_video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pictures = [picture(press_of(index), seed=index) for index in range(60)]
    path = tmp_path_factory.mktemp("video") / "long.mp4"
    return write_video(path, (pictures[index % 60] for index in range(LONG)))


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory, video: Path) -> tuple[Path, str]:
    out = tmp_path_factory.mktemp("out")
    printed = run("process", video, "--out", out, "--annotate", "--surface")
    return out / "press", printed


def test_files_and_columns_are_those_of_the_contract(results: tuple[Path, str]) -> None:
    folder, _ = results
    assert {path.name for path in folder.iterdir()} == FILES | {"annotated.mp4", "surface.zarr"}
    assert columns_of(folder / "contacts.csv") == CONTACT_COLUMNS.format("pitch")
    assert ",".join(pq.read_schema(folder / "markers.parquet").names) == MARKER_COLUMNS.format("pitch")
    assert columns_of(folder / "frames.csv") == FRAME_COLUMNS


def test_every_frame_has_a_row_and_every_marker_one_per_frame(results: tuple[Path, str]) -> None:
    folder, _ = results
    frames = rows_of(folder / "frames.csv")
    assert [int(row["frame"]) for row in frames] == list(range(60))
    assert float(frames[25]["time_s"]) == pytest.approx(1.0, abs=1e-6)
    assert {row["status"] for row in frames} == {"ok"}
    assert pq.read_metadata(folder / "markers.parquet").num_rows == 60 * ROWS * COLUMNS


def test_the_press_is_found_and_its_forces_are_not_known(results: tuple[Path, str]) -> None:
    folder, _ = results
    rows = rows_of(folder / "contacts.csv")
    touched = {int(row["frame"]) for row in rows if row["phase"] != "end"}
    assert {28, 29, 30, 31, 32} <= touched <= set(range(20, 42))
    assert rows[0]["phase"] == "start"
    assert rows[-1]["phase"] == "end"
    for name in ("normal_force_N", "shear_x_N", "force_std_N", "normal_force_over_E_pitch2", "slip"):
        assert {row[name] for row in rows} == {""}


def test_summary_states_sensor_counts_and_versions(results: tuple[Path, str]) -> None:
    summary = json.loads((results[0] / "summary.json").read_text())
    sensor = summary["sensor"]
    assert (sensor["rows"], sensor["columns"], sensor["polarity"], sensor["missing"]) == (
        ROWS,
        COLUMNS,
        "dark",
        [],
    )
    assert sensor["pitch_px"] == pytest.approx(list(PITCH_PX), abs=0.3)
    assert summary["counts"]["frames"] == summary["counts"]["status"]["ok"] == 60
    assert summary["counts"]["markers"] == ROWS * COLUMNS
    assert any("60 degrees" in sentence for sentence in summary["assumptions"])
    assert 0 < summary["milliseconds"]["p50"] <= summary["milliseconds"]["p99"]
    assert 0 < summary["noise_px"]["median"] < 0.2
    assert {"manytouch", "python", "numpy", "opencv", "numba"} <= summary["versions"].keys()
    assert {"detect", "track", "estimate"} == summary["parameters"].keys()
    assert summary["parameters"]["estimate"]["interpolation"]["kind"] == "spline"


def test_output_states_sensor_assumptions_and_folder(results: tuple[Path, str]) -> None:
    folder, printed = results
    for words in (f"{ROWS} x {COLUMNS} markers, dark", "assumed", "noise per marker", "contact", str(folder)):
        assert words in printed
    assert "\x1b" not in printed


def test_annotated_video_has_every_frame_and_is_at_most_three_times_its_source(
    results: tuple[Path, str], video: Path
) -> None:
    assert (results[0] / "annotated.mp4").stat().st_size <= 3 * video.stat().st_size
    film = cv2.VideoCapture(str(results[0] / "annotated.mp4"))
    frames = 0
    while film.read()[0]:
        frames += 1
    film.release()
    assert frames == 60


def test_depth_map_has_coordinates_and_units(results: tuple[Path, str]) -> None:
    zarr = pytest.importorskip("zarr")
    group = zarr.open_group(results[0] / "surface.zarr", mode="r")
    depth = group["depth_pitch"]
    assert depth.metadata.dimension_names == ("frame", "y", "x")
    assert depth.shape == (60, group["y"].shape[0], group["x"].shape[0])
    assert group["x"].shape[0] > group["y"].shape[0]
    assert depth.attrs["units"] == group["x"].attrs["units"] == "pitch"
    assert list(group["frame"][:]) == list(range(60))


def test_millimetres_on_request_and_names_that_do_not_collide(tmp_path: Path) -> None:
    first, other = tmp_path / "first" / "press.mp4", tmp_path / "other"
    first.parent.mkdir()
    other.mkdir()
    write_video(first, (picture(press_of(index), seed=index) for index in range(24)))
    write_video(other / "press.avi", (picture(seed=index) for index in range(16)))
    run("process", first, other / "press.avi", "--out", tmp_path / "out", "--pitch-mm", "4,4.25")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"press", "press-2"}
    for name, frames in (("press", 24), ("press-2", 16)):
        assert columns_of(tmp_path / "out" / name / "contacts.csv") == CONTACT_COLUMNS.format("mm")
        assert len(rows_of(tmp_path / "out" / name / "frames.csv")) == frames


def test_pictures_are_annotated_as_pictures(tmp_path: Path) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for index in (2, 10, 1):
        cv2.imwrite(str(folder / f"{index}.png"), picture(seed=index))
    run("process", folder, "--out", tmp_path / "out", "--annotate", "--method", "paper")
    drawn = sorted(path.name for path in (tmp_path / "out" / "pictures" / "annotated").iterdir())
    assert drawn == ["000000.png", "000001.png", "000002.png"]


def test_no_input_file_is_replaced_by_results(tmp_path: Path) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for index in range(3):
        cv2.imwrite(str(folder / f"picture-{index:06d}.png"), picture(seed=index))
    done = run_command("process", folder, "--out", tmp_path, "--picture", "1")
    assert done.returncode == 1
    assert "replace picture-000000.png, which is the input: choose another folder" in done.stderr
    assert len(list(folder.iterdir())) == 3
    for path in list(folder.iterdir()):
        path.rename(folder / path.name.removeprefix("picture-"))
    assert "results in" in run("process", folder, "--out", tmp_path)
    assert {path.name for path in folder.iterdir()} == FILES | {f"{index:06d}.png" for index in range(3)}


def test_a_run_replaces_all_earlier_results_and_reports_a_missing_picture(tmp_path: Path) -> None:
    folder, out = tmp_path / "pictures", tmp_path / "out"
    folder.mkdir()
    for index in range(2):
        cv2.imwrite(str(folder / f"{index}.png"), picture(seed=index))
    done = run_command("process", folder, "--out", out, "--picture", "1,7")
    assert done.returncode == 0, done.stderr
    assert "warning: no image of frame 7:" in done.stderr
    assert (out / "pictures" / "picture-000001.png").is_file()
    run("process", folder, "--out", out)
    assert {path.name for path in (out / "pictures").iterdir()} == FILES


def started(folder: Path, *words: object) -> subprocess.Popen[str]:
    """A run that is some frames on its way; what a killed one left does not count."""
    earlier = set(folder.parent.glob(".long.*.partial"))
    running = subprocess.Popen(command(*words), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 120
    while not any(
        path.stat().st_size > 1000
        for path in folder.parent.glob(".long.*.partial/frames.csv")
        if path.parent not in earlier
    ):
        assert running.poll() is None, running.communicate()
        assert time.monotonic() < until
        time.sleep(0.02)
    return running


@pytest.mark.skipif(os.name == "nt", reason="signals as POSIX has them")
@pytest.mark.slow
@pytest.mark.parametrize("has_earlier", [True, False])
def test_killed_run_leaves_the_earlier_result_and_the_next_one_succeeds(
    tmp_path: Path, long_video: Path, video: Path, paper_results: Path, has_earlier: bool
) -> None:
    folder = tmp_path / "out" / "long"
    if has_earlier:
        shutil.copytree(paper_results, folder)
    running = started(folder, "process", long_video, "--out", tmp_path / "out")
    running.send_signal(signal.SIGKILL)
    running.communicate()
    assert contents_of(folder) == (contents_of(paper_results) if has_earlier else {})
    short = tmp_path / "long.mp4"
    shutil.copy(video, short)
    run("process", short, "--out", tmp_path / "out")
    assert {path.name for path in folder.iterdir()} == FILES
    assert [path.name for path in folder.parent.iterdir()] == ["long"]
    assert len(rows_of(folder / "frames.csv")) == 60


@pytest.mark.skipif(os.name == "nt", reason="signals as POSIX has them")
@pytest.mark.parametrize(
    ("number", "status"), [pytest.param(signal.SIGINT, 0, marks=pytest.mark.slow), (signal.SIGTERM, 143)]
)
def test_signals_end_with_complete_files(
    tmp_path: Path, long_video: Path, number: signal.Signals, status: int
) -> None:
    folder = tmp_path / "out" / "long"
    running = started(folder, "process", long_video, "--out", tmp_path / "out", "--fps", 400)
    ends_with_complete_files(running, folder, number, status)


def ends_with_complete_files(
    running: subprocess.Popen[str], folder: Path, number: signal.Signals, status: int
) -> None:
    """Send a signal to a run of the long video, and check what it leaves."""
    running.send_signal(number)
    printed, complained = running.communicate(timeout=60)
    assert running.returncode == status, complained
    assert "Traceback" not in printed + complained
    assert "ended early" in printed
    assert {path.name for path in folder.iterdir()} == FILES
    frames = len(rows_of(folder / "frames.csv"))
    assert 10 <= frames < LONG
    assert pq.read_metadata(folder / "markers.parquet").num_rows == frames * ROWS * COLUMNS
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["counts"]["frames"] == frames
    assert summary["complete"] is False
    assert [path.name for path in folder.parent.iterdir()] == ["long"]


@pytest.mark.skipif(os.name == "nt", reason="signals as POSIX has them")
@pytest.mark.slow
def test_two_runs_with_one_out_do_not_mix_and_ctrl_c_ends_the_live_one(
    tmp_path: Path, long_video: Path
) -> None:
    folder = tmp_path / "out" / "long"
    running = started(folder, "run", long_video, "--out", tmp_path / "out", "--fps", 20)
    done = run_command("process", long_video, "--out", tmp_path / "out")
    ends_with_complete_files(running, folder, signal.SIGINT, 0)
    assert done.returncode == 1
    assert f"is being written by process {running.pid} on " in done.stderr


@pytest.fixture(scope="module")
def paper_results(tmp_path_factory: pytest.TempPathFactory, video: Path) -> Path:
    out = tmp_path_factory.mktemp("paper")
    run("process", video, "--out", out, "--method", "paper")
    return out / "press"


@pytest.fixture
def small_disk(tmp_path: Path, paper_results: Path) -> Iterator[Path]:
    """A file system of 2 MB with results of the video."""
    with small_disk_at(tmp_path / "disk", megabytes=2) as folder:
        shutil.copytree(paper_results, folder / "press")
        yield folder


@pytest.mark.parametrize(
    ("option", "free_bytes"),
    [
        ("--fps=25", 8_192),
        ("--surface", 40_000),
        *(
            pytest.param(option, free_bytes, marks=pytest.mark.slow)
            for option, free_bytes in (
                ("--annotate", 8_192),
                ("--fps=25", 40_000),
                ("--annotate", 40_000),
                ("--surface", 8_192),
            )
        ),
    ],
)
def test_a_full_disk_gets_no_files_and_states_the_space(
    small_disk: Path, video: Path, option: str, free_bytes: int
) -> None:
    fill(small_disk, left_bytes=free_bytes)
    before = {path: path.read_bytes() for path in (small_disk / "press").iterdir()}
    done = run_command("process", video, "--out", small_disk, option)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    words = r"the disk is full; (about|more than) [\d.]+ MB are needed.*, and (0\.0\d+) MB were free"
    found = re.search(words, line)
    assert found, line
    assert free_bytes - 8192 <= float(found[2]) * 1e6 <= free_bytes
    assert {path.name for path in small_disk.iterdir()} == {"press", "filling"}
    assert {path: path.read_bytes() for path in (small_disk / "press").iterdir()} == before


def test_run_keeps_the_pace_and_prints_contacts(tmp_path: Path, video: Path) -> None:
    begun_s = time.monotonic()
    printed = run("run", video, "--fps", "40", "--no-view")
    assert time.monotonic() - begun_s > 59 / 40
    assert "touches" in printed
    assert "gone" in printed
    assert not any(tmp_path.iterdir())
