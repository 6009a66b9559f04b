"""A bounded queue in front of a publisher, so that no receiver delays the session."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Protocol, runtime_checkable

from manytouch.errors import ManytouchError
from manytouch.values import OutputState, Reading

LENGTH = 8
RETRY_S = 1.0
CLOSE_S = 5.0


@runtime_checkable
class Publisher(Protocol):
    """Sends readings to other programs by one protocol."""

    def publish(self, reading: Reading) -> None:
        """Send a reading; an exception closes the publisher, and another one is opened after `RETRY_S`."""

    def close(self) -> None:
        """Send what ends the transmission, and release the connection."""


class QueuedOutput:
    """A sink that passes readings to a publisher in a thread of its own.

    If the queue is full, the oldest reading in it is dropped. After an error readings are dropped until the
    publisher could be opened again.
    """

    def __init__(
        self,
        name: str,
        open_publisher: Callable[[], Publisher],
        *,
        length: int = LENGTH,
        retry_s: float = RETRY_S,
        close_s: float = CLOSE_S,
    ) -> None:
        """Open the publisher and start its thread.

        Args:
            name: the address, as given.
            open_publisher: opens it, also again after an error.
            length: readings that may wait.
            retry_s: time from an error to the next attempt.
            close_s: longest time that closing waits for what is still queued.

        Raises:
            ManytouchError: it cannot be opened.
        """
        self._name = name
        self._open = open_publisher
        self._length = length
        self._retry_s = retry_s
        self._close_s = close_s
        self._publisher: Publisher | None = open_publisher()
        self._change = threading.Condition()
        self._queue: deque[Reading] = deque()
        self._is_closing = False
        self._sent = self._dropped = 0
        self._status = "ok"
        self._thread = threading.Thread(target=self._run, name=f"manytouch-{name}", daemon=True)
        self._thread.start()

    @property
    def state(self) -> OutputState:
        """What was sent and dropped so far."""
        with self._change:
            return OutputState(name=self._name, sent=self._sent, dropped=self._dropped, status=self._status)

    def write(self, reading: Reading) -> None:
        """Queue a reading; never waits."""
        with self._change:
            if len(self._queue) == self._length:
                self._queue.popleft()
                self._dropped += 1
            self._queue.append(reading)
            self._change.notify()

    def close(self) -> None:
        """Send what waits, and close the publisher; one that is stuck is left behind."""
        with self._change:
            self._is_closing = True
            self._change.notify()
        self._thread.join(self._close_s)

    def _run(self) -> None:
        while (reading := self._next()) is not None:
            error = self._attempt(reading)
            with self._change:
                self._sent += error is None
                self._dropped += error is not None
                self._status = "ok" if error is None else error
            if error is not None:
                self._pause()
        self._release()

    def _next(self) -> Reading | None:
        with self._change:
            self._change.wait_for(lambda: self._queue or self._is_closing)
            return self._queue.popleft() if self._queue else None

    def _attempt(self, reading: Reading) -> str | None:
        """Send a reading; a sentence on why that was not possible, or None."""
        try:
            if self._publisher is None:
                self._publisher = self._open()
            self._publisher.publish(reading)
        except (OSError, ManytouchError) as error:
            self._release()
            return f"{error}"
        except Exception as error:  # noqa: BLE001 - shown in `health`; the session continues without the output
            self._release()
            return f"{type(error).__name__}: {error}"
        return None

    def _pause(self) -> None:
        """Wait before the next attempt; readings that come meanwhile are dropped."""
        with self._change:
            self._change.wait_for(lambda: self._is_closing, timeout=self._retry_s)
            self._dropped += len(self._queue)
            self._queue.clear()

    def _release(self) -> None:
        publisher, self._publisher = self._publisher, None
        if publisher is None:
            return
        try:
            publisher.close()
        except Exception as error:  # noqa: BLE001 - the receiver may be gone
            with self._change:
                self._status = f"{type(error).__name__}: {error}"
