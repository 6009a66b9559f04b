"""A source whose frames are drawn while it is read."""

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from clips import picture, press_of
from manytouch.sources import Capabilities
from manytouch.values import Frame, Press, Release


@functools.cache
def drawn(press: float, seed: int) -> np.ndarray:
    """A drawn frame, read-only; each is drawn once."""
    image = picture(press, seed=seed)
    image.flags.writeable = False
    return image


@dataclass
class DrawnSource:
    """Frames of a sheet that is pressed from frame 20 to 40.

    Attributes:
        is_touched: whether it is pressed at all.
        skips: indices that a live source has dropped.
        fails_at: index instead of which `error` is raised.
        change: applied to each frame, such as to move it.
        is_images: whether the frames are single images.
        files: that it states to read.
        taken: indices that were read.
        pressed: commands that were received.
    """

    frames: int = 40
    is_touched: bool = True
    is_live: bool = False
    skips: tuple[int, ...] = ()
    fails_at: int | None = None
    error: type[BaseException] = ValueError
    name: str = "drawn"
    fps: float | None = 1000.0
    width_px: int = 320
    height_px: int = 240
    change: Callable[[int, np.ndarray], np.ndarray] = lambda _, image: image
    is_images: bool = False
    files: tuple[Path, ...] = ()
    taken: list[int] = field(default_factory=list)
    pressed: list[Press | Release] = field(default_factory=list)

    @property
    def frame_count(self) -> int:
        return self.frames

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(press=self.pressed.append, is_images=self.is_images, files=self.files)

    def __iter__(self) -> Iterator[Frame]:
        for index in range(self.frames):
            if index == self.fails_at:
                raise self.error("the camera fell off the table")
            if index in self.skips:
                continue
            self.taken.append(index)
            yield Frame(
                index=index,
                timestamp_ns=round(index * 1e9 / (self.fps or 25.0)),
                camera=self.name,
                image=self.change(index, drawn(press_of(index) if self.is_touched else 0.0, index)),
                arrived_ns=time.monotonic_ns() if self.is_live else None,
            )
