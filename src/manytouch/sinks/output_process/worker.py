"""The process of the outputs: opens them, publishes the readings that arrive, reports what was sent."""

import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from io import BufferedReader, FileIO

from manytouch.child_process import pipes_to_parent, receive, refusal, send
from manytouch.errors import OutputError
from manytouch.sinks.output_process.messages import (
    Answer,
    NewReading,
    Opened,
    Opening,
    States,
    unpacked,
)
from manytouch.sinks.output_process.rest_reading import rest_reading
from manytouch.sinks.publishers.queued import QueuedOutput
from manytouch.sinks.publishers.registry import open_outputs, warm_up
from manytouch.values import Command, Comparison, Health, OutputState, Sensor

REPORT_INTERVAL_S = 0.2
NICENESS = 5
"""By how much less important to the system the outputs are than the session."""


class RemoteSession:
    """The `Controls` of the session in the other process, as far as outputs need them."""

    def __init__(self, opening: Opening, answer: "AnswerChannel") -> None:
        self._sensor, self._health, self._answer = opening.sensor, opening.health, answer

    @property
    def sensor(self) -> Sensor:
        """The sensor in use."""
        return self._sensor

    def send(self, command: Command) -> None:
        """Request something of the session."""
        self._answer.send(command)

    def health(self) -> Health:
        """State of the session, up to a second ago."""
        return self._health

    def comparison(self, frame_index: int) -> Comparison | None:
        """Not known here."""

    def update(self, message: NewReading) -> None:
        """Take what has changed."""
        self._sensor = self._sensor if message.sensor is None else message.sensor
        self._health = self._health if message.health is None else message.health


class AnswerChannel:
    """Sends answers to the session, from any thread; none if the session has ended."""

    def __init__(self, to_session: FileIO) -> None:
        self._to_session = to_session
        self._lock = threading.Lock()

    def send(self, answer: Answer) -> None:
        """Send an answer."""
        with self._lock:
            try:
                send(self._to_session, answer)
            except OSError:
                return


class StateReports:
    """A thread that reports the states of the outputs whenever they have changed."""

    def __init__(self, outputs: Sequence[QueuedOutput], answer: AnswerChannel) -> None:
        self._outputs, self._answer = outputs, answer
        self._last: tuple[OutputState, ...] = ()
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="manytouch-reports", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Report the final states."""
        self._is_over.set()
        self._thread.join()
        self._report()

    def _run(self) -> None:
        while not self._is_over.wait(REPORT_INTERVAL_S):
            self._report()

    def _report(self) -> None:
        states = tuple(output.state for output in self._outputs)
        if states != self._last:
            self._last = states
            self._answer.send(States(outputs=states))


def _warm_up(opening: Opening) -> None:
    if opening.sensor.layout is not None:
        warm_up(opening.urls, rest_reading(opening.sensor.layout), opening.sensor)


def main() -> None:
    """Publish what arrives on standard input until it is closed."""
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    from_session, to_session = pipes_to_parent()
    answer = AnswerChannel(to_session)
    try:
        _serve(from_session, answer)
    except Exception as error:  # noqa: BLE001 - the session reports it
        answer.send(refusal(error, OutputError))
        raise SystemExit(1) from None


def _serve(from_session: BufferedReader, answer: AnswerChannel) -> None:
    """Open the outputs and publish; its errors are those of the session."""
    opening = receive(from_session)
    if not isinstance(opening, Opening):
        return
    session = RemoteSession(opening, answer)
    outputs = open_outputs(opening.urls, session)
    with suppress(Exception):  # an output that cannot send has its problem with the first reading
        _warm_up(opening)
    answer.send(Opened(descriptions=tuple(output.description for output in outputs)))
    reports = StateReports(outputs, answer)
    while (message := receive(from_session)) is not None:
        session.update(message)
        reading = unpacked(message, session.sensor)
        for output in outputs:
            output.write(reading)
    with ThreadPoolExecutor(len(outputs)) as pool:
        list(pool.map(QueuedOutput.close, outputs))
    reports.close()
