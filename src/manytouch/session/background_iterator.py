"""An iterator in a thread of its own, a few items ahead of its consumer; and how often threads take turns."""

import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Generic, TypeVar

Item = TypeVar("Item")
_POLL_S = 0.05  # time between two calls of `stop`
SWITCH_INTERVAL_S = 5e-4
"""Longest time for which one thread runs Python code while another one waits. Python's default is 5 ms: while
a thread prepares a method, the threads of the frames would wait that long after each compiled call."""


class _SwitchInterval:
    """The switch interval of this process, which several blocks may shorten at once.

    Attributes:
        lock: protects the others.
        blocks: number of `short_switch_interval` blocks that have begun and not ended.
        before_s: interval before the first of them.
    """

    lock = threading.Lock()
    blocks = 0
    before_s = 0.0


@contextmanager
def short_switch_interval() -> Iterator[None]:
    """Make threads wait for each other for at most `SWITCH_INTERVAL_S` within the block.

    When the last of several blocks ends, the interval is what it was before the first one began.
    """
    with _SwitchInterval.lock:
        if _SwitchInterval.blocks == 0:
            _SwitchInterval.before_s = sys.getswitchinterval()
            sys.setswitchinterval(SWITCH_INTERVAL_S)
        _SwitchInterval.blocks += 1
    try:
        yield
    finally:
        with _SwitchInterval.lock:
            _SwitchInterval.blocks -= 1
            if _SwitchInterval.blocks == 0:
                sys.setswitchinterval(_SwitchInterval.before_s)


class _End:
    """What follows the last item: the error that ended the iteration, or None."""

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error


class BackgroundIterator(Generic[Item]):
    """Runs an iterator in a thread within a `with` block; iterating gives its items in order.

    The thread waits when it is `ahead` items ahead. An error in the iterator is raised in the consumer.
    """

    def __init__(
        self,
        items: Iterator[Item],
        *,
        ahead: int,
        stop: Callable[[], bool] | None = None,
        replaceable: type | None = None,
        thread_name: str = "manytouch-iterator",
    ) -> None:
        """Prepare; nothing runs yet.

        Args:
            items: a generator or iterator; iterated and closed in the thread.
            ahead: largest number of items that are computed before the consumer takes them.
            stop: called while no item is available; the iteration ends once it returns True.
            replaceable: with an item of this type, the thread does not wait for the consumer. The item takes
                the place of the newest one that was not taken yet, if that is of this type too, so that the
                consumer gets recent items. None: the thread always waits.
            thread_name: of the thread, as debuggers and profilers show it.
        """
        self._items = items
        self._waiting: deque[Item | _End] = deque()
        self._ahead = ahead
        self._stop = stop
        self._replaceable = replaceable
        self._replaced = 0
        self._is_over = False
        self._change = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=thread_name, daemon=True)

    @property
    def replaced(self) -> int:
        """Number of items that the consumer did not get because later ones took their places."""
        return self._replaced

    def __enter__(self) -> "BackgroundIterator[Item]":
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Ends the thread; waits, without limit, until the iterator returns the item that it computes."""
        with self._change:
            self._is_over = True
            self._change.notify_all()
        self._thread.join()

    def __iter__(self) -> Iterator[Item]:
        while True:
            with self._change:
                is_ready = self._change.wait_for(lambda: bool(self._waiting), _POLL_S)
                item = self._waiting.popleft() if is_ready else _End()
                self._change.notify_all()
            if not is_ready:
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
            try:
                for item in self._items:
                    if not self._put(item):
                        break
            finally:
                close = getattr(self._items, "close", None)
                if close is not None:
                    close()
        except BaseException as error:  # noqa: BLE001 - it is raised in the consumer
            end = _End(error)
        self._put(end)

    def _put(self, item: Item | _End) -> bool:
        """Add an item as soon as there is room for it; returns False if the iteration is over."""
        with self._change:
            while not self._is_over and len(self._waiting) >= self._ahead:
                if self._replaces(item, self._waiting[-1]):
                    self._waiting.pop()
                    self._replaced += 1
                else:
                    self._change.wait()
            if not self._is_over:
                self._waiting.append(item)
                self._change.notify_all()
            return not self._is_over

    def _replaces(self, item: Item | _End, last: Item | _End) -> bool:
        """Whether an item takes the place of the last one that waits."""
        kind = self._replaceable
        return kind is not None and isinstance(item, kind) and isinstance(last, kind)
