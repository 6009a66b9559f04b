"""A wrapper by which a slow sink does not delay the others."""

import threading
import time

from manytouch.pipeline import Sink
from manytouch.values import Reading


class LatestOnly:
    """Writes to a sink from its own thread; of the readings that arrive meanwhile only the newest is kept.

    After an error the sink gets no more readings; `close` raises the error.

    Attributes:
        interval_s: least time between the beginnings of two writes.
        skipped: readings that were not written, because newer ones replaced them.
    """

    def __init__(self, sink: Sink, *, interval_s: float = 0.0) -> None:
        self._sink = sink
        self.interval_s = interval_s
        self._change = threading.Condition()
        self._next: Reading | None = None
        self._is_closing = threading.Event()
        self._error: Exception | None = None
        self.skipped = 0
        self._thread = threading.Thread(target=self._run, name="manytouch-latest", daemon=True)
        self._thread.start()

    def write(self, reading: Reading) -> None:
        """Queue a reading for the sink; never waits."""
        with self._change:
            self.skipped += self._next is not None
            self._next = reading
            self._change.notify()

    def close(self) -> None:
        """Write the last reading and close the sink."""
        with self._change:
            self._is_closing.set()
            self._change.notify()
        self._thread.join()
        self._sink.close()
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._next is not None or self._is_closing.is_set())
                reading, self._next = self._next, None
            if reading is None:
                return
            begin_s = time.monotonic()
            try:
                self._sink.write(reading)
            except Exception as error:  # noqa: BLE001 - raised by `close`
                self._error = error
                return
            left_s = begin_s + self.interval_s - time.monotonic()
            if left_s > 0.0:
                self._is_closing.wait(left_s)
