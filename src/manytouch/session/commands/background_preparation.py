"""Prepares values in a thread, such as a method that has to be compiled, while their user goes on without."""

import threading
import time
from collections.abc import Callable
from typing import Generic, TypeVar

from manytouch.errors import ManytouchError

Value = TypeVar("Value")
STOP_S = 5.0
PAUSE_S, PAUSE_SHARE = 1.0, 2.0
"""Pause between two values: this many times as long as the first one took, so that no number of requests
occupies a processor, but no longer than `PAUSE_S`."""


class BackgroundPreparation(Generic[Value]):
    """Prepares the newest requested value; one that waits is replaced by a newer one.

    There is a thread only while there is something to prepare.
    """

    def __init__(self, prepare: Callable[[Value], Value], refuse: Callable[[str], None]) -> None:
        """Nothing is requested yet.

        Args:
            prepare: prepares a value, in the thread, and returns it, prepared.
            refuse: gets the sentence of an error of `prepare`, in the thread.
        """
        self._prepare, self._refuse = prepare, refuse
        self._change = threading.Lock()
        self._waiting: Value | None = None
        self._present: Value | None = None
        self._ready: Value | None = None
        self._thread: threading.Thread | None = None
        self._is_closed = threading.Event()

    def request(self, value: Value) -> None:
        """Prepare a value, after the one that is being prepared; never blocks."""
        with self._change:
            if self._is_closed.is_set():
                return
            self._waiting = value
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="manytouch-prepare", daemon=True)
                self._thread.start()

    def requested(self) -> Value | None:
        """The newest value that is not taken yet; None if there is none."""
        with self._change:
            return next(
                (value for value in (self._waiting, self._present, self._ready) if value is not None), None
            )

    @property
    def is_busy(self) -> bool:
        """Whether a value waits or is being prepared."""
        with self._change:
            return self._waiting is not None or self._present is not None

    def take(self) -> Value | None:
        """The newest value that is prepared, once; None if there is none."""
        with self._change:
            value, self._ready = self._ready, None
            return value

    def close(self) -> None:
        """Drop what waits, and give the thread up to `STOP_S` to end; compiling cannot be interrupted."""
        self._is_closed.set()
        with self._change:
            self._waiting, thread = None, self._thread
        if thread is not None:
            thread.join(STOP_S)

    def _run(self) -> None:
        while True:
            with self._change:
                self._present, self._waiting = self._waiting, None
                present = self._present
                if present is None:
                    self._thread = None
                    return
            begin_s = time.monotonic()
            try:
                ready: Value | None = self._prepare(present)
            except Exception as error:  # noqa: BLE001 - the user of the value goes on without it
                known = isinstance(error, ManytouchError)
                self._refuse(str(error) if known else f"internal error: {type(error).__name__}: {error}")
                ready = None
            with self._change:
                self._present = None
                self._ready = self._ready if ready is None else ready
            self._is_closed.wait(min(PAUSE_S, PAUSE_SHARE * (time.monotonic() - begin_s)))
