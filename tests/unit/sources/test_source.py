"""Frames are read up to a number, and the device is released whatever happens."""

from collections.abc import Iterator

import pytest

from drawn_source import DrawnSource
from manytouch.sources import Capabilities, Source, closing_source, read_frames
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
