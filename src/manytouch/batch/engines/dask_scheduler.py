"""An engine for the workers of a dask.distributed scheduler: one that runs already, or that of SLURM jobs."""

import queue
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from manytouch.batch.engines.worker_wait import WorkerWait
from manytouch.batch.tasks import Outcome, Task, TaskFunction, TaskState
from manytouch.errors import ManytouchError, MissingExtraError

RETRIES = 2
"""How often dask repeats a task that raised an exception."""
TASKS_PER_THREAD = 4
"""Tasks that the scheduler has for each thread of its workers, so that no worker waits for the next one."""
LEAST_TASKS = 100
"""Tasks that the scheduler has at least, as workers may join at any time."""
MOST_TASKS = 10_000
"""Tasks that the scheduler has at most: it keeps each of them in memory."""
CONNECT_TIMEOUT_S = 30.0
"""Longest time that a scheduler may take to answer."""
POLL_INTERVAL_S = 0.2
"""Time after which a stop, or the loss of the connection, is noticed."""
WORKER_DEATH_MESSAGE = (
    "every worker that processed this recording died, even when the recording was processed alone; the "
    "workers may have run out of memory: process the recording on its own to find the cause"
)


@dataclass(eq=False, kw_only=True)
class DaskEngine:
    """Runs tasks on the workers of a dask scheduler; an `Engine`.

    Workers read inputs from the disk or object store, and write results there; only tasks and outcomes pass
    through the scheduler, at most `MOST_TASKS` of them at once.

    Attributes:
        client: a `distributed.Client`.
        wait: for workers.
    """

    client: Any
    wait: WorkerWait = field(default_factory=WorkerWait)

    def run(self, work: TaskFunction, tasks: Iterable[Task], stop: Callable[[], bool]) -> Iterator[Outcome]:
        """The outcomes in the order in which tasks end. See `Engine`.

        Dask blames the death of a worker on every task it held. Blamed tasks run again one at a time after
        all others; one that is blamed again has failed.

        Raises:
            ManytouchError: the connection to the scheduler was lost, or no worker has come in time.
        """
        blamed: list[Task] = []
        for task, outcome in self._outcomes(work, tasks, stop):
            if outcome is None:
                blamed.append(task)
            else:
                yield outcome
        for suspect in blamed:
            for task, outcome in self._outcomes(work, [suspect], stop):
                yield outcome or Outcome(task=task, state=TaskState.FAILED, reason=WORKER_DEATH_MESSAGE)

    def _outcomes(
        self, work: TaskFunction, tasks: Iterable[Task], stop: Callable[[], bool]
    ) -> Iterator[tuple[Task, Outcome | None]]:
        """Outcomes in the order in which tasks end; None for a task that is blamed for dead workers.

        Raises:
            ManytouchError: the connection to the scheduler was lost, or no worker has come in time.
        """
        self.wait.begin()
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        in_work: dict[str, tuple[Task, Any]] = {}
        remaining = iter(tasks)
        next_task = next(remaining, None)
        try:
            while not stop() and (next_task is not None or in_work):
                limit = self._limit() if next_task is not None else 0
                while next_task is not None and len(in_work) < limit:
                    future = self._submit(work, next_task)
                    in_work[future.key] = next_task, future
                    future.add_done_callback(done.put)
                    next_task = next(remaining, None)
                try:
                    finished = done.get(timeout=POLL_INTERVAL_S)
                except queue.Empty:
                    self._require_connection()
                    self.wait.check(self._threads)
                    continue
                if finished.status in ("lost", "pending"):  # its worker died; dask gives it to another
                    finished.add_done_callback(done.put)
                    continue
                task, _ = in_work.pop(finished.key)
                yield task, self._outcome(task, finished)
        finally:
            self._cancel([future for _, future in in_work.values()])

    def _submit(self, work: TaskFunction, task: Task) -> Any:
        try:
            return self.client.submit(partial(on_worker, work), task, retries=RETRIES, pure=False)
        except Exception as error:
            raise _lost(error) from error

    def _limit(self) -> int:
        """Number of tasks that the scheduler may have at once."""
        return min(max(TASKS_PER_THREAD * self._threads(), LEAST_TASKS), MOST_TASKS)

    def _threads(self) -> int:
        """Number of threads of all workers."""
        workers = self.client.scheduler_info(n_workers=-1).get("workers", {}).values()
        return sum(int(worker["nthreads"]) for worker in workers)

    def _require_connection(self) -> None:
        if self.client.status not in ("running", "connecting"):
            raise _lost(None)

    def _outcome(self, task: Task, future: Any) -> Outcome | None:
        if future.status == "finished":
            outcome = future.result()
            assert isinstance(outcome, Outcome)
            return outcome
        if future.status != "error":  # cancelled, with its scheduler
            raise _lost(None)
        error = future.exception()
        if type(error).__name__ == "KilledWorker":  # by name: distributed is an optional package
            return None
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return Outcome(task=task, state=TaskState.FAILED, reason=reason)

    def _cancel(self, futures: list[Any]) -> None:
        if futures and self.client.status == "running":
            self.client.cancel(futures)


def connect(address: str, wait: WorkerWait | None = None) -> DaskEngine:
    """Connect to the scheduler at an address, such as tcp://host:8786.

    Args:
        address: of the scheduler.
        wait: for workers; None: the default.

    Raises:
        MissingExtraError: dask is not installed.
        ManytouchError: there is no scheduler at this address.
    """
    require_dask()
    from distributed import Client
    from distributed.comm.addressing import resolve_address

    try:
        resolve_address(address)  # a client that cannot read its address does not close
        client = Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise ManytouchError(
            f"no dask scheduler answers at {address} ({' '.join(str(error).split())}): start it with 'dask "
            "scheduler', and give the address that it prints"
        ) from error
    return DaskEngine(client=client, wait=wait or WorkerWait())


def require_dask() -> None:
    """Check that dask.distributed is installed.

    Raises:
        MissingExtraError: it is not.
    """
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise MissingExtraError("a batch on a cluster", "distributed", "batch") from None


def on_worker(work: TaskFunction, task: Task) -> Outcome:
    """Process a recording on a worker of dask, with one thread."""
    from manytouch.batch.engines.local_processes import use_one_thread

    use_one_thread()
    return work(task)


def _lost(error: Exception | None) -> ManytouchError:
    why = "" if error is None else f" ({' '.join(str(error).split())})"
    return ManytouchError(
        f"the connection to the dask scheduler was lost{why}: the same command continues when it is back"
    )
