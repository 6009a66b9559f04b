"""Recordings of other people's sensors, turned, with other light or begun later: results change little."""

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

import manytouch
from manytouch.values import Roi
from results import Tracks, rows_of

Change = Callable[[np.ndarray], np.ndarray]
REGIONS = {"left": Roi(58, 102, 238, 216), "right": Roi(308, 96, 232, 212)}


def grey(image: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR))


def brighter(image: np.ndarray) -> np.ndarray:
    return np.asarray((255.0 * (image / 255.0) ** 0.7).round().astype(np.uint8))


def changed(path: Path, folder: Path, change: Change, begin: int = 0) -> Path:
    """The results of a recording from a frame on, each picture being changed; stored without loss."""
    capture, out = cv2.VideoCapture(str(path)), folder / "changed.avi"
    writer, index = None, -1
    while (image := capture.read()[1]) is not None:
        index += 1
        if index < begin:
            continue
        picture = np.ascontiguousarray(change(image))
        if writer is None:
            size = picture.shape[1], picture.shape[0]
            writer = cv2.VideoWriter(str(out), cv2.VideoWriter_fourcc(*"FFV1"), 30.0, size)
        writer.write(picture)
    assert writer is not None
    writer.release()
    return manytouch.process(out, out=folder / "results")


def is_touched(folder: Path) -> np.ndarray:
    """(f,) whether something touches in each frame."""
    found = np.zeros(len(rows_of(folder / "frames.csv")), dtype=bool)
    found[[int(row["frame"]) for row in rows_of(folder / "contacts.csv") if row["phase"] != "end"]] = True
    return found


@pytest.mark.slow
@pytest.mark.parametrize("change", [np.rot90, grey, np.invert], ids=["turned", "grey", "inverted"])
def test_two_fingers_on_a_white_sheet(recordings: Path, tmp_path: Path, change: Change) -> None:
    path = recordings / "worachit" / "marker_stable_2mm_2.mp4"
    expected = is_touched(manytouch.process(path, out=tmp_path))
    assert np.mean(is_touched(changed(path, tmp_path, change)) == expected) > 0.97


@pytest.mark.slow
@pytest.mark.parametrize("change", [np.fliplr, brighter], ids=["mirrored", "brighter"])
def test_a_faint_touch_that_is_held(recordings: Path, tmp_path: Path, change: Change) -> None:
    """Frames 0 to 4 and 13 to 88 are touched, by eye."""
    found = is_touched(changed(recordings / "gelsight_mini_grip" / "ball7.avi", tmp_path, change))
    assert found[20:88].all()
    assert not found[89:].any()
    assert not found[6:13].any()


@pytest.mark.slow
@pytest.mark.parametrize("begin", [150, 300, 520])
def test_a_transparent_skin_from_any_frame_on(recordings: Path, tmp_path: Path, begin: int) -> None:
    path = recordings / "fingervision" / "cam1_0002_first900.mp4"
    folder = changed(path, tmp_path, np.asarray, begin)
    assert is_touched(folder).mean() <= 0.02
    tracks = Tracks.read(folder)
    assert 23 <= tracks.is_seen.shape[1] <= 26
    assert tracks.is_seen.mean() >= 0.97


@pytest.mark.parametrize(
    ("side", "begin"), [("left", 12), *(pytest.param(side, 84, marks=pytest.mark.slow) for side in REGIONS)]
)
def test_dots_in_a_mirror_from_a_pressed_picture_on(
    recordings: Path, tmp_path: Path, side: str, begin: int
) -> None:
    """Pictures far apart in time: the dots move between all of the first ones."""
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for path in sorted((recordings / "vts4" / "0507").iterdir())[begin : begin + 44]:
        (pictures / path.name).symlink_to(path)
    tracks = Tracks.read(manytouch.process(pictures, out=tmp_path, roi_px=REGIONS[side]))
    assert 56 <= tracks.is_seen.shape[1] <= 64
    assert tracks.is_seen[10:].mean() > 0.95  # before, the shift may be ambiguous


@pytest.mark.parametrize("degrees", [30.0, pytest.param(90.0, marks=pytest.mark.slow)])
def test_rings_of_dots_turned(recordings: Path, tmp_path: Path, degrees: float) -> None:
    """All that a picture shows is at rest in it: nearly every marker is seen."""
    image = cv2.imread(str(recordings / "single" / "simtacls_bot.jpg"))
    middle = (image.shape[1] - 1) / 2, (image.shape[0] - 1) / 2
    turn = cv2.getRotationMatrix2D(middle, degrees, 1.0)
    size = image.shape[1], image.shape[0]
    path = tmp_path / "turned.png"
    cv2.imwrite(str(path), cv2.warpAffine(image, turn, size, borderMode=cv2.BORDER_REPLICATE))
    folder = manytouch.process(path, out=tmp_path)
    assert rows_of(folder / "frames.csv")[0]["status"] == "ok"
    assert Tracks.read(folder).is_seen.mean() > 0.9


@pytest.mark.slow
def test_views_in_two_mirrors_are_named(recordings: Path, tmp_path: Path) -> None:
    """Without a region of interest, a sentence names one for each mirror."""
    first = sorted((recordings / "vts4" / "0507").iterdir())[0]
    summary = json.loads((manytouch.process(first, out=tmp_path) / "summary.json").read_text())
    sentence = next(each for each in summary["assumptions"] if "2 groups" in each)
    for text, expected in zip(sentence.split("--roi ")[1:], REGIONS.values(), strict=True):
        x, y, width, height = map(int, text.replace(".", " ").split()[0].split(","))
        inside = np.array([x + width / 2, y + height / 2]) - [expected.x_px, expected.y_px]
        assert ((inside > 0) & (inside < [expected.width_px, expected.height_px])).all()
