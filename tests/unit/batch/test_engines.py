"""Batches on a dask scheduler, and the jobs of SLURM."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from batch_work import act, never
from command_line import run_command
from manytouch.batch.engines.dask_scheduler import connect
from manytouch.batch.engines.slurm_jobs import read_options
from manytouch.batch.tasks import Task, TaskState
from manytouch.errors import ManytouchError
from manytouch.session import process
from same_results import differences

dask = pytest.importorskip("dask")
pytest.importorskip("distributed")
TESTS = Path(__file__).parents[2]


def start(*words: str) -> subprocess.Popen:
    path = os.pathsep.join([str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + words[0], *words[1:]],
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"},
        start_new_session=True,
    )


def end(program: subprocess.Popen) -> None:
    os.killpg(program.pid, signal.SIGKILL)
    program.wait()


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen]]:
    """A scheduler with one worker, which a nanny starts again when it dies."""
    file = tmp_path / "scheduler.json"
    flags = ("--scheduler-file", str(file))
    scheduling = start("dask_scheduler", *flags, "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    working = start("dask_worker", *flags, "--nworkers", "1", "--nthreads", "1", "--no-dashboard")
    try:
        while not file.exists():
            assert scheduling.poll() is None

        time.sleep(0.2)
        yield json.loads(file.read_text())["address"], scheduling
    finally:
        end(working)
        if scheduling.poll() is None:
            end(scheduling)


@pytest.mark.slow
def test_a_batch_on_a_scheduler_has_the_results_of_process_and_isolates_what_kills_workers(
    scheduler: tuple[str, subprocess.Popen],
    recordings: Path,
    tmp_path: Path,
    batch: Callable[..., Any],
) -> None:
    address, program = scheduler
    engine = connect(address)
    path = recordings / "press1.mp4"
    report, _ = batch(path, engine=engine)
    assert report.computed == report.complete == 1
    expected = process(path, out=tmp_path / "expected")
    assert differences(tmp_path / "out" / "press1", expected) == []

    tasks = [Task(name=str(number), input=text) for number, text in enumerate(("a", "die", "b"))]
    found = {each.task.input: each for each in engine.run(act, tasks, never)}
    assert {name: each.state for name, each in found.items()} == {
        "a": TaskState.COMPUTED,
        "b": TaskState.COMPUTED,
        "die": TaskState.FAILED,
    }
    assert "died" in found["die"].reason

    end(program)
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        pytest.raises(ManytouchError, match="connection to the dask scheduler was lost"),
    ):
        list(engine.run(act, tasks, never))
    engine.client.close(timeout=1)


def test_a_scheduler_that_does_not_answer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from manytouch.batch.engines import dask_scheduler

    monkeypatch.setattr(dask_scheduler, "CONNECT_TIMEOUT_S", 0.2)
    with pytest.raises(ManytouchError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9"):
        connect("tcp://127.0.0.1:9")


@pytest.mark.parametrize("address", ["hpc", "other://hpc:8786"])
def test_an_address_that_dask_cannot_read_is_refused_before_a_client_is_made(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("distributed.Client", None)
    with pytest.raises(ManytouchError, match=rf"no dask scheduler answers at {address} \(.*give the address"):
        connect(address)


OPTIONS = """
jobs = 3
cores = 2
memory = "8GB"
walltime = "01:30:00"
account = "touch"
job_extra_directives = ["--exclude=node7"]
job_script_prologue = ["module load python"]
"""


def test_the_script_of_the_jobs_is_printed_by_a_dry_run(tmp_path: Path, recordings: Path) -> None:
    (tmp_path / "slurm.toml").write_text(OPTIONS)
    done = run_command(
        "batch", recordings, "--out", tmp_path / "out", "--slurm", tmp_path / "slurm.toml", "--dry-run"
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert "3 of 3 recordings would be processed" in lines
    fewer = "by 2 jobs of 2 workers (the file allows 3; more would have nothing to do)"
    assert any(line.startswith(fewer) for line in lines)
    for line in ("-A touch", "--cpus-per-task=2", "-t 01:30:00", "--exclude=node7"):
        assert f"#SBATCH {line}" in lines
    assert lines.index("export OPENBLAS_NUM_THREADS=1") < lines.index("module load python")
    (command,) = (line for line in lines if "dask_worker" in line)
    assert "--nthreads 1" in command
    assert "--nworkers 2" in command
    assert not (tmp_path / "out").exists()


def test_all_mistakes_of_the_options_are_listed(tmp_path: Path) -> None:
    (tmp_path / "slurm.toml").write_text('jobs = 0\ncores = "2"\nmemory = "8GB"\nspeed = 1\n')
    with pytest.raises(ManytouchError) as caught:
        read_options(tmp_path / "slurm.toml")
    for words in ("jobs", "cores", "walltime", "speed"):
        assert words in str(caught.value)
    with pytest.raises(ManytouchError, match="does not exist"):
        read_options(tmp_path / "other.toml")
