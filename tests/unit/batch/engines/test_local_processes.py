"""Worker processes: what the death of one costs."""

import multiprocessing
import time
from pathlib import Path

import pytest

from batch_work import act, exit_at_once, never
from manytouch.batch.engines import local_processes
from manytouch.batch.engines.local_processes import LocalProcesses, memory_per_worker, processors
from manytouch.batch.tasks import Outcome, Task, TaskState
from manytouch.errors import ManytouchError


def tasks_of(*inputs: str) -> list[Task]:
    return [Task(name=str(number), input=text) for number, text in enumerate(inputs)]


def states_of(outcomes: list[Outcome]) -> dict[str, TaskState]:
    assert len({each.task.name for each in outcomes}) == len(outcomes), "an outcome came twice"
    return {each.task.input: each.state for each in outcomes}


def test_a_dead_worker_costs_its_task_and_a_deadly_task_fails_after_two_tries(tmp_path: Path) -> None:
    once = f"die once:{tmp_path / 'dead'}"
    engine = LocalProcesses(processes=2)
    outcomes = list(engine.run(act, tasks_of("a", "die", "b", once, "c", "d"), never))
    found = states_of(outcomes)
    assert found.pop("die") is TaskState.FAILED
    assert found == dict.fromkeys(("a", "b", once, "c", "d"), TaskState.COMPUTED)
    (failed,) = (each for each in outcomes if each.state is TaskState.FAILED)
    assert "died in 2 tries (SIGKILL)" in failed.reason
    assert engine.deaths == 3


def test_a_worker_that_exceeds_its_memory_is_ended_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_processes, "TRIES", 1)
    engine = LocalProcesses(processes=1, memory_bytes=400_000_000)
    outcomes = list(engine.run(act, tasks_of("grow:600000000"), never))
    (failed,) = outcomes
    assert failed.state is TaskState.FAILED
    assert "exceeded its limit of 0.4 GB" in failed.reason


def test_a_stop_ends_what_is_running() -> None:
    engine, begun_s = LocalProcesses(processes=1), time.monotonic()
    outcomes = list(engine.run(act, tasks_of("wait", "a"), lambda: time.monotonic() > begun_s + 2.0))
    assert outcomes == []
    assert "manytouch worker" not in {each.name for each in multiprocessing.active_children()}


def test_workers_that_do_not_start_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_processes, "FAILED_STARTS", 1)
    monkeypatch.setattr(local_processes, "serve", exit_at_once)
    with pytest.raises(ManytouchError, match="before they are ready"):
        list(LocalProcesses(processes=1).run(act, tasks_of("a"), never))


def test_processors_and_memory_are_known_here() -> None:
    assert processors() >= 1
    assert (memory_per_worker(1) or 0) > 2 * (memory_per_worker(3) or 0) > 0
