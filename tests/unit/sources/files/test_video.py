"""Videos: whole, damaged and cut short; no frame of a healthy one is called lost."""

import shutil
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.sources import open_source
from manytouch.sources.files.containers import Container, read_container
from manytouch.sources.files.video import VideoSource, frames_lost
from manytouch.values import Frame

COUNT, FPS = 40, 24.0
KINDS = {"a.mp4": "mp4v", "b.avi": "MJPG", "c.mkv": "MJPG", "d.mov": "mp4v"}


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("videos")
    for name, code in KINDS.items():
        writer = cv2.VideoWriter(str(folder / name), cv2.VideoWriter_fourcc(*code), FPS, (160, 96))
        assert writer.isOpened()
        texture = np.random.default_rng(0).integers(60, 255, (12, 20, 3)).astype(np.uint8)
        for index in range(COUNT):
            image = cv2.resize(np.roll(texture, index, 1), (160, 96), interpolation=cv2.INTER_LINEAR)
            for bit in range(6):
                image[:16, 16 * bit : 16 * bit + 16] = 255 * (index >> bit & 1)
            writer.write(image)
        writer.release()
    return {name: folder / name for name in KINDS}


def numbers(frames: list[Frame]) -> list[int | None]:
    """Which frame each picture shows: its number in binary, in blocks at the upper border."""
    return [
        None
        if frame.image is None
        else sum(int(frame.image[4:12, 16 * bit + 4 : 16 * bit + 12].mean() > 127) << bit for bit in range(6))
        for frame in frames
    ]


@pytest.mark.parametrize("name", KINDS)
def test_a_healthy_video_gives_every_frame(videos: dict[str, Path], name: str) -> None:
    source = open_source(videos[name])
    frames = list(source)
    assert numbers(frames) == list(range(COUNT))
    assert [frame.index for frame in frames] == list(range(COUNT))
    assert [frame.timestamp_ns for frame in frames] == pytest.approx(
        [round(index * 1e9 / FPS) for index in range(COUNT)], abs=1_000_000
    )
    assert (source.frame_count, source.width_px, source.height_px) == (COUNT, 160, 96)
    assert source.fps == pytest.approx(FPS)
    assert source.name == frames[0].camera == name[0]
    assert numbers(list(source)) == list(range(COUNT))
    assert not frames[0].image.flags.writeable
    assert all(frame.is_predicted == (KINDS[name] == "mp4v") for frame in frames)
    assert frames[0].image.base is None


def test_a_given_rate_replaces_the_clock(videos: dict[str, Path]) -> None:
    source = open_source(videos["a.mp4"], fps=10.0)
    assert source.fps == 10.0
    assert [frame.timestamp_ns for frame in source][:3] == [0, 100_000_000, 200_000_000]


def test_frames_stay_when_the_video_goes_on(videos: dict[str, Path]) -> None:
    frames = iter(open_source(videos["a.mp4"]))
    first = next(frames)
    kept = first.image.copy()
    for _ in frames:
        pass
    assert np.array_equal(first.image, kept)


@pytest.mark.parametrize("name", ["b.avi", "c.mkv"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_the_lost_end_of_a_cut_video_is_counted(
    videos: dict[str, Path], tmp_path: Path, name: str, share: float, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = videos[name].read_bytes()
    (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
    frames = list(open_source(tmp_path / name))
    shown = numbers(frames)
    decoded = shown.index(None)
    assert 0.2 * COUNT < decoded < COUNT
    assert shown == [*range(decoded), *[None] * (COUNT - decoded)]
    assert all(after.timestamp_ns > before.timestamp_ns for before, after in pairwise(frames))
    assert capfd.readouterr() == ("", "")


def test_a_video_without_its_index_is_refused(videos: dict[str, Path], tmp_path: Path) -> None:
    whole = videos["a.mp4"].read_bytes()
    (tmp_path / "a.mp4").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SourceError, match="cut short"):
        open_source(tmp_path / "a.mp4")


@pytest.mark.parametrize("name", KINDS)
def test_a_damaged_stretch_costs_its_frames_alone(
    videos: dict[str, Path], tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    damaged = bytearray(videos[name].read_bytes())
    middle, length = len(damaged) // 2, len(damaged) // 12
    damaged[middle : middle + length] = np.random.default_rng(1).bytes(length)
    (tmp_path / name).write_bytes(damaged)
    frames = list(open_source(tmp_path / name))
    assert len(frames) == COUNT
    assert [frame.index for frame in frames] == list(range(COUNT))
    assert sum(frame.image is not None for frame in frames) > 0.7 * COUNT
    assert all(after.timestamp_ns > before.timestamp_ns for before, after in pairwise(frames))
    assert capfd.readouterr() == ("", "")


def test_a_video_replaced_by_nothing_has_lost_all(videos: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "b.avi"
    path.write_bytes(videos["b.avi"].read_bytes())
    source = open_source(path)
    path.write_bytes(videos["b.avi"].read_bytes()[:100])
    assert numbers(list(source)) == [None] * COUNT


@pytest.mark.parametrize("name", KINDS)
def test_containers_know_their_length(videos: dict[str, Path], tmp_path: Path, name: str) -> None:
    kind = {"mp4": "mp4", "mov": "mp4", "avi": "riff", "mkv": "matroska"}[name[2:]]
    container = read_container(videos[name])
    assert (container.kind, container.is_cut_short) == (kind, False)
    whole = videos[name].read_bytes()
    for length in (len(whole) - 1, len(whole) // 2):
        (tmp_path / name).write_bytes(whole[:length])
        container = read_container(tmp_path / name)
        assert (container.kind, container.is_cut_short) == (kind, True)
    for length in (0, 5, 11):
        (tmp_path / name).write_bytes(whole[:length])
        read_container(tmp_path / name)


def test_promises_count_only_where_they_are_exact() -> None:
    healthy = {
        kind: Container(kind=kind, is_cut_short=False) for kind in ("riff", "mp4", "matroska", "other")
    }
    cut = Container(kind="matroska", is_cut_short=True)
    assert frames_lost(None, 10, 0, cut) == 0
    assert frames_lost(100, 60, 0, cut) == 40
    assert frames_lost(100, 99, 1, healthy["mp4"]) == 1
    assert frames_lost(100, 60, 0, healthy["mp4"]) == 0  # an edit list
    assert frames_lost(100, 60, 0, healthy["matroska"]) == 0  # a duration times a rate
    assert frames_lost(100, 98, 0, healthy["riff"]) == 0
    assert frames_lost(100, 97, 0, healthy["riff"]) == 3
    assert frames_lost(100, 60, 5, healthy["other"]) == 0
    assert frames_lost(100, 120, 0, cut) == 0


def test_a_video_is_lazy(videos: dict[str, Path]) -> None:
    source = open_source(videos["b.avi"])
    assert isinstance(source, VideoSource)
    one, two = iter(source), iter(source)
    assert numbers([next(one), next(one), next(two)]) == [0, 1, 0]


@pytest.mark.parametrize("name", KINDS)
def test_a_video_that_is_moved_while_it_is_read_gives_every_frame(
    videos: dict[str, Path], tmp_path: Path, name: str
) -> None:
    path = Path(shutil.copy(videos[name], tmp_path))
    frames = iter(open_source(path))
    first = [next(frames) for _ in range(3)]
    path.rename(tmp_path / f"moved{path.suffix}")
    assert numbers([*first, *frames]) == list(range(COUNT))
