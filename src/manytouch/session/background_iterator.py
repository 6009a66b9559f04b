"""An iterator that runs in a thread of its own, a few items ahead of its consumer."""

import queue
import threading
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Generic, TypeVar

Item = TypeVar("Item")
_POLL_S = 0.05


class _End:
    """Follows the last item; with the error that ended the iteration, if one did."""

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error


class BackgroundIterator(Generic[Item]):
    """Runs an iterator in a thread within a `with` block; iterating gives its items in order.

    The thread waits when it is `ahead` items ahead. An error in it is raised in the consumer.
    """

    def __init__(
        self,
        items: Iterator[Item],
        *,
        ahead: int,
        stop: Callable[[], bool] | None = None,
        begins_late: bool = False,
    ) -> None:
        """Prepare; nothing runs yet.

        Args:
            items: a generator or iterator; iterated and closed in the thread.
            ahead: largest number of items that wait.
            stop: called while no item is available; the iteration ends once it returns True.
            begins_late: the thread begins an item only when there is room for it, so that the items of a
                source that drops what comes meanwhile are recent ones.
        """
        self._items = items
        self._queue: queue.Queue[Item | _End] = queue.Queue(maxsize=ahead)
        self._stop = stop
        self._room = threading.Semaphore(ahead) if begins_late else None
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="manytouch-track", daemon=True)

    def __enter__(self) -> "BackgroundIterator[Item]":
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join()

    def __iter__(self) -> Iterator[Item]:
        while True:
            try:
                item = self._queue.get(timeout=_POLL_S)
            except queue.Empty:
                if self._stop is not None and self._stop():
                    return
                continue
            if self._room is not None:
                self._room.release()
            if isinstance(item, _End):
                if item.error is not None:
                    raise item.error
                return
            yield item

    def _run(self) -> None:
        end = _End()
        try:
            while self._wait_for_room():
                item = next(self._items, end)
                if item is end or not self._put(item):
                    break
        except BaseException as error:  # noqa: BLE001 - it is raised in the consumer
            end = _End(error)
        finally:
            close = getattr(self._items, "close", None)
            if close is not None:
                close()
        self._put(end)

    def _wait_for_room(self) -> bool:
        """False if the iteration is over."""
        while self._room is not None and not self._is_over.is_set():
            if self._room.acquire(timeout=_POLL_S):
                return True
        return not self._is_over.is_set()

    def _put(self, item: Item | _End) -> bool:
        while not self._is_over.is_set():
            try:
                self._queue.put(item, timeout=_POLL_S)
            except queue.Full:
                continue
            return True
        return False
