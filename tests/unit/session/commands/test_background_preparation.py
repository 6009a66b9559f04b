"""The newest request is prepared in a thread, and there is a thread only meanwhile."""

import threading
import time

import pytest

from manytouch.errors import ManytouchError
from manytouch.session.commands import background_preparation
from manytouch.session.commands.background_preparation import BackgroundPreparation
from waiting import wait_until


@pytest.fixture(autouse=True)
def _no_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background_preparation, "PAUSE_S", 0.0)


def test_of_many_requests_the_first_and_the_newest_are_prepared() -> None:
    go_on, prepared = threading.Event(), []

    def prepare(value: int) -> int:
        assert go_on.wait(10)
        prepared.append(value)
        return value

    preparation = BackgroundPreparation(prepare, refuse=print)
    for value in range(1, 100):
        preparation.request(value)
        if value == 1:
            wait_until(lambda: preparation.requested() == 1)
            time.sleep(0.01)
    assert preparation.requested() == 99
    assert preparation.take() is None
    assert preparation.is_busy
    go_on.set()
    wait_until(lambda: not preparation.is_busy)
    assert prepared in ([1, 99], [99])
    assert preparation.requested() == 99
    assert preparation.take() == 99
    assert preparation.take() is None
    assert preparation.requested() is None
    preparation.close()
    assert "manytouch-prepare" not in [thread.name for thread in threading.enumerate()]


def test_a_refused_value_is_never_ready() -> None:
    refused: list[str] = []

    def prepare(value: int) -> int:
        if value == 2:
            raise ManytouchError("not this one")
        return value + 10

    preparation = BackgroundPreparation(prepare, refused.append)
    preparation.request(1)
    wait_until(lambda: not preparation.is_busy)
    preparation.request(2)
    wait_until(lambda: not preparation.is_busy)
    assert refused == ["not this one"]
    assert preparation.take() == 11, "as it was prepared"
    preparation.close()
    preparation.request(3)
    assert not preparation.is_busy
