"""Wrong input: one sentence on stderr, an exit status, and no incomplete files."""

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from clips import HEIGHT_PX, WIDTH_PX, picture, press_of, pressed_video, write_video
from command_line import Done, run_command
from results import rows_of

SENSOR = f"""\
schema = 1
name = "other"
[camera]
width_px = {WIDTH_PX * 2}
height_px = {HEIGHT_PX * 2}
fx_px = 500.0
fy_px = 500.0
cx_px = 320.0
cy_px = 240.0
[camera.pose]
translation_mm = [0.0, 0.0, 100.0]
[sheet]
size_mm = [60.0, 40.0]
thickness_mm = 3.0
[markers]
rows = 6
columns = 9
pitch_mm = 5.0
radius_mm = 1.0
"""

Finished = Done | subprocess.CompletedProcess[str]
Run = Callable[..., Finished]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Runs the command line in a folder of its own, in this process."""
    return partial(run_command, folder=tmp_path)


@pytest.fixture
def run_program(tmp_path: Path) -> Run:
    """Runs the program in a folder of its own, so that the output of the decoders is captured too."""

    def run_in(*words: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "manytouch", *map(str, words)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=900,
            check=False,
        )

    return run_in


@pytest.fixture(scope="session")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pressed_video(tmp_path_factory.mktemp("video") / "press.mp4")


def refused(done: Finished, *words: str, status: int = 1) -> None:
    """One line on stderr with these words, and no traceback."""
    lines = done.stderr.splitlines()
    assert done.returncode == status, done.stderr
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("manytouch: ")
    assert "Traceback" not in done.stderr + done.stdout
    for word in words:
        assert word in lines[0]


def nothing_written(folder: Path) -> bool:
    return not folder.exists() or not any(path.is_file() for path in folder.rglob("*"))


def test_missing_file(run: Run, tmp_path: Path) -> None:
    refused(run("process", "absent.mp4", "--out", "out"), "absent.mp4")
    assert nothing_written(tmp_path / "out")


def test_text_that_is_named_a_video(run_program: Run, tmp_path: Path) -> None:
    (tmp_path / "notes.mp4").write_text("This is not a video.\n" * 200)
    refused(run_program("process", "notes.mp4", "--out", "out"), "notes.mp4")
    assert nothing_written(tmp_path / "out")


def test_empty_folder(run: Run, tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    refused(run("process", "pictures", "--out", "out"), "pictures", "images")
    assert nothing_written(tmp_path / "out")


def test_video_without_dots(run: Run, tmp_path: Path) -> None:
    noise = np.random.default_rng(1)
    grey = (
        np.clip(noise.normal(128, 4, (HEIGHT_PX, WIDTH_PX, 3)), 0, 255).astype(np.uint8) for _ in range(30)
    )
    write_video(tmp_path / "blank.mp4", grey)
    refused(run("process", "blank.mp4", "--out", "out"), "dots")
    assert nothing_written(tmp_path / "out")


def test_no_folder_for_the_results(run: Run, tmp_path: Path, video: Path) -> None:
    (tmp_path / "out").write_text("a file")
    refused(run("process", video, "--out", "out"), "out")
    assert (tmp_path / "out").read_text() == "a file"


def test_truncated_video_is_read_as_far_as_it_goes(run: Run, tmp_path: Path) -> None:
    whole = pressed_video(tmp_path / "whole.avi").read_bytes()
    (tmp_path / "cut.avi").write_bytes(whole[: int(0.6 * len(whole))])
    done = run("process", "cut.avi", "--out", "out")
    assert done.returncode == 0, done.stderr
    rows = rows_of(tmp_path / "out" / "cut" / "frames.csv")
    read = [row for row in rows if row["status"] == "ok"]
    assert 25 <= len(read) < 60
    assert all(row["status"] == "decode_error" for row in rows[len(read) :])


def test_a_pressed_start_gives_a_warning(run: Run, tmp_path: Path) -> None:
    write_video(tmp_path / "pressed.mp4", (picture(12.0, seed=index, shape=(10, 15)) for index in range(30)))
    done = run("process", "pressed.mp4", "--out", "out")
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "out" / "pressed" / "summary.json").read_text())
    assert any("touched" in sentence for sentence in summary["assumptions"] + summary["odd"])


def test_images_of_different_sizes(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for index in range(20):
        cv2.imwrite(str(folder / f"{index:03d}.png"), picture(seed=index, scale=2.0 if index == 17 else 1.0))
    done = run("process", "pictures", "--out", "out")
    assert done.returncode == 0, done.stderr
    rows = rows_of(tmp_path / "out" / "pictures" / "frames.csv")
    assert [row["frame"] for row in rows if row["status"] != "ok"] == ["17"]


def test_sensor_file_with_wrong_keys_names_all_of_them(run: Run, tmp_path: Path, video: Path) -> None:
    wrong = SENSOR.replace("cy_px = 240.0", 'cy_px = "middle"').replace("rows = 6", "lines = 6")
    (tmp_path / "wrong.toml").write_text(wrong)
    done = run("process", video, "--out", "out", "--sensor", "wrong.toml")
    refused(done, "wrong.toml", "cy_px", "lines")
    assert nothing_written(tmp_path / "out")


def test_sensor_file_of_another_camera(run: Run, tmp_path: Path, video: Path) -> None:
    (tmp_path / "other.toml").write_text(SENSOR)
    done = run("process", video, "--out", "out", "--sensor", "other.toml")
    refused(done, f"{WIDTH_PX * 2} x {HEIGHT_PX * 2}", f"{WIDTH_PX} x {HEIGHT_PX}")
    assert nothing_written(tmp_path / "out")


def test_sensor_file_that_is_not_there(run: Run, tmp_path: Path, video: Path) -> None:
    refused(run("process", video, "--out", "out", "--sensor", "absent.toml"), "absent.toml")
    assert nothing_written(tmp_path / "out")


def test_region_outside_the_image(run: Run, tmp_path: Path, video: Path) -> None:
    region = "300,10,100,100"
    refused(run("process", video, "--out", "out", f"--roi={region}"), region, f"{WIDTH_PX} x {HEIGHT_PX}")
    assert nothing_written(tmp_path / "out")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("process",), "INPUT"),
        (("process", "a.mp4"), "--out"),
        (("process", "a.mp4", "--out", "out", "--method", "magic"), "perimeter"),
        (("process", "a.mp4", "--out", "out", "--roi", "1,2,3"), "--roi"),
        (("process", "a.mp4", "--out", "out", "--roi=0,0,0,50"), "0,0,0,50"),
        (("process", "a.mp4", "--out", "out", "--roi=-5,0,50,50"), "-5,0,50,50"),
        (("process", "a.mp4", "--out", "out", "--pitch-mm", "-4"), "--pitch-mm"),
        (("process", "a.mp4", "--out", "out", "--hfov-deg", "200"), "--hfov-deg"),
        (("process", "a.mp4", "--out", "out", "--surfaces"), "--surface"),
        (("proces",), "process"),
        (("run",), "SOURCE"),
        (("demo", "--seconds", "soon"), "--seconds"),
    ],
)
def test_wrong_command_line(run: Run, tmp_path: Path, words: tuple[str, ...], message: str) -> None:
    refused(run(*words), message, status=2)
    assert nothing_written(tmp_path / "out")


def test_one_bad_input_does_not_stop_the_others(run: Run, tmp_path: Path, video: Path) -> None:
    done = run("process", "absent.mp4", video, "--out", "out")
    refused(done, "absent.mp4")
    assert (tmp_path / "out" / "press" / "summary.json").is_file()


def test_an_error_of_one_of_several_inputs_names_it(run: Run, tmp_path: Path) -> None:
    for name, level in (("black.png", 0), ("white.png", 255)):
        cv2.imwrite(str(tmp_path / name), np.full((360, 640), level, dtype=np.uint8))
    done = run("process", "black.png", "white.png", "--out", "out")
    assert done.returncode == 1
    first, second = done.stderr.splitlines()
    assert "black.png: no dots were found" in first
    assert "white.png: no dots were found" in second


@pytest.mark.parametrize(
    "words",
    [
        ("process", "--out", "out"),
        ("batch", "--out", "out"),
        ("doctor",),
        ("view",),
        ("recording", "check"),
        ("run", "--no-view"),
        ("export", "--parquet", "out"),
    ],
)
def test_a_password_in_an_address_is_nowhere(run: Run, tmp_path: Path, words: tuple[str, ...]) -> None:
    done = run(*words, "rtsp://me:secret@127.0.0.1:9/live?user=me&password=secret")
    assert done.returncode == 1
    assert "rtsp://127.0.0.1:9/live?user=me&password=***" in done.stderr
    assert "secret" not in done.stdout + done.stderr
    for path in tmp_path.rglob("*"):
        assert path.is_dir() or b"secret" not in path.read_bytes(), path.name


@pytest.mark.parametrize("words", [("view",), ("recording", "check")])
def test_a_stream_in_place_of_a_file_is_one_sentence(run: Run, words: tuple[str, ...]) -> None:
    done = run(*words, "rtsp://127.0.0.1:9/live")
    refused(done, "'rtsp://127.0.0.1:9/live' is an address, not a file", "manytouch run", "--record")


def test_a_camera_that_is_not_there(run: Run) -> None:
    refused(run("run", "97"), "camera", "does not open")


def test_debug_shows_where_it_happened(run: Run) -> None:
    done = run("process", "absent.mp4", "--out", "out", "--debug")
    assert done.returncode == 1
    assert "Traceback" in done.stderr


def test_clips_press_and_release() -> None:
    assert [press_of(frame) for frame in (0, 20, 30, 40, 59)] == [0.0, 0.0, 9.0, 0.0, 0.0]
