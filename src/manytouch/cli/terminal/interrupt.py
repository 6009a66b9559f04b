"""Ctrl-C as a wish: the frame at hand is finished, and so are the files."""

import signal
import sys
from types import FrameType, TracebackType


class Stop:
    """Within its block the first Ctrl-C is only noted; a second one interrupts at once.

    Call it to ask whether to stop.
    """

    def __init__(self) -> None:
        self._asked = False
        self._before: object = signal.SIG_DFL

    def __call__(self) -> bool:
        return self._asked

    def __enter__(self) -> "Stop":
        self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        signal.signal(signal.SIGINT, self._before)  # type: ignore[arg-type]

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True
        sys.stderr.write("\nstopping after this frame; Ctrl-C again stops at once\n")
