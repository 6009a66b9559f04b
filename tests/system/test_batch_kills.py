"""`manytouch batch` while its workers, itself and its scheduler are killed."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from batch_programs import check_all, recordings_in, start

MOST_RUNS = 40
linux_only = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds workers in /proc")


def workers_of(program: subprocess.Popen) -> list[int]:
    """Process numbers of the children, without the one that only watches shared memory."""
    try:
        children = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
        return [
            int(child) for child in children if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()
        ]
    except OSError:
        return []


def run_with_kills(folder: Path, out: Path, kills: int, seed: int) -> int:
    """Call the batch until it ends with status 0, killing at random; how often something was killed."""
    random, killed = np.random.default_rng(seed), 0
    for _ in range(MOST_RUNS):
        program = start(folder, out)
        while program.poll() is None:
            time.sleep(random.uniform(0.1, 1.0))
            if killed >= kills or not (workers := workers_of(program)):
                continue
            victim = program.pid if random.random() < 0.2 or killed == 1 else int(random.choice(workers))
            try:
                os.kill(victim, signal.SIGKILL)
                killed += 1
            except ProcessLookupError:
                pass
        if program.returncode == 0:
            return killed
    raise AssertionError("the batch does not come to its end")


@linux_only
@pytest.mark.slow
@pytest.mark.parametrize(("count", "kills"), [(4, 2), (100, 25)], ids=["few", "hundred"])
def test_kills_cost_time_and_no_result(tmp_path: Path, count: int, kills: int) -> None:
    paths, out = recordings_in(tmp_path / "in", count), tmp_path / "out"
    assert run_with_kills(tmp_path / "in", out, kills, seed=count) >= 2
    check_all(paths, out, tmp_path / "expected")


class Cluster:
    """A dask scheduler with two workers, which is started again after it was killed."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count = folder, 0
        self.start()

    def start(self) -> None:
        """Start it at a new address."""
        self._count += 1
        file = self._folder / f"scheduler-{self._count}.json"
        flags = ("--scheduler-file", str(file), "--no-dashboard")
        self.scheduler = self._program("dask_scheduler", *flags, "--host", "127.0.0.1", "--port", "0")
        self.workers = self._program("dask_worker", *flags, "--nworkers", "2", "--nthreads", "1")
        while not file.exists():
            assert self.scheduler.poll() is None
            time.sleep(0.1)
        time.sleep(0.2)
        self.address = json.loads(file.read_text())["address"]

    def end(self) -> None:
        """End all its processes."""
        for program in (self.scheduler, self.workers):
            os.killpg(program.pid, signal.SIGKILL)
            program.wait()

    def _program(self, module: str, *words: str) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{module}", *words],
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )


@linux_only
@pytest.mark.slow
@pytest.mark.parametrize(("count", "kills"), [(6, 3), (100, 15)], ids=["few", "hundred"])
def test_a_killed_dask_scheduler_and_killed_workers_cost_time_and_no_result(
    tmp_path: Path, count: int, kills: int
) -> None:
    pytest.importorskip("distributed")
    paths, out = recordings_in(tmp_path / "in", count), tmp_path / "out"
    random, cluster, killed = np.random.default_rng(count), Cluster(tmp_path), []
    try:
        for _ in range(MOST_RUNS):
            program = start(tmp_path / "in", out, ("--scheduler", cluster.address))
            while program.poll() is None:
                time.sleep(random.uniform(0.5, 4.0))
                if len(killed) >= kills or not list(out.glob("*/summary.json")):
                    continue
                workers = workers_of(cluster.workers)
                if not killed or not workers or random.random() < 0.3:
                    killed.append("scheduler")
                    cluster.end()
                    is_complete = len(list(out.glob("*/summary.json"))) == count  # it may have ended
                    assert program.wait() == 1 or is_complete
                    cluster.start()
                else:
                    killed.append("worker")
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(int(random.choice(workers)), signal.SIGKILL)
            if program.returncode == 0:
                break
    finally:
        cluster.end()
    assert program.returncode == 0
    assert "scheduler" in killed
    check_all(paths, out, tmp_path / "expected")
