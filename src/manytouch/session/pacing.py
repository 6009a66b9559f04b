"""Delays frames of files until they are due."""

import time
from collections.abc import Callable

LONGEST_SLEEP_S = 0.05  # between two checks whether to end; a choice
LONGEST_STEP_NS = 60 * 10**9
"""Between two frames, forwards or backwards, by choice: a larger one is a clock that was set, or a pause that
nobody wants to wait for, and the frame after it is due at once."""


class Pace:
    """Delays frames until they are due, counted from the first after a `reset`.

    Attributes:
        speed: multiple of the pace of the timestamps.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self.speed = speed
        self._begin_s: float | None = None
        self._first_ns = 0
        self._latest_ns: int | None = None

    def begin(self, at_ns: int) -> None:
        """Timestamp 0 is due at a time of the monotonic clock."""
        self._begin_s, self._first_ns = at_ns * 1e-9, 0

    def reset(self) -> None:
        """Count from the next frame."""
        self._begin_s = None

    def wait_for(self, timestamp_ns: int, is_over: Callable[[], bool]) -> None:
        """Sleep until a frame of this timestamp is due, or `is_over` returns True."""
        if self._latest_ns is not None and abs(timestamp_ns - self._latest_ns) > LONGEST_STEP_NS:
            self.reset()
        if self._begin_s is None:
            self._begin_s, self._first_ns = time.monotonic(), timestamp_ns
        self._latest_ns = timestamp_ns
        self._sleep_until(self._begin_s, timestamp_ns, is_over)

    def wait_for_next(self, fps: float | None, is_over: Callable[[], bool]) -> None:
        """Sleep until the frame after the latest one is due at this rate; the first one is due at once."""
        if self._begin_s is not None and self._latest_ns is not None and fps is not None:
            self._sleep_until(self._begin_s, self._latest_ns + round(1e9 / fps), is_over)

    def _sleep_until(self, begin_s: float, timestamp_ns: int, is_over: Callable[[], bool]) -> None:
        due_s = begin_s + (timestamp_ns - self._first_ns) * 1e-9 / self.speed
        while (wait_s := due_s - time.monotonic()) > 0 and not is_over():
            time.sleep(min(wait_s, LONGEST_SLEEP_S))
