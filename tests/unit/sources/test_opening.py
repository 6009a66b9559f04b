"""What `open_source` opens, and the sentences with which it refuses."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.sources import Source, open_source


def picture(path: Path) -> Path:
    assert cv2.imwrite(str(path), np.full((24, 36), 90, np.uint8))
    return path


def refusal(source: str | Path, **options: float) -> str:
    with pytest.raises(SourceError) as caught:
        open_source(source, **options)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.endswith((".", "?", "'"))
    return sentence


def test_every_kind_is_a_source(tmp_path: Path) -> None:
    path = picture(tmp_path / "a.png")
    for source in (open_source(path), open_source(str(tmp_path)), open_source("sim:rest")):
        assert isinstance(source, Source)
        assert not source.is_live


def test_a_missing_file_names_its_like(tmp_path: Path) -> None:
    picture(tmp_path / "Press_01.png")
    assert "'Press_01.png'" in refusal(tmp_path / "press_1.png")
    assert "did you mean" not in refusal(tmp_path / "zzz.mp4")


def test_a_pipe_is_not_called_missing(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mp4")
    assert "is neither a file nor a folder" in refusal(tmp_path / "pipe.mp4")


def test_a_missing_folder_names_the_last_that_exists(tmp_path: Path) -> None:
    assert repr(str(tmp_path)) in refusal(tmp_path / "no" / "where" / "a.mp4")


def test_a_folder_without_images_lists_what_was_looked_for(tmp_path: Path) -> None:
    sentence = refusal(tmp_path)
    assert all(suffix in sentence for suffix in ("png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp"))
    (tmp_path / "press.mp4").write_bytes(b"x")
    assert "press.mp4" in refusal(tmp_path)


@pytest.mark.parametrize("name", ["text.mp4", "text.txt", "frame_001.avi", "text.png"])
def test_a_text_is_no_video_and_no_image(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_text("this is not a recording\n" * 200)
    assert name in refusal(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["sensor.toml", "SCENE.TOML"])
def test_a_toml_file_is_refused_with_what_it_is_for(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text("schema = 1\n")
    sentence = refusal(path)
    assert "is a TOML file, not a recording" in sentence
    assert all(words in sentence for words in (f"--sensor {path}", f"sim:{path}", "manytouch run"))


def test_noise_and_nothing_are_no_videos(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "noise.mp4").write_bytes(np.random.default_rng(0).bytes(20_000))
    (tmp_path / "nothing.mp4").touch()
    assert "cannot be decoded" in refusal(tmp_path / "noise.mp4")
    assert "is empty" in refusal(tmp_path / "nothing.mp4")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "text", ["97", "/dev/video97", "http://127.0.0.1:9/live.mjpg", "rtsp://127.0.0.1:9/live"]
)
def test_a_camera_that_is_not_there_is_one_sentence(text: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert "does not open" in refusal(text)
    assert capfd.readouterr() == ("", "")


def test_a_password_is_not_repeated() -> None:
    assert "secret" not in refusal("http://me:secret@127.0.0.1:9/live.mjpg")


def test_a_folder_named_by_a_number_is_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "0").mkdir()
    picture(tmp_path / "0" / "a.png")
    monkeypatch.chdir(tmp_path)
    assert open_source("0").name == "0"


def test_an_image_is_known_by_its_content(tmp_path: Path) -> None:
    picture(tmp_path / "a.png").rename(tmp_path / "a.mp4")
    assert open_source(tmp_path / "a.mp4").frame_count == 1


def test_an_empty_name_and_an_unknown_scene() -> None:
    assert "empty" in refusal(" ")
    sentence = refusal("sim:nosuch")
    assert all(scene in sentence for scene in ("fingers", "one", "rest"))


@pytest.mark.parametrize("fps", [0.0, -3.0, float("nan"), float("inf"), 1e-300, 1e300])
def test_a_rate_is_positive_and_its_times_are_whole_nanoseconds(fps: float) -> None:
    assert "from 1e-06 to 1e+06, not" in refusal("sim:", fps=fps)


def test_a_folder_that_may_not_be_read_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def denied(self: Path) -> None:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "iterdir", denied)
    assert "Permission denied" in refusal(tmp_path)
