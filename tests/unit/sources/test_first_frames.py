"""The first frames of a camera that gives too few."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from manytouch.errors import SourceError
from manytouch.sources import first_frames as module
from manytouch.sources.first_frames import first_frames
from manytouch.values import Frame


@dataclass
class Camera:
    """Gives some frames, and then none until it is closed.

    Attributes:
        frames: how many it gives.
        status: as of a device.
    """

    frames: int
    status: str = "ok"
    is_colour: bool = False
    settings: tuple[()] = ()
    is_closed: threading.Event = field(default_factory=threading.Event)

    def __iter__(self) -> Iterator[Frame]:
        for index in range(self.frames):
            yield Frame(index=index, timestamp_ns=index, camera="mine", image=None)
        self.status = "no image since it was disconnected"
        self.is_closed.wait()

    def listen(self, tap: object) -> None: ...

    def close(self) -> None:
        self.is_closed.set()


def test_a_camera_that_stops_before_a_session_begins_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 0.1)
    monkeypatch.setattr(module, "POLL_S", 0.02)
    camera = Camera(frames=4)
    with pytest.raises(SourceError, match=r"only 4 of the first 15 images came \(no image since"):
        first_frames(iter(camera), 15, camera)
    assert camera.is_closed.is_set()


def test_a_camera_that_gives_enough_stays_open() -> None:
    camera = Camera(frames=20)
    frames = iter(camera)
    assert [frame.index for frame in first_frames(frames, 15, camera)] == list(range(15))
    assert [frame.index for frame in first_frames(frames, 3, None)] == [15, 16, 17]
    assert not camera.is_closed.is_set()
