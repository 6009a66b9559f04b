"""Tasks for workers, their outcomes, and the engines that run them.

Tasks and outcomes are small values, as they are sent to other processes and machines.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One recording to process.

    Attributes:
        name: of its result folder.
        input: path or address.
        reason: why it is processed.
    """

    name: str
    input: str
    reason: str = ""


class TaskState(StrEnum):
    """State of a task that a worker has ended.

    `CURRENT`: the result is complete and nothing has changed, so that nothing was computed. `BUSY`: another
    process is writing the result.
    """

    COMPUTED = "computed"
    CURRENT = "current"
    BUSY = "busy"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a worker reports about a task.

    Attributes:
        task: as given.
        state: computed, current, busy or failed.
        reason: why it was computed, or the sentence of the failure.
        traceback: of a failure; empty where there is none.
        frames: that were processed.
        seconds: that it took.
    """

    task: Task
    state: TaskState
    reason: str = ""
    traceback: str = ""
    frames: int = 0
    seconds: float = 0.0


@runtime_checkable
class TaskFunction(Protocol):
    """A function that a worker calls with each task; it ends early once `stop` returns True."""

    def __call__(self, task: Task, *, stop: Callable[[], bool] | None = None) -> Outcome: ...


@runtime_checkable
class Engine(Protocol):
    """Runs tasks in processes of this machine, or on a cluster."""

    def run(self, work: TaskFunction, tasks: Iterable[Task], stop: Callable[[], bool]) -> Iterator[Outcome]:
        """The outcomes, one for each task, in the order in which tasks end.

        Args:
            work: called for each task; picklable.
            tasks: started in this order, read as they are needed.
            stop: once it returns True, no task is started, and running ones end early.

        Raises:
            ManytouchError: the engine cannot continue, such as without a connection to the cluster.
        """
