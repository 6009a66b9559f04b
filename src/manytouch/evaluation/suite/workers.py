"""Work shared out to processes, one task after the other, that can be stopped between tasks."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Protocol, TypeVar, runtime_checkable

from manytouch.blas_threads import limit_blas_threads
from manytouch.errors import ManytouchError

Task = TypeVar("Task")
Result = TypeVar("Result")


@runtime_checkable
class RunObserver(Protocol):
    """An object that is notified of the progress of a run."""

    def begin(self, work: str, count: int) -> None:
        """So many cases will be solved, or read."""

    def report(self, sentence: str) -> None:
        """Something that happened."""

    def done(self, title: str, sentence: str) -> None:
        """That is finished for a case."""


def run_tasks(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    processes: int = 1,
    stop: Callable[[], bool] | None = None,
) -> Iterator[tuple[int, Result]]:
    """The results with the numbers of their tasks, as they come.

    One process is this one. With more, `work` and everything in it must be picklable.

    Args:
        work: done for each task.
        tasks: in the order in which they are begun.
        processes: how many at once.
        stop: called before each task; once it returns True no other is begun.

    Raises:
        ManytouchError: a process was killed.
    """
    if processes == 1 or len(tasks) < 2:
        for number, task in enumerate(tasks):
            if stop is not None and stop():
                return
            yield number, work(task)
        return
    begun = 0
    waiting: dict[Future[Result], int] = {}
    context = multiprocessing.get_context("spawn")  # compiled code and OpenCV do not survive a fork
    with ProcessPoolExecutor(processes, mp_context=context, initializer=_serve) as pool:
        try:
            while True:
                while begun < len(tasks) and len(waiting) < processes and not (stop and stop()):
                    waiting[pool.submit(work, tasks[begun])] = begun
                    begun += 1
                if not waiting:
                    return
                for done in wait(waiting, return_when=FIRST_COMPLETED).done:
                    yield waiting.pop(done), done.result()
        except BrokenProcessPool:
            raise ManytouchError(
                "a process was killed, perhaps for want of memory; the same command goes on where it ended"
            ) from None


def _serve() -> None:
    """Leave Ctrl-C to the first process, which lets the others finish; end when it was killed."""
    limit_blas_threads()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_first, daemon=True).start()


def _end_with_the_first() -> None:
    first = multiprocessing.parent_process()
    if first is not None:
        first.join()
        os._exit(1)
