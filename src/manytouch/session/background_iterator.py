"""One stage in a thread of its own, a few items ahead of the next."""

import queue
import threading
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Generic, TypeVar

Item = TypeVar("Item")
_LOOK_UP_S = 0.05


class _End:
    """After the last item; with the error that ended it, if one did."""

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error


class BackgroundIterator(Generic[Item]):
    """Runs an iterator in a thread while its block lasts; iterating gives its items in order.

    The thread waits when it is `ahead` items ahead. An error in it is raised where the items are taken.
    """

    def __init__(self, items: Iterator[Item], *, ahead: int, stop: Callable[[], bool] | None = None) -> None:
        """Prepare; nothing runs yet.

        Args:
            items: taken in the thread, and closed in it when it can be closed.
            ahead: how many items may wait.
            stop: asked while there is nothing to take; once it says True the iteration ends.
        """
        self._items = items
        self._waiting: queue.Queue[Item | _End] = queue.Queue(maxsize=ahead)
        self._stop = stop
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="manytouch-see", daemon=True)

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
                item = self._waiting.get(timeout=_LOOK_UP_S)
            except queue.Empty:
                if self._stop is not None and self._stop():
                    return
                continue
            if isinstance(item, _End):
                if item.error is not None:
                    raise item.error
                return
            yield item

    def _run(self) -> None:
        end = _End()
        try:
            for item in self._items:
                if not self._put(item):
                    break
        except BaseException as error:  # noqa: BLE001 - it is raised in the thread that takes the items
            end = _End(error)
        finally:
            close = getattr(self._items, "close", None)
            if close is not None:
                close()
        self._put(end)

    def _put(self, item: Item | _End) -> bool:
        while not self._is_over.is_set():
            try:
                self._waiting.put(item, timeout=_LOOK_UP_S)
            except queue.Full:
                continue
            return True
        return False
