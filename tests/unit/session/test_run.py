"""The run loop: order, notification, and what is closed whatever ends it."""

from collections.abc import Generator
from typing import Any

import pytest

from manytouch.errors import OutputError
from manytouch.pipeline import Sink
from manytouch.session import Observer, Readings, run
from manytouch.values import Sensor
from straight import straight_camera


class Numbers:
    """Readings that are numbers; notes every call in `log`."""

    sensor = Sensor(name="bench", camera=straight_camera(8, 6, focal_px=10.0, distance_mm=10.0))
    frame_count = 3

    def __init__(self, log: list[str], fails_at: int | None = None) -> None:
        self._log, self._fails_at = log, fails_at
        self.own_sinks: tuple[Sink, ...] = (Noted("own", log),)

    def start(self, observer: Observer, stop: object) -> Generator[Any, None, None]:
        self._log.append("start")
        observer.on_message("hello")
        try:
            for number in range(3):
                if number == self._fails_at:
                    raise ValueError("the source broke")
                yield number
        finally:
            self._log.append("ended")

    def close(self) -> None:
        self._log.append("released")


class Noted:
    """A sink that notes its calls."""

    def __init__(self, name: str, log: list[str], *, fails: bool = False) -> None:
        self._name, self._log, self._fails = name, log, fails

    def write(self, reading: Any) -> None:
        if self._fails:
            raise OutputError("no room")
        self._log.append(f"{self._name} {reading}")

    def close(self) -> None:
        self._log.append(f"{self._name} closed")


class Watch:
    """An observer that notes its calls."""

    def __init__(self, log: list[str], *, fails: bool = False) -> None:
        self._log, self._fails = log, fails

    def on_message(self, sentence: str) -> None:
        self._log.append(sentence)

    def on_begin(self, sensor: Any, frame_count: int | None) -> None:
        self._log.append(f"begin {sensor.name} {frame_count}")
        if self._fails:
            raise KeyboardInterrupt

    def on_reading(self, reading: Any) -> None:
        self._log.append(f"read {reading}")


CLOSED = ["a closed", "b closed", "own closed"]


def test_each_reading_reaches_sinks_in_order_then_own_sinks_then_the_observer() -> None:
    log: list[str] = []
    numbers = Numbers(log)
    assert isinstance(numbers, Readings)
    run(numbers, [Noted("a", log), Noted("b", log)], Watch(log))
    each = [line for n in range(3) for line in (f"a {n}", f"b {n}", f"own {n}", f"read {n}")]
    assert log == ["begin bench 3", "start", "hello", *each, "ended", "released", *CLOSED]


def test_stop_ends_after_the_present_reading() -> None:
    log: list[str] = []
    run(Numbers(log), [Noted("a", log)], Watch(log), stop=lambda: "a 1" in log)
    assert "a 1" in log
    assert "a 2" not in log
    assert log[-4:] == ["released", "ended", "a closed", "own closed"]


@pytest.mark.parametrize("culprit", ["source", "sink", "observer"])
def test_whatever_fails_everything_is_closed_and_the_error_is_raised(culprit: str) -> None:
    log: list[str] = []
    kind = {"source": ValueError, "sink": OutputError, "observer": KeyboardInterrupt}[culprit]
    with pytest.raises(kind):
        run(
            Numbers(log, fails_at=1 if culprit == "source" else None),
            [Noted("a", log), Noted("b", log, fails=culprit == "sink")],
            Watch(log, fails=culprit == "observer"),
        )
    assert log[-3:] == CLOSED
    assert "released" in log
    assert ("ended" in log) == ("start" in log)
