"""Tasks on a dask.distributed scheduler that runs already, or that SLURM jobs connect to."""

import queue
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from manytouch.batch.tasks import Outcome, Result, Task, Work
from manytouch.errors import ManytouchError, MissingExtraError

RETRIES = 2
WAITING_PER_THREAD, LEAST_WAITING, MOST_WAITING = 4, 100, 10_000
CONNECT_S = 30.0
POLL_S = 0.2
DEADLY = (
    "the workers that had this recording died, also without any other, perhaps for want of memory: process "
    "it alone to see why"
)


@dataclass(eq=False, kw_only=True)
class DaskScheduler:
    """Runs tasks through a client of a scheduler.

    Inputs and results go directly between the workers and the disk or object store; the scheduler carries
    only tasks and outcomes, and at most `MOST_WAITING` of them at once.

    Attributes:
        client: a `distributed.Client`.
    """

    client: Any

    def run(self, work: Work, tasks: Iterable[Task], stop: Callable[[], bool]) -> Iterator[Outcome]:
        """The outcomes as they come. See `Engine`.

        The scheduler counts the death of a worker against every task that the worker had, so that tasks which
        are blamed are done again one by one, after all others; one that is blamed then has failed.
        """
        blamed: list[Task] = []
        for task, outcome in self._outcomes(work, tasks, stop):
            if outcome is None:
                blamed.append(task)
            else:
                yield outcome
        for suspect in blamed:
            for task, outcome in self._outcomes(work, [suspect], stop):
                yield outcome or Outcome(task=task, result=Result.FAILED, reason=DEADLY)

    def _outcomes(
        self, work: Work, tasks: Iterable[Task], stop: Callable[[], bool]
    ) -> Iterator[tuple[Task, Outcome | None]]:
        """Outcomes as they come; None where the workers that had the task died."""
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        in_work: dict[str, tuple[Task, Any]] = {}
        remaining = iter(tasks)
        following = next(remaining, None)
        try:
            while not stop() and (following is not None or in_work):
                limit = self._limit() if following is not None else 0
                while following is not None and len(in_work) < limit:
                    future = self._submit(work, following)
                    in_work[future.key] = following, future
                    future.add_done_callback(done.put)
                    following = next(remaining, None)
                try:
                    finished = done.get(timeout=POLL_S)
                except queue.Empty:
                    self._require_connection()
                    continue
                if finished.status in ("lost", "pending"):  # its worker died, so that it is done again
                    finished.add_done_callback(done.put)
                    continue
                task, _ = in_work.pop(finished.key)
                yield task, self._outcome(task, finished)
        finally:
            self._cancel([future for _, future in in_work.values()])

    def _submit(self, work: Work, task: Task) -> Any:
        try:
            return self.client.submit(partial(on_worker, work), task, retries=RETRIES, pure=False)
        except Exception as error:
            raise _lost(error) from error

    def _limit(self) -> int:
        """Tasks that the scheduler has at once: enough that no worker waits for the next."""
        workers = self.client.scheduler_info(n_workers=-1).get("workers", {}).values()
        threads = sum(int(worker["nthreads"]) for worker in workers)
        return min(max(WAITING_PER_THREAD * threads, LEAST_WAITING), MOST_WAITING)

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
        if type(error).__name__ == "KilledWorker":
            return None
        words = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return Outcome(task=task, result=Result.FAILED, reason=words)

    def _cancel(self, futures: list[Any]) -> None:
        if futures and self.client.status == "running":
            self.client.cancel(futures)


def connect(address: str) -> DaskScheduler:
    """A scheduler at an address, such as tcp://host:8786.

    Raises:
        MissingExtraError: dask is not installed.
        ManytouchError: there is no scheduler at this address.
    """
    require_dask()
    from distributed import Client

    try:
        return DaskScheduler(client=Client(address, timeout=CONNECT_S, set_as_default=False))
    except (OSError, ValueError, TimeoutError) as error:
        raise ManytouchError(
            f"no dask scheduler answers at {address} ({' '.join(str(error).split())}): start it with 'dask "
            "scheduler', and give the address that it prints"
        ) from error


def require_dask() -> None:
    """Check that dask.distributed is installed.

    Raises:
        MissingExtraError: it is not.
    """
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise MissingExtraError("a batch on a cluster", "distributed", "batch") from None


def on_worker(work: Work, task: Task) -> Outcome:
    """Do a task on a worker of dask."""
    from manytouch.batch.engines.local_processes import use_one_thread

    use_one_thread()
    return work(task)


def _lost(error: Exception | None) -> ManytouchError:
    why = "" if error is None else f" ({' '.join(str(error).split())})"
    return ManytouchError(
        f"the connection to the dask scheduler was lost{why}: the same command continues when it is back"
    )
