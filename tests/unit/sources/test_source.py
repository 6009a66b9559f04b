"""Frames are read up to a number, and the device is released whatever happens."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from clips import picture, write_video
from drawn_source import DrawnSource
from manytouch.sources import Capabilities, Source, closing_source, open_source, read_frames
from manytouch.sources.pressed.pressed_source import PressedSource
from manytouch.sources.simulated import simulated_source
from manytouch.values import Frame, Setting


class Watched(DrawnSource):
    """A source with a device that notes that it was closed."""

    status, is_colour = "ok", False
    settings: tuple[Setting, ...] = ()
    closed = 0

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(device=self)

    def listen(self, tap: object) -> None: ...

    def close(self) -> None:
        self.closed += 1


def test_only_the_first_frames_are_read_and_the_device_is_released() -> None:
    source = Watched()
    assert isinstance(source, Source)
    assert [frame.index for frame in read_frames(source, 7)] == list(range(7))
    assert source.closed == 1


def test_an_error_releases_the_device_too() -> None:
    source = Watched(fails_at=3)
    with pytest.raises(ValueError, match="fell off"):
        read_frames(source, 7)
    assert source.closed == 1


def test_a_source_without_a_device_needs_no_release() -> None:
    with closing_source(DrawnSource(frames=2)) as source:
        frames: Iterator[Frame] = iter(source)
        assert next(frames).index == 0


def can(source: Source) -> set[str]:
    """Names of the capabilities that a source has."""
    has = source.capabilities
    return {name for name in ("truth", "press", "device", "seek", "sensor", "files") if getattr(has, name)}


def test_capabilities_state_what_each_source_can_do(tmp_path: Path) -> None:
    video = write_video(tmp_path / "a.mp4", [picture(seed=seed) for seed in range(3)])
    (tmp_path / "images").mkdir()
    for number in range(2):
        cv2.imwrite(str(tmp_path / "images" / f"{number}.png"), picture(seed=number))
    images = open_source(tmp_path / "images")
    assert can(open_source(video)) == can(images) == {"files"}
    assert open_source(video).capabilities.files == (video,)
    assert [path.name for path in images.capabilities.files] == ["0.png", "1.png"]
    assert images.capabilities.is_images
    assert not open_source(video).capabilities.is_images
    assert can(simulated_source("rest", width_px=160)) == {"truth", "sensor"}
    assert can(PressedSource("rest", width_px=160)) == {"truth", "press", "sensor"}
