"""A bounded queue in front of a publisher: a slow or lost receiver never delays the session."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Protocol, runtime_checkable

from manytouch.errors import ManytouchError
from manytouch.values import OutputState, Reading

QUEUE_LENGTH = 8
"""Readings that wait for a slow receiver before the oldest is dropped: about a quarter of a second."""
RETRY_INTERVAL_S = 1.0
"""Time from an error to the next attempt to open the publisher."""
CLOSE_TIMEOUT_S = 5.0
"""Longest time for which closing waits until queued readings are sent."""


@runtime_checkable
class Publisher(Protocol):
    """Sends readings to other programs by one protocol."""

    @property
    def description(self) -> str:
        """What is sent, and where it is received, for the person who starts the session."""

    def publish(self, reading: Reading) -> None:
        """Send a reading; may block.

        After an exception the publisher is closed, and a new one is opened `RETRY_INTERVAL_S` later.
        """

    def close(self) -> None:
        """Send what ends the transmission, and release the connection."""


class QueuedOutput:
    """A sink that passes readings to a publisher in a thread of its own.

    When the queue is full, its oldest reading is dropped. After an error, readings are dropped until the next
    attempt to open the publisher. Dropped readings are counted.

    Attributes:
        description: address, and what is sent where.
    """

    def __init__(
        self,
        name: str,
        open_publisher: Callable[[], Publisher],
        *,
        queue_length: int = QUEUE_LENGTH,
        retry_interval_s: float = RETRY_INTERVAL_S,
        close_timeout_s: float = CLOSE_TIMEOUT_S,
    ) -> None:
        """Open the publisher and start its thread.

        Args:
            name: the address, as given.
            open_publisher: opens the publisher; called again after an error.
            queue_length: number of readings that may wait.
            retry_interval_s: time from an error to the next attempt.
            close_timeout_s: longest time for which closing waits until queued readings are sent.

        Raises:
            ManytouchError: the publisher cannot be opened.
        """
        self._name = name
        self._open = open_publisher
        self._queue_length = queue_length
        self._retry_interval_s = retry_interval_s
        self._close_timeout_s = close_timeout_s
        opened = open_publisher()
        self._publisher: Publisher | None = opened
        self.description = f"{name}: {opened.description}"
        self._changed = threading.Condition()
        self._queue: deque[Reading] = deque()
        self._is_closing = False
        self._sent = self._dropped = 0
        self._problem: str | None = None
        self._thread = threading.Thread(target=self._run, name=f"manytouch-{name}", daemon=True)
        self._thread.start()

    @property
    def state(self) -> OutputState:
        """What was sent and dropped so far."""
        with self._changed:
            return OutputState(name=self._name, sent=self._sent, dropped=self._dropped, problem=self._problem)

    @property
    def waiting(self) -> int:
        """Number of readings that are queued."""
        with self._changed:
            return len(self._queue)

    def write(self, reading: Reading) -> None:
        """Queue a reading; never waits. A reading that is written after `close` is dropped."""
        with self._changed:
            if self._is_closing:
                self._dropped += 1
                return
            if len(self._queue) == self._queue_length:
                self._queue.popleft()
                self._dropped += 1
            self._queue.append(reading)
            self._changed.notify()

    def close(self) -> None:
        """Send what is queued, and close the publisher.

        Queued readings get one attempt after an error that came before; an error while closing drops the
        rest. A publisher that still blocks after `close_timeout_s` is left to its thread, which ends with the
        process.
        """
        with self._changed:
            self._is_closing = True
            self._changed.notify()
        self._thread.join(self._close_timeout_s)

    def _run(self) -> None:
        while (reading := self._next()) is not None:
            problem = self._attempt(reading)
            with self._changed:
                self._problem = problem
                if problem is None:
                    self._sent += 1
                else:
                    self._dropped += 1
                    self._wait_for_retry()
        self._release()

    def _next(self) -> Reading | None:
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._is_closing)
            return self._queue.popleft() if self._queue else None

    def _attempt(self, reading: Reading) -> str | None:
        """Send a reading; returns None, or a sentence on why it could not be sent."""
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

    def _wait_for_retry(self) -> None:
        """Wait for the next attempt, and drop the readings that became old meanwhile.

        `close` ends the wait; the readings are then kept for one attempt. The lock is held on entry, so that
        `close` comes either before the error or during the wait.
        """
        if not self._is_closing and self._changed.wait_for(
            lambda: self._is_closing, timeout=self._retry_interval_s
        ):
            return
        self._dropped += len(self._queue)
        self._queue.clear()

    def _release(self) -> None:
        publisher, self._publisher = self._publisher, None
        if publisher is None:
            return
        try:
            publisher.close()
        except Exception as error:  # noqa: BLE001 - the receiver may be gone
            with self._changed:
                self._problem = f"{type(error).__name__}: {error}"
