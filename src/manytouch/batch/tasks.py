"""What workers get and give back: small values that travel to other processes and machines."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One recording.

    Attributes:
        name: of its result folder.
        input: path or address.
        reason: why it is processed.
    """

    name: str
    input: str
    reason: str = ""


class Result(StrEnum):
    """What became of a recording."""

    COMPUTED = "computed"
    CURRENT = "current"  # nothing had to be done
    BUSY = "busy"  # another process is writing the result
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a worker reports of a recording.

    Attributes:
        task: the recording.
        result: what became of it.
        reason: why it was computed, or the sentence of the failure.
        traceback: of a failure; empty where there is none.
        frames: that were processed.
        seconds: that it took.
    """

    task: Task
    result: Result
    reason: str = ""
    traceback: str = ""
    frames: int = 0
    seconds: float = 0.0


@runtime_checkable
class Work(Protocol):
    """What a worker does with a task; `stop` returns True once it shall be given up."""

    def __call__(self, task: Task, *, stop: Callable[[], bool] | None = None) -> Outcome: ...


@runtime_checkable
class Engine(Protocol):
    """What runs tasks: processes of this machine, or a cluster."""

    def run(self, work: Work, tasks: Iterable[Task], stop: Callable[[], bool]) -> Iterator[Outcome]:
        """The outcomes as they come, each task once.

        Args:
            work: done for each task; picklable.
            tasks: begun in this order, read as they are needed.
            stop: once it returns True no task is begun, and those that are running are given up.

        Raises:
            ManytouchError: it cannot work any more.
        """
