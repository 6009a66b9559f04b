"""Tasks on processes of this machine: the death of one costs the task that it had, and no more."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, partial
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

from manytouch.batch.tasks import Outcome, Task, TaskFunction, TaskState
from manytouch.errors import ManytouchError

TRIES = 2
FAILED_STARTS = 3
POLL_S = 0.2
END_S = 10.0
OVER_LIMIT = 77
WATCH_S = 0.5
_CONTEXT = multiprocessing.get_context("spawn")  # compiled code and OpenCV do not survive a fork


@dataclass(eq=False)
class _Worker:
    """A process, the connection to it, and the task that it has."""

    process: SpawnProcess
    connection: Connection
    has_begun: bool = False
    task: Task | None = None

    @property
    def is_idle(self) -> bool:
        return self.has_begun and self.task is None and not self.connection.closed


@dataclass(kw_only=True)
class LocalProcesses:
    """Runs tasks on worker processes, each with one thread and a limit of its memory.

    Attributes:
        processes: workers at once.
        memory_bytes: of one worker; one that exceeds it is ended. None: no limit.
        deaths: workers that have died, so far.
    """

    processes: int
    memory_bytes: int | None = None
    deaths: int = 0
    _workers: list[_Worker] = field(default_factory=list)
    _failed_starts: int = 0

    def run(self, work: TaskFunction, tasks: Iterable[Task], stop: Callable[[], bool]) -> Iterator[Outcome]:
        """The outcomes as they come; a task whose worker dies `TRIES` times has failed. See `Engine`."""
        waiting = _Queue(tasks)
        try:
            while not stop():
                while not waiting.is_empty and (worker := self._idle_worker(work)) is not None:
                    self._begin(worker, waiting)
                if waiting.is_empty and not any(worker.task for worker in self._workers):
                    return
                for worker in self._ready_workers():
                    outcome = self._received(worker) or self._lost(worker, waiting)
                    if outcome is not None:
                        yield outcome
        finally:
            self._end()

    def _idle_worker(self, work: TaskFunction) -> _Worker | None:
        """A worker without a task; a new one while there are fewer than `processes`."""
        idle = next((each for each in self._workers if each.is_idle), None)
        if idle is None and len(self._workers) < self.processes:
            here, there = _CONTEXT.Pipe()
            process = _CONTEXT.Process(
                target=serve, args=(there, work, self.memory_bytes), daemon=False, name="manytouch worker"
            )
            process.start()
            there.close()
            self._workers.append(_Worker(process, here))
        return idle

    def _begin(self, worker: _Worker, waiting: "_Queue") -> None:
        """Send the next task, unless the worker has died meanwhile."""
        task = waiting.take()
        try:
            worker.connection.send(task)
        except OSError:
            worker.connection.close()
            waiting.put_back(task)
        else:
            worker.task = task

    def _ready_workers(self) -> list[_Worker]:
        """Workers that have sent something, or have died."""
        by_handle = {
            handle: worker
            for worker in self._workers
            for handle in (worker.connection, worker.process.sentinel)
            if not (handle is worker.connection and worker.connection.closed)
        }
        found = dict.fromkeys(by_handle[handle] for handle in wait(list(by_handle), timeout=POLL_S))  # type: ignore[index]
        return list(found)

    def _received(self, worker: _Worker) -> Outcome | None:
        """What a worker has sent; None for the first sign of life, and if it has died."""
        try:
            if worker.connection.closed or not worker.connection.poll():
                return None
            sent = worker.connection.recv()
        except (EOFError, OSError):
            worker.connection.close()
            return None
        if not isinstance(sent, Outcome):
            worker.has_begun, self._failed_starts = True, 0
            return None
        worker.task = None
        return sent

    def _lost(self, worker: _Worker, waiting: "_Queue") -> Outcome | None:
        """Remove a worker if it has died; its task goes back, or has failed."""
        if worker.process.is_alive() and not worker.connection.closed:
            return None
        worker.process.join()
        code = worker.process.exitcode
        worker.connection.close()
        self._workers.remove(worker)
        self.deaths += 1
        if not worker.has_begun:
            self._failed_starts += 1
            if self._failed_starts >= FAILED_STARTS:
                raise ManytouchError(
                    f"worker processes end before they are ready (exit status {code}): check that "
                    "'manytouch doctor' works and that there is memory for them (--workers)"
                )
        if worker.task is None or waiting.put_back(worker.task, is_try=True):
            return None
        return Outcome(task=worker.task, state=TaskState.FAILED, reason=self._why_lost(code))

    def _why_lost(self, code: int | None) -> str:
        if code == OVER_LIMIT and self.memory_bytes is not None:
            return (
                f"the worker exceeded its limit of {self.memory_bytes / 1e9:.3g} GB in {TRIES} tries: give "
                "each more memory (--memory-GB), or take fewer workers (--workers)"
            )
        return (
            f"the worker process died in {TRIES} tries ({_death(code)}): process this recording alone "
            "to see why"
        )

    def _end(self) -> None:
        """End all workers: those that have a task give it up, others end at once."""
        for worker in self._workers:
            if worker.task is None:
                worker.connection.close()
            else:
                worker.process.terminate()
        for worker in self._workers:
            worker.process.join(END_S)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
            worker.connection.close()
        self._workers.clear()


class _Queue:
    """Tasks that are read as they are needed; those that come back are taken after all others."""

    def __init__(self, tasks: Iterable[Task]) -> None:
        self._tasks = iter(tasks)
        self._next = next(self._tasks, None)
        self._again: list[Task] = []
        self._tries: dict[str, int] = {}

    @property
    def is_empty(self) -> bool:
        return self._next is None and not self._again

    def take(self) -> Task:
        if self._next is None:
            return self._again.pop(0)
        taken, self._next = self._next, next(self._tasks, None)
        return taken

    def put_back(self, task: Task, *, is_try: bool = False) -> bool:
        """Take it again later; False if it has been tried `TRIES` times."""
        if is_try:
            self._tries[task.name] = self._tries.get(task.name, 0) + 1
        if self._tries.get(task.name, 0) >= TRIES:
            return False
        self._again.append(task)
        return True


def processors() -> int:
    """Processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return os.cpu_count() or 1 if affinity is None else len(affinity(0))


def memory_per_worker(processes: int) -> int | None:
    """Bytes of each of so many workers, if they share 90 % of this machine's memory; None if unknown."""
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None
    group = Path("/sys/fs/cgroup/memory.max")
    if group.is_file() and (limit := group.read_text().strip()).isdecimal():
        total = min(total, int(limit))
    return int(0.9 * total / processes)


def _death(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit status {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"


def serve(connection: Connection, work: TaskFunction, memory_bytes: int | None) -> None:
    """Do tasks until the connection is closed, in a worker."""
    terminated = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process decides
    signal.signal(signal.SIGTERM, lambda *_: terminated.set())
    threading.Thread(target=_watch, args=(memory_bytes,), daemon=True).start()
    use_one_thread()
    stoppable = partial(work, stop=terminated.is_set)
    with suppress(EOFError, OSError):  # the first process needs no more
        connection.send("ready")
        while not terminated.is_set():
            connection.send(stoppable(connection.recv()))


@cache
def use_one_thread() -> None:
    """One thread for each library that computes, in this process, from the first call on."""
    os.environ["NUMBA_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    os.environ["OPENCV_FFMPEG_THREADS"] = "1"
    from manytouch.blas_threads import limit_blas_threads
    from manytouch.sources.quiet_opencv import cv2

    limit_blas_threads()
    cv2.setNumThreads(1)


def _watch(memory_bytes: int | None) -> None:
    """End this worker when the first process has ended, or when it needs too much memory."""
    first = multiprocessing.parent_process()
    while True:
        if first is not None:
            first.join(WATCH_S)
            if not first.is_alive():
                os._exit(1)
        else:
            time.sleep(WATCH_S)
        if memory_bytes is not None and memory_now() > memory_bytes:
            os._exit(OVER_LIMIT)


def memory_now() -> int:
    """Bytes of memory that this process occupies; 0 where the system does not state it."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError, IndexError):
        return 0
