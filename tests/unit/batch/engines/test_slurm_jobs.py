"""SLURM jobs, where sbatch is a program that runs their script on this machine, refuses it, or is absent."""

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from batch_work import act, never
from command_line import run_command
from manytouch.batch.engines.slurm_jobs import SlurmOptions, describe_jobs, jobs_for, slurm_jobs
from manytouch.batch.engines.worker_wait import WorkerWait
from manytouch.batch.tasks import Task, TaskState
from manytouch.errors import ManytouchError

pytest.importorskip("dask_jobqueue")
OPTIONS = SlurmOptions(jobs=20, cores=2, memory="4GB", walltime="01:00:00", interface="lo")


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Writes a shell script that is found by its name."""
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")

    def write(name: str, lines: str) -> None:
        (tmp_path / name).write_text(f"#!/bin/sh\n{lines}\n")
        (tmp_path / name).chmod(0o755)

    return write


@pytest.mark.parametrize(("recordings", "jobs"), [(0, 0), (1, 1), (2, 1), (3, 2), (39, 20), (1000, 20)])
def test_there_are_no_more_jobs_than_recordings_need(recordings: int, jobs: int) -> None:
    assert jobs_for(OPTIONS, recordings) == jobs


def test_a_description_explains_number_memory_and_script() -> None:
    found = describe_jobs(OPTIONS.model_copy(update={"memory": "16GB"}), 5)
    assert found.startswith("by 3 jobs of 2 workers (the file allows 20;")
    assert "16GB are 14.9 GiB" in found
    assert "--mem=15G" in found
    assert "an illustration" in found


def test_a_memory_that_is_no_size_is_refused() -> None:
    with pytest.raises(ManytouchError, match="memory = 'much' is not a size"):
        describe_jobs(OPTIONS.model_copy(update={"memory": "much"}), 5)


def test_without_sbatch_a_batch_ends_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slurm.toml").write_text('jobs = 1\ncores = 1\nmemory = "2GB"\nwalltime = "1:00"\n')
    monkeypatch.setenv("PATH", str(tmp_path))
    done = run_command("batch", "a.mp4", "--out", "out", "--slurm", "slurm.toml", folder=tmp_path)
    assert done.returncode == 1
    assert "sbatch" in done.stderr
    assert "login node" in done.stderr


def test_jobs_that_sbatch_refuses_are_an_error(program: Callable[[str, str], None]) -> None:
    program("sbatch", "echo Invalid account >&2; exit 1")
    with (
        pytest.raises(ManytouchError, match=r"could not be submitted.*Invalid account"),
        slurm_jobs(OPTIONS, 1, WorkerWait()),
    ):
        raise AssertionError


@pytest.fixture
def jobs_of_this_machine(program: Callable[[str, str], None], tmp_path: Path) -> Iterator[None]:
    """Programs that start and end jobs as processes of this machine."""
    number = tmp_path / "job"
    program("sbatch", f'setsid sh "$1" >/dev/null 2>&1 & echo $! > {number}; echo "Submitted batch job $!"')
    program("scancel", "kill -- -$1")
    yield
    if number.exists():
        with contextlib.suppress(ProcessLookupError):
            os.killpg(int(number.read_text()), signal.SIGKILL)


@pytest.mark.slow
def test_jobs_do_the_tasks(jobs_of_this_machine: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    sentences: list[str] = []
    tasks = [Task(name=name, input=name) for name in "abc"]
    with slurm_jobs(OPTIONS, 1, WorkerWait(notify=sentences.append)) as engine:
        found: dict[str, Any] = {each.task.name: each.state for each in engine.run(act, tasks, never)}
    assert found == dict.fromkeys("abc", TaskState.COMPUTED)
    assert sentences[0] == "1 SLURM job submitted, each with 2 workers"
