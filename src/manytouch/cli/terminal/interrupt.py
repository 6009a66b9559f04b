"""Ctrl-C, SIGTERM and the end of the terminal as a request to stop: the current frame and all files are
completed."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, ClassVar

from manytouch.cli.terminal.failures import has_no_reader

TERMINATED = 128 + int(signal.SIGTERM)
HANG_UP: int | None = None if sys.platform == "win32" else signal.SIGHUP
"""Sent when the terminal is closed, or the connection to it lost; not on Windows."""


class StopOnSignal:
    """Within its block Ctrl-C, SIGTERM or SIGHUP requests a stop; a second Ctrl-C raises KeyboardInterrupt.

    Calling it returns whether a stop is requested. A SIGHUP that is ignored, as with nohup, stays so. In
    another thread than the main one, its block changes nothing.

    Attributes:
        is_live: whether a standard output that nobody reads any more requests a stop too: a live session may
            have no end of its own.
        is_terminated: whether SIGTERM or SIGHUP has requested a stop in this process, whose exit status is
            then `TERMINATED`, since the program that has sent it wanted no more than what is complete.
    """

    is_terminated: ClassVar[bool] = False

    def __init__(self, *, is_live: bool = False) -> None:
        self.is_live = is_live
        self._is_requested = False
        self._is_at_once = False
        self._previous: dict[int, Any] = {}
        self._terminals: list[int] = []

    def __call__(self) -> bool:
        return self._is_requested or (self.is_live and has_no_reader())

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
        if threading.current_thread() is not threading.main_thread():
            return self  # which alone gets signals
        self._terminals = [each for each in (1, 2) if os.isatty(each)]
        for number in (signal.SIGINT, signal.SIGTERM):
            self._previous[number] = signal.signal(number, self._note)
        if HANG_UP is not None and signal.getsignal(HANG_UP) is not signal.SIG_IGN:
            self._previous[HANG_UP] = signal.signal(HANG_UP, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if number == HANG_UP:
            self._leave_terminal()
        if number != signal.SIGINT:
            StopOnSignal.is_terminated = True
        if self._is_at_once or (self._is_requested and number == signal.SIGINT):
            raise KeyboardInterrupt
        self._is_requested = True
        again = "" if StopOnSignal.is_terminated else "; press Ctrl-C again to stop at once"
        sys.stderr.write(f"\nstopping when the present step is complete{again}\n")

    def _leave_terminal(self) -> None:
        """Print to nowhere what went to the terminal: it is gone, and an error of printing ends the run."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for each in self._terminals:
            os.dup2(nowhere, each)
        os.close(nowhere)
