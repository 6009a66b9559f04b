"""Tasks that are distributed to processes; a run can be stopped between two tasks."""

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
        """`count` cases are processed next.

        Args:
            work: what is done with each, such as "solving"; it is printed.
            count: number of cases.
        """

    def report(self, sentence: str) -> None:
        """A sentence on the run as a whole, such as which cases are left out."""

    def done(self, title: str, sentence: str) -> None:
        """One case is finished: its title, and its result in a sentence."""


def run_tasks(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    processes: int = 1,
    stop: Callable[[], bool] | None = None,
) -> Iterator[tuple[int, Result]]:
    """Yield the number and the result of each task as soon as it is finished, in any order.

    With one process the tasks run in the calling process. With more, `work` and everything in it must be
    picklable.

    Args:
        work: function that is called with each task; it returns the result.
        tasks: in the order in which they are begun.
        processes: number of processes.
        stop: called before each task; once it returns True no other is begun.

    Raises:
        ManytouchError: a process was killed, and no stop was requested.
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
            if stop is not None and stop():
                return  # SIGTERM to all processes, as a service manager sends it, ended them too
            raise ManytouchError(
                "a process was killed, perhaps for want of memory; the same command goes on where it ended"
            ) from None


def _serve() -> None:
    """Leave Ctrl-C to the parent process, which lets the others finish; end if it was killed."""
    limit_blas_threads()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
