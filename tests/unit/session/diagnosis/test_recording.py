"""What `doctor` prints about pictures: rows and columns unequally far apart, few dots before a scene."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import moving_scene
from clips import picture
from manytouch.session.diagnosis.recording import diagnose
from manytouch.session.sensors.determine_sensor import START_FRAMES
from manytouch.tracking import COMPRESSED_VIDEO

PITCH_PX, RADIUS_PX = 40.0, 9.0


def write_picture(path: Path, *, pitch: tuple[float, float], radius: tuple[float, float]) -> str:
    """An image of 12 x 9 dark dots, with factors of pitch and radius along x and y."""
    x, y = PITCH_PX * np.array(pitch)
    image = np.full((int(10 * y), int(13 * x)), 200, dtype=np.uint8)
    axes = tuple(int(16 * RADIUS_PX * factor) for factor in radius)
    for row in range(9):
        for column in range(12):
            centre = (int(16 * (column + 1) * x) + 3 * row, int(16 * (row + 1) * y) + 5 * column)
            cv2.ellipse(image, centre, axes, 0, 0, 360, 40, -1, cv2.LINE_AA, 4)
    cv2.imwrite(str(path), cv2.GaussianBlur(image, (0, 0), 0.8))
    return str(path)


def layout_line(path: str) -> str:
    """The line about the layout."""
    return next(line for line in diagnose(path) if line.startswith("layout:"))


@pytest.mark.parametrize(
    ("squeezed", "words"), [((0.75, 1.0), "taller than wide"), ((1.0, 0.75), "wider than tall")]
)
def test_squeezed_dots_and_distances_are_a_squeezed_picture(
    tmp_path: Path, squeezed: tuple[float, float], words: str
) -> None:
    line = layout_line(write_picture(tmp_path / "squeezed.png", pitch=squeezed, radius=squeezed))
    assert "the pitch differs by 33% along x and y" in line
    assert words in line
    assert "squeezed" in line
    assert "--pitch-mm" not in line


@pytest.mark.parametrize("radius", [(0.8, 0.8), (0.9, 0.7)])
def test_other_dots_at_odd_distances_are_an_odd_print(tmp_path: Path, radius: tuple[float, float]) -> None:
    line = layout_line(write_picture(tmp_path / "odd.png", pitch=(0.75, 1.0), radius=radius))
    assert "the shape of the dots does not" in line
    assert "--pitch-mm X,Y" in line
    assert "squeezed" not in line


def test_an_even_print_gets_no_advice(tmp_path: Path) -> None:
    line = layout_line(write_picture(tmp_path / "even.png", pitch=(1.0, 1.0), radius=(1.0, 1.0)))
    assert line.startswith("layout: 9 rows x 12 columns")
    assert "pitch differs" not in line


def test_of_a_picture_all_is_looked_at(tmp_path: Path) -> None:
    lines = list(diagnose(write_picture(tmp_path / "one.png", pitch=(1.0, 1.0), radius=(1.0, 1.0))))
    assert "rest: taken from the only frame, which shows no motion" in lines
    assert not any("only the first" in line for line in lines)


@pytest.mark.parametrize("changes", ["everywhere", "in a half", "nowhere"])
def test_compressed_video_is_noticed_as_in_processing(tmp_path: Path, changes: str) -> None:
    image = picture()
    for frame in range(START_FRAMES):
        new = image if changes == "nowhere" else picture(seed=frame)
        half = 0 if changes == "everywhere" else image.shape[1] // 2
        image = np.hstack([image[:, :half], new[:, half:]])
        cv2.imwrite(str(tmp_path / f"{frame:03}.png"), image)
    lines = list(diagnose(str(tmp_path)))
    assert (f"warning: {COMPRESSED_VIDEO}" in lines) == (changes == "in a half")
    assert not any("codec" in line for line in lines)


@pytest.mark.parametrize("has_dots", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_few_dots_that_the_first_frames_do_not_show_are_found(tmp_path: Path, has_dots: bool) -> None:
    for frame in range(0, 320, 4):
        image = moving_scene.picture(frame, has_dots=has_dots and frame >= 4 * START_FRAMES).image
        assert image is not None
        cv2.imwrite(str(tmp_path / f"{frame:03}.png"), image)
    lines = list(diagnose(str(tmp_path)))
    assert any("the whole recording is read" in line for line in lines)
    (dots,) = (line for line in lines if line.startswith("dots:"))
    layout = [line for line in lines if line.startswith("layout:")]
    if has_dots:
        assert re.match(r"dots: 2[2-4]; the dots are few, or other things are seen between them", dots)
        assert len(layout) == 1
    else:
        assert "no dots were found" in dots
        assert layout == []
