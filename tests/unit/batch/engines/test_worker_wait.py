"""The wait for workers of a cluster."""

from itertools import count

import pytest

from manytouch.batch.engines import worker_wait
from manytouch.batch.engines.worker_wait import WorkerWait
from manytouch.errors import ManytouchError


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look at the clock is two seconds after the one before."""
    seconds = count(0.0, 2.0)
    monkeypatch.setattr(worker_wait.time, "monotonic", lambda: next(seconds))


def test_a_wait_is_reported_once_and_so_is_its_end() -> None:
    sentences: list[str] = []
    wait = WorkerWait(notify=sentences.append)
    wait.begin()
    for threads in (0,) * 20 + (4,) * 20:
        wait.check(lambda threads=threads: threads)
    waiting, ended = sentences
    assert "waiting for workers" in waiting
    assert "24 h" in waiting
    assert "4 threads" in ended


def test_a_wait_without_any_worker_ends() -> None:
    wait = WorkerWait(notify=lambda _: None, longest_h=0.02)
    wait.begin()
    for _ in range(20):
        wait.check(lambda: 1)
    for _ in range(36):
        wait.check(lambda: 0)
    with pytest.raises(ManytouchError, match=r"no worker was there for 1\.2 min.*--wait-h"):
        wait.check(lambda: 0)
