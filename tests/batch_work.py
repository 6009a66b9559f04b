"""What workers do in the tests of batches; importable by processes that the tests start."""

import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from manytouch.batch.tasks import Outcome, Task, TaskFunction, TaskState


class Serial:
    """An engine that does one task after the other in this process."""

    def run(self, work: TaskFunction, tasks: Iterable[Task], stop: Callable[[], bool]) -> Iterator[Outcome]:
        for task in tasks:
            if stop():
                return
            yield work(task)


class Notes:
    """An observer that keeps what it is notified of."""

    def __init__(self) -> None:
        self.outcomes: list[Outcome] = []
        self.messages: list[str] = []

    def on_message(self, sentence: str) -> None:
        self.messages.append(sentence)

    def on_begin(self, count: int) -> None:
        self.count = count

    def on_outcome(self, outcome: Outcome) -> None:
        self.outcomes.append(outcome)

    def reasons(self) -> dict[str, str]:
        return {each.task.name: each.reason for each in self.outcomes if each.state is not TaskState.CURRENT}


def never() -> bool:
    return False


def act(task: Task, *, stop: Callable[[], bool] | None = None) -> Outcome:
    """Does what the input of the task states."""
    word, _, rest = task.input.partition(":")
    if word == "die" or (word == "die once" and not Path(rest).exists()):
        if rest:
            Path(rest).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if word == "grow":
        _ = bytearray(int(rest))
        time.sleep(60)
    if word == "wait":
        while stop is None or not stop():
            time.sleep(0.01)
    return Outcome(task=task, state=TaskState.COMPUTED, frames=1)


def exit_at_once(*_: object) -> None:
    """Instead of serving tasks."""
    os._exit(3)
