"""Ctrl-C as a request to stop: the current frame and all files are completed."""

import signal
import sys
from types import FrameType, TracebackType


class Stop:
    """Within its block the first Ctrl-C requests a stop, and a second one raises KeyboardInterrupt.

    Calling it returns whether a stop is requested.
    """

    def __init__(self) -> None:
        self._is_requested = False
        self._previous_handler: object = signal.SIG_DFL

    def __call__(self) -> bool:
        return self._is_requested

    def __enter__(self) -> "Stop":
        self._previous_handler = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        signal.signal(signal.SIGINT, self._previous_handler)  # type: ignore[arg-type]

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._is_requested:
            raise KeyboardInterrupt
        self._is_requested = True
        sys.stderr.write("\nstopping after this frame; press Ctrl-C again to stop at once\n")
