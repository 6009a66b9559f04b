"""The interface of every source of frames, and what a source can do beyond giving frames."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Protocol, runtime_checkable

from manytouch.values import Frame, Press, Reading, Release, Sensor, Setting, Truth

ASSUMED_FPS = 30.0  # where a source states no rate


@runtime_checkable
class Device(Protocol):
    """The camera or connection behind a live source.

    Attributes:
        settings: what was requested, and what the camera reports.
        is_colour: decode frames in colour.
    """

    settings: tuple[Setting, ...]
    is_colour: bool

    @property
    def status(self) -> str:
        """ "ok", or a sentence about what is wrong."""

    def listen(self, tap: Callable[[Frame], None] | None) -> None:
        """Pass every frame to `tap` as it arrives, before any may be dropped; None ends that."""

    def close(self) -> None:
        """Release the device; iterations over its frames end."""


@runtime_checkable
class Timeline(Protocol):
    """Frames that can be read in any order, with their stored readings."""

    @property
    def method(self) -> str:
        """Method of the stored readings."""

    @property
    def warning(self) -> str | None:
        """A sentence about damage of the file, or None."""

    def __len__(self) -> int:
        """Number of frames."""

    def timestamp_ns(self, place: int) -> int:
        """Stored timestamp of the frame at a place."""

    def frame(self, place: int) -> Frame:
        """The frame at a place, decoded."""

    def reading(self, place: int) -> Reading | None:
        """The stored reading of the frame at a place; None when there is none."""

    def stored_reading(self, frame_index: int) -> Reading | None:
        """The stored reading of a frame by its number, without image; None when there is none."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Capabilities:
    """What a source can do beyond giving frames; None where it cannot.

    Attributes:
        truth: ground truth of a frame by its number; returns None for frames that are forgotten.
        press: puts a finger on the simulated sheet, moves it or lifts it.
        device: the camera or connection behind the source.
        seek: access to frames in any order.
        sensor: the sensor that belongs to the source.
        files: the files that are read; of images one per frame.
        is_images: single images instead of a video.
        views: number of cameras whose pictures are joined in a frame.
        started_unix_ns: time of timestamp 0, of a recording.
        close: ends the process that makes its frames.
    """

    truth: Callable[[int], Truth | None] | None = None
    press: Callable[[Press | Release], None] | None = None
    device: Device | None = None
    seek: Timeline | None = None
    sensor: Sensor | None = None
    files: tuple[Path, ...] = ()
    is_images: bool = False
    views: int = 1
    started_unix_ns: int | None = None
    close: Callable[[], None] | None = None


@runtime_checkable
class Source(Protocol):
    """An iterable of frames; each `iter()` starts at the first frame again.

    It may be iterated in another thread, and files are read some frames ahead of what is estimated: the image
    of a frame must not change once it was given.

    Attributes:
        name: stem for the folder of its results.
        fps: its own rate in frames per second; None when it states none.
        frame_count: expected number of frames; may be an estimate, None when not known.
        width_px, height_px: size of its images.
        is_live: frames come at their own pace, so that slow processing has to drop some.
        capabilities: what it can do beyond giving frames.
    """

    @property
    def name(self) -> str: ...

    @property
    def fps(self) -> float | None: ...

    @property
    def frame_count(self) -> int | None: ...

    @property
    def width_px(self) -> int | None: ...

    @property
    def height_px(self) -> int | None: ...

    @property
    def is_live(self) -> bool: ...

    @property
    def capabilities(self) -> Capabilities: ...

    def __iter__(self) -> Iterator[Frame]: ...


def close(source: Source) -> None:
    """Release the device or the process of a source, where it has one."""
    can = source.capabilities
    if can.device is not None:
        can.device.close()
    if can.close is not None:
        can.close()


@contextmanager
def closing_source(source: Source) -> Iterator[Source]:
    """Release a source at the end of a `with` block."""
    try:
        yield source
    finally:
        close(source)


def read_frames(source: Source, count: int) -> list[Frame]:
    """The first frames of a source, which is released then."""
    with closing_source(source):
        return list(islice(source, count))


def evenly_timed_ns(index: int, fps: float | None) -> int:
    """Timestamp of a frame of a source that keeps a constant rate."""
    return round(index * 1e9 / (fps or ASSUMED_FPS))
