"""What every source of frames can be asked."""

from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

from manytouch.values import Frame, Setting

ASSUMED_FPS = 30.0  # where a source does not say its own rate


@runtime_checkable
class Source(Protocol):
    """An iterable of frames; each `iter()` starts at the first one again.

    Attributes:
        name: stem for the folder of its results.
        fps: its own rate in frames per second; None when it does not say.
        frame_count: how many frames to expect, for progress bars; may be an estimate, None when not known.
        width_px, height_px: size of its images.
        is_live: does it go on without us, so that slow processing has to drop frames?
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

    def __iter__(self) -> Iterator[Frame]: ...


@runtime_checkable
class Device(Source, Protocol):
    """A source that holds a camera or a connection.

    Attributes:
        status: "ok", or a sentence about what is wrong.
        settings: what it was asked for, and what it says.
        is_colour: decode in colour?
    """

    status: str
    settings: tuple[Setting, ...]
    is_colour: bool

    def listen(self, tap: Callable[[Frame], None] | None) -> None:
        """Hand every frame to `tap` as it arrives, before any may be dropped; None ends that."""

    def close(self) -> None:
        """Let go of it; iterations end."""


def evenly_timed_ns(index: int, fps: float | None) -> int:
    """Timestamp of a frame of a source that keeps a constant rate."""
    return round(index * 1e9 / (fps or ASSUMED_FPS))
