"""Tasks in this process and in others: all results, a stop between tasks, and a process that dies."""

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from manytouch.errors import ManytouchError
from manytouch.evaluation.suite.workers import run_tasks


@pytest.mark.parametrize("processes", [1, 2])
def test_every_task_has_its_result(processes: int) -> None:
    assert dict(run_tasks(math.sqrt, [1.0, 4.0, 9.0], processes=processes)) == {0: 1.0, 1: 2.0, 2: 3.0}


@pytest.mark.parametrize("processes", [1, 2])
def test_no_task_is_begun_after_the_stop(processes: int) -> None:
    answers = iter((False, False))
    done = dict(run_tasks(math.sqrt, [1.0, 4.0, 9.0], processes=processes, stop=lambda: next(answers, True)))
    assert done == {0: 1.0, 1: 2.0}


def test_a_killed_process_is_reported_in_a_sentence() -> None:
    with pytest.raises(ManytouchError, match="the same command goes on where it ended"):
        list(run_tasks(os._exit, [3, 3], processes=2))


def test_processes_that_end_with_a_requested_stop_are_no_failure() -> None:
    answers = iter((False, False))
    assert list(run_tasks(os._exit, [3, 3], processes=2, stop=lambda: next(answers, True))) == []


BUSY = """
import os, sys, time
from pathlib import Path
from manytouch.evaluation.suite.workers import run_tasks

def work(folder):
    Path(folder, str(os.getpid())).touch()
    time.sleep(60)

if __name__ == "__main__":
    list(run_tasks(work, [sys.argv[1]] * 2, processes=2))
"""


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks processes up in /proc")
def test_when_the_first_process_is_killed_the_others_end(tmp_path: Path) -> None:
    script, folder = tmp_path / "busy.py", tmp_path / "began"
    script.write_text(BUSY)
    folder.mkdir()
    with subprocess.Popen([sys.executable, str(script), str(folder)], stderr=subprocess.DEVNULL) as first:
        assert until(lambda: len(list(folder.iterdir())) == 2)
        first.kill()
    others = [Path("/proc", path.name) for path in folder.iterdir()]
    assert until(lambda: not any(other.exists() for other in others))


def until(is_so: Callable[[], bool], seconds: float = 30.0) -> bool:
    """Wait for something; False when it does not come."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s and not is_so():
        time.sleep(0.05)
    return is_so()
