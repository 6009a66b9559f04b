"""The session's end of the process of its outputs."""

import threading
import time
from collections.abc import Sequence

from manytouch.child_process import ChildProcess, Refused, error_of
from manytouch.errors import OutputError
from manytouch.pipeline import Controls
from manytouch.sinks.output_process.messages import (
    Opened,
    Opening,
    States,
    numbers_of,
    packed,
)
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.images import ImageTurns
from manytouch.sinks.publishers.queued import RETRY_INTERVAL_S, QueuedOutput
from manytouch.sinks.publishers.registry import SCHEMES, check_addresses
from manytouch.values import OutputState, Reading, Sensor

HEALTH_INTERVAL_S = 1.0
END_S = 8.0
"""Longest time that the process has to send what is queued, and to end."""


def start_outputs(urls: Sequence[str], controls: Controls) -> "list[OutputProcess]":
    """Open outputs in a process of their own; none without addresses.

    Args:
        urls: their addresses.
        controls: the session whose readings they get; some outputs send commands to it.

    Raises:
        ManytouchError: an address is wrong.
        OutputError: an output cannot be opened.
        MissingExtraError: an output needs a package that is not installed.
    """
    check_addresses(urls)
    return [OutputProcess(urls, controls)] if urls else []


class OutputProcess:
    """A sink that passes readings to the outputs in their process; it never waits.

    Attributes:
        descriptions: of each output, its address, and what is sent where.
    """

    def __init__(
        self, urls: Sequence[str], controls: Controls, *, retry_interval_s: float = RETRY_INTERVAL_S
    ) -> None:
        """Start the process, and wait until it has opened the outputs; see `start_outputs`."""
        self._urls, self._controls = tuple(urls), controls
        self._before = _nothing_sent(urls)
        self._process: _Process | None = None
        self.descriptions: tuple[str, ...] = ()
        self._link = QueuedOutput(
            "outputs", self._open, retry_interval_s=retry_interval_s, close_timeout_s=END_S + 2.0
        )

    @property
    def waiting(self) -> int:
        """Number of readings that the process has not taken yet."""
        return self._link.waiting

    @property
    def states(self) -> tuple[OutputState, ...]:
        """What each output has sent and dropped so far."""
        link, process = self._link.state, self._process
        now = self._before if process is None else _sums(self._before, process.states)
        return tuple(
            OutputState(
                name=each.name,
                sent=each.sent,
                dropped=each.dropped + link.dropped,
                problem=link.problem or each.problem,
            )
            for each in now
        )

    @property
    def pid(self) -> int:
        """Number of the process."""
        assert self._process is not None
        return self._process.pid

    def write(self, reading: Reading) -> None:
        """Queue a reading."""
        self._link.write(reading)

    def close(self) -> None:
        """Send what is queued, close the outputs, and end the process."""
        self._link.close()

    def _open(self) -> "_Process":
        """Start the process; again, if it has died: what was lost with it is counted as dropped."""
        died, self._process = self._process, None
        if died is not None:
            self._before = _sums(self._before, died.states_at_its_end)
        self._process = process = _Process(self._urls, self._controls)
        self.descriptions = process.descriptions
        return process


class _Process:
    """A process of outputs; a `Publisher`."""

    def __init__(self, urls: Sequence[str], controls: Controls) -> None:
        self._controls, self._sensor = controls, controls.sensor
        self._turns = _image_turns(urls)
        self._passed = 0
        self._next_health_s = time.monotonic() + HEALTH_INTERVAL_S
        self._failure: Refused | None = None
        self._child = ChildProcess("manytouch.sinks.output_process", is_background=True)
        self.pid = self._child.pid
        self.states = _nothing_sent(urls)
        try:
            self.descriptions = self._opened(urls)
        except BaseException:
            self._child.end(END_S)
            self._child.close()
            raise
        self.description = "; ".join(self.descriptions)
        self._answers = threading.Thread(target=self._read, name="manytouch-outputs-answers", daemon=True)
        self._answers.start()

    @property
    def states_at_its_end(self) -> tuple[OutputState, ...]:
        """The states, where what was passed on and is neither sent nor dropped counts as dropped."""
        return tuple(
            OutputState(name=each.name, sent=each.sent, dropped=self._passed - each.sent, problem=None)
            for each in self.states
        )

    def publish(self, reading: Reading) -> None:
        """Pass a reading to the process."""
        sensor: Sensor = self._controls.sensor
        health = None
        if time.monotonic() >= self._next_health_s:
            self._next_health_s = time.monotonic() + HEALTH_INTERVAL_S
            health = numbers_of(self._controls.health())
        message = packed(
            reading, self._turns, sensor, is_sensor_new=sensor is not self._sensor, health=health
        )
        try:
            self._child.send(message)
        except OSError:
            status = self._child.end(END_S)
            self._answers.join(1.0)
            why = status if self._failure is None else self._failure.sentence
            raise OutputError(f"the process of the outputs has ended ({why})") from None
        self._sensor = sensor
        self._passed += 1

    def close(self) -> None:
        """Let the process send what it has, and end it."""
        self._child.end(END_S)
        self._answers.join(1.0)

    def _opened(self, urls: Sequence[str]) -> tuple[str, ...]:
        """Let the process open the outputs; a description of each."""
        try:
            health = numbers_of(self._controls.health())
            self._child.send(Opening(urls=tuple(urls), sensor=self._sensor, health=health))
            answer = self._child.receive()
        except OSError:
            answer = None
        if isinstance(answer, Refused):
            raise error_of(answer, "the process of the outputs")
        if not isinstance(answer, Opened):
            raise OutputError(f"the process of the outputs could not be started ({self._child.end(END_S)})")
        return answer.descriptions

    def _read(self) -> None:
        """Take the answers until the process has ended."""
        while (answer := self._child.receive()) is not None:
            if isinstance(answer, States):
                self.states = answer.outputs
            elif isinstance(answer, Refused):
                self._failure = answer
            else:
                self._controls.send(answer)
        self._child.close()


def _image_turns(urls: Sequence[str]) -> list[ImageTurns]:
    addresses = [parse_address(url) for url in urls]
    return [ImageTurns(each) for each in addresses if "images" in SCHEMES[each.scheme].options]


def _nothing_sent(urls: Sequence[str]) -> tuple[OutputState, ...]:
    names = (parse_address(url).text for url in urls)
    return tuple(OutputState(name=name, sent=0, dropped=0, problem=None) for name in names)


def _sums(before: Sequence[OutputState], now: Sequence[OutputState]) -> tuple[OutputState, ...]:
    return tuple(
        OutputState(
            name=later.name,
            sent=earlier.sent + later.sent,
            dropped=earlier.dropped + later.dropped,
            problem=later.problem,
        )
        for earlier, later in zip(before, now, strict=True)
    )
