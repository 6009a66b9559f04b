"""Frames that show what a source is: the first ones, or some of a whole recording.

A camera that gives none is not waited for for ever.
"""

import threading
import time
from collections.abc import Iterator
from itertools import islice
from types import TracebackType

from manytouch.errors import SourceError
from manytouch.sources.source import Device, Source
from manytouch.values import Frame

PATIENCE_S = 10.0  # with a camera that is silent or disconnected before a session has begun; a choice
POLL_S = 0.2
SPREAD_FRAMES = 16
"""Number of frames that represent a whole recording."""


def first_frames(frames: Iterator[Frame], count: int, device: Device | None) -> tuple[Frame, ...]:
    """The next frames of a source; fewer if it ends before.

    Args:
        frames: of the source.
        count: how many.
        device: of the source, if it has one.

    Raises:
        SourceError: the device has given no image for some seconds; it is closed then.
    """
    if device is None:
        return tuple(islice(frames, count))
    with _Watch(device) as watch:
        found = tuple(islice(frames, count))
    if watch.state is not None and len(found) < count:
        raise SourceError(
            f"only {len(found)} of the first {count} images came ({watch.state}): check the camera, its "
            "cable or its network, and start again"
        )
    return found


def can_be_read_twice(source: Source) -> bool:
    """Whether frames of the whole source can be read before it is processed."""
    return not source.is_live and source.frame_count != 1


def spread_frames(source: Source) -> list[Frame]:
    """Up to `SPREAD_FRAMES` frames spread evenly over a recording."""
    step = max(1, (source.frame_count or SPREAD_FRAMES) // SPREAD_FRAMES)
    return list(islice(source, 0, step * SPREAD_FRAMES, step))


class _Watch:
    """Closes a device, in a thread of its own, when it has not been ok for `PATIENCE_S` within the block.

    Attributes:
        state: of the device when it was closed; None if it was not.
    """

    def __init__(self, device: Device) -> None:
        self.state: str | None = None
        self._device = device
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="manytouch-first-frames", daemon=True)

    def __enter__(self) -> "_Watch":
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        ok_s = time.monotonic()
        while not self._is_over.wait(POLL_S):
            state = self._device.status
            if state == "ok":
                ok_s = time.monotonic()
            elif time.monotonic() - ok_s > PATIENCE_S:
                self.state = state
                self._device.close()
                return
