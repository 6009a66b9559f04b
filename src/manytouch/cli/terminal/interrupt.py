"""Ctrl-C and SIGTERM as a request to stop: the current frame and all files are completed."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, ClassVar

TERMINATED = 128 + int(signal.SIGTERM)


class StopOnSignal:
    """Within its block Ctrl-C or SIGTERM requests a stop, and a second Ctrl-C raises KeyboardInterrupt.

    Calling it returns whether a stop is requested.

    Attributes:
        is_terminated: whether SIGTERM has requested a stop in this process, whose exit status is then
            `TERMINATED`, since the program that has sent it wanted no more than what is complete.
    """

    is_terminated: ClassVar[bool] = False

    def __init__(self) -> None:
        self._is_requested = False
        self._is_at_once = False
        self._previous: dict[signal.Signals, Any] = {}

    def __call__(self) -> bool:
        return self._is_requested

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Within this block the first signal raises KeyboardInterrupt: nothing has been written yet."""
        self._is_at_once = True
        try:
            yield
        finally:
            self._is_at_once = False

    def __enter__(self) -> "StopOnSignal":
        StopOnSignal.is_terminated = False
        for number in (signal.SIGINT, signal.SIGTERM):
            self._previous[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if number == signal.SIGTERM:
            StopOnSignal.is_terminated = True
        if self._is_at_once or (self._is_requested and number == signal.SIGINT):
            raise KeyboardInterrupt
        self._is_requested = True
        again = "" if StopOnSignal.is_terminated else "; press Ctrl-C again to stop at once"
        sys.stderr.write(f"\nstopping after this frame{again}\n")
