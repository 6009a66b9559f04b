"""Tasks in this process and in others: all results, a stop between tasks, and a process that dies."""

import math
import os

import pytest

from manytouch.errors import ManytouchError
from manytouch.evaluation.workers import worked


@pytest.mark.parametrize("processes", [1, 2])
def test_every_task_has_its_result(processes: int) -> None:
    assert dict(worked(math.sqrt, [1.0, 4.0, 9.0], processes=processes)) == {0: 1.0, 1: 2.0, 2: 3.0}


@pytest.mark.parametrize("processes", [1, 2])
def test_no_task_is_begun_after_the_stop(processes: int) -> None:
    answers = iter((False, False))
    done = dict(worked(math.sqrt, [1.0, 4.0, 9.0], processes=processes, stop=lambda: next(answers, True)))
    assert done == {0: 1.0, 1: 2.0}


def test_a_killed_process_is_said_in_a_sentence() -> None:
    with pytest.raises(ManytouchError, match="the same command goes on where it ended"):
        list(worked(os._exit, [3, 3], processes=2))
