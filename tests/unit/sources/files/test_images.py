"""Images and folders of images."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.sources import open_source
from manytouch.sources.files.images import natural_key


def write(path: Path, image: np.ndarray) -> None:
    assert cv2.imwrite(str(path), image)


def levels(folder: Path, **options: float) -> list[int | None]:
    return [
        None if frame.image is None else int(frame.image.flat[0]) for frame in open_source(folder, **options)
    ]


def test_natural_order_and_timestamps(tmp_path: Path) -> None:
    for number in (10, 2, 1, 100):
        write(tmp_path / f"view{number}.png", np.full((24, 36), number, np.uint8))
    (tmp_path / "notes.txt").write_text("no image")
    (tmp_path / ".hidden.png").write_text("no image")
    source = open_source(tmp_path)
    frames = list(source)
    assert [frame.image[3, 5] for frame in frames if frame.image is not None] == [1, 2, 10, 100]
    assert [frame.index for frame in frames] == [0, 1, 2, 3]
    assert [frame.timestamp_ns for frame in frames] == [0, 33333333, 66666667, 100000000]
    assert (source.frame_count, source.width_px, source.height_px, source.fps) == (4, 36, 24, None)
    assert source.name == frames[0].camera == tmp_path.name
    assert [frame.timestamp_ns for frame in open_source(tmp_path, fps=5.0)] == [
        0,
        200000000,
        400000000,
        600000000,
    ]
    assert levels(tmp_path) == levels(tmp_path)


def test_natural_key_mixes_words_and_numbers() -> None:
    names = ["a.png", "2.png", "10.png", "a2b10.png", "a2b9.png", "02.png", "B.png"]
    assert sorted(map(Path, names), key=natural_key) == [
        Path(name) for name in ["02.png", "2.png", "10.png", "a.png", "a2b9.png", "a2b10.png", "B.png"]
    ]


@pytest.mark.parametrize("suffix", ["png", "jpg", "JPEG", "bmp", "tif", "tiff", "webp"])
def test_every_kind_in_grey_and_colour(tmp_path: Path, suffix: str) -> None:
    colour = np.zeros((24, 36, 3), np.uint8)
    colour[:, :, 0] = 200  # blue comes first
    for name, image in (("grey", np.full((24, 36), 77, np.uint8)), ("colour", colour)):
        write(tmp_path / f"{name}.{suffix}", image)
        (frame,) = open_source(tmp_path / f"{name}.{suffix}")
        assert frame.image is not None
        assert frame.image.dtype == np.uint8
        expected = image if frame.image.ndim == image.ndim else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
        assert np.abs(frame.image.astype(int) - expected).max() <= 2


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_16_bits_stay_16_bits(tmp_path: Path, suffix: str) -> None:
    image = np.arange(24 * 36, dtype=np.uint16).reshape(24, 36) * 70
    write(tmp_path / f"deep.{suffix}", image)
    write(tmp_path / f"deep_colour.{suffix}", np.dstack([image, image // 2, image // 4]))
    (frame,) = open_source(tmp_path / f"deep.{suffix}")
    assert np.array_equal(frame.image, image)
    assert frame.image.dtype == np.uint16
    (frame,) = open_source(tmp_path / f"deep_colour.{suffix}")
    assert frame.image.shape == (24, 36, 3)
    assert frame.image.dtype == np.uint16


def test_transparency_is_dropped(tmp_path: Path) -> None:
    write(tmp_path / "a.png", np.full((24, 36, 4), 128, np.uint8))
    (frame,) = open_source(tmp_path / "a.png")
    assert frame.image.shape == (24, 36, 3)


def test_odd_ones_are_frames_without_a_picture(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    grey = np.full((24, 36), 50, np.uint8)
    write(tmp_path / "1.png", grey)
    write(tmp_path / "2.png", np.full((36, 24), 60, np.uint8))
    (tmp_path / "3.png").write_bytes((tmp_path / "1.png").read_bytes()[:40])
    write(tmp_path / "4.png", grey.astype(np.uint16) * 257)
    write(tmp_path / "5.png", np.full((24, 36, 3), 70, np.uint8))
    write(tmp_path / "6.png", grey + 30)
    (tmp_path / "7.png").touch()
    assert levels(tmp_path) == [50, None, None, None, 70, 80, None]
    assert all(frame.image is None or frame.image.ndim == 2 for frame in open_source(tmp_path))
    printed = capfd.readouterr()
    assert all(
        line.startswith("libpng") for line in (printed.out + printed.err).splitlines()
    )  # old libpng itself


def test_the_first_that_can_be_decoded_sets_the_size(tmp_path: Path) -> None:
    (tmp_path / "1.png").write_bytes(b"broken")
    write(tmp_path / "2.png", np.full((24, 36, 3), 9, np.uint8))
    write(tmp_path / "3.png", np.full((24, 36), 8, np.uint8))
    assert levels(tmp_path) == [None, 9, 8]
    (tmp_path / "2.png").unlink()
    (tmp_path / "3.png").unlink()
    with pytest.raises(SourceError, match="None of the 1 images"):
        open_source(tmp_path)


def test_a_file_that_disappears_is_a_frame_without_a_picture(tmp_path: Path) -> None:
    for number in (1, 2):
        write(tmp_path / f"{number}.png", np.full((24, 36), number, np.uint8))
    source = open_source(tmp_path)
    (tmp_path / "2.png").unlink()
    assert [frame.image is None for frame in source] == [False, True]


def test_pictures_cannot_be_written_and_own_their_memory(tmp_path: Path) -> None:
    write(tmp_path / "1.png", np.full((24, 36), 3, np.uint8))
    (frame,) = open_source(tmp_path / "1.png")
    assert not frame.image.flags.writeable
    assert frame.image.base is None
