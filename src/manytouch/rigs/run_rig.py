"""Runs a rig: starts the process of each sensor, starts it again when it dies, and joins what they send."""

import csv
import multiprocessing
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from manytouch.errors import OutputError
from manytouch.recording.merge import merge_recordings
from manytouch.rigs.common_start import CommonStart, ReadyMessage
from manytouch.rigs.rig_contact import COLUMNS, RigContact
from manytouch.rigs.rig_file import Rig, RigSensor
from manytouch.rigs.sensor_process import (
    ContactsMessage,
    HealthMessage,
    NoteMessage,
    SensorOptions,
    run_sensor,
)
from manytouch.sinks.files.atomic_output import atomic_file
from manytouch.source_names import is_camera

POLL_S, END_S = 0.2, 15.0
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 30.0
MOST_FAILURES = 5  # in a row, before any frame
_CONTEXT = multiprocessing.get_context("spawn")


@dataclass(eq=False)
class SensorState:
    """A sensor of a running rig.

    Attributes:
        sensor: of the rig file.
        health: counts of its present process.
        frames, dropped: counts of its earlier processes.
        restarts: how often its process was started again.
        viewer: address of its viewer.
        sensor_name: of the sensor file, or of what takes its place; None until the viewer is there.
        parts: its recordings, one per process.
        is_over: its source has ended, or it failed for good.
        failure: the last sentence of a failure.
        has_no_outputs: the failure is an output that could not be opened, before any frame.
        pid: number of its process.
    """

    sensor: RigSensor
    process: SpawnProcess | None = None
    connection: Connection | None = None
    health: HealthMessage = field(
        default_factory=lambda: HealthMessage(
            frames=0, dropped=0, readings_per_s=0.0, source_state="starting"
        )
    )
    frames: int = 0
    dropped: int = 0
    restarts: int = 0
    failures: int = 0
    viewer: str | None = None
    sensor_name: str | None = None
    parts: list[Path] = field(default_factory=list)
    is_over: bool = False
    failure: str | None = None
    has_no_outputs: bool = False
    start_at_s: float = 0.0

    @property
    def pid(self) -> int | None:
        """Number of the process; None before it has started."""
        return None if self.process is None else self.process.pid


@runtime_checkable
class RigObserver(Protocol):
    """An object that is notified of what happens in a rig."""

    def on_note(self, sensor: str, sentence: str) -> None:
        """A sentence about a sensor."""

    def on_contacts(self, sensor: str, time_s: float, contacts: tuple[RigContact, ...]) -> None:
        """Contacts of a frame in rig coordinates; seconds by the clock of the rig."""


def run_rig(
    rig: Rig,
    observer: RigObserver,
    stop: Callable[[], bool],
    *,
    out: Path | None = None,
    record: Path | None = None,
    viewer_host: str | None = None,
    page_origin: str | None = None,
    on_states: Callable[[Mapping[str, SensorState]], None] | None = None,
) -> Mapping[str, SensorState]:
    """Run all sensors until their sources end or `stop` returns True.

    Args:
        rig: the sensors.
        observer: notified of contacts and notes.
        stop: ends the run; files are completed.
        out: a folder that gets contacts.csv of the rig, and a result folder per sensor.
        record: a file that gets one set of channels per sensor; while the rig runs, each process writes a
            file of its own next to it.
        viewer_host: address of the viewers; None: none.
        page_origin: of the page that shows the viewers as tiles.
        on_states: gets the states before the first process is started.

    Returns:
        The state of each sensor by name.

    Raises:
        OutputError: contacts.csv cannot be written, or an output of a sensor cannot be opened: starting the
            sensor again would not help.
    """
    viewer = SensorOptions(viewer_host=viewer_host, page_origin=page_origin)
    states = {sensor.name: SensorState(sensor) for sensor in rig.sensors}
    if on_states is not None:
        on_states(states)
    start = CommonStart(has_camera=any(is_camera(sensor.source) for sensor in rig.sensors))
    with ExitStack() as closing:
        rows: Any = None
        if out is not None:
            path = closing.enter_context(atomic_file(out / "contacts.csv"))
            rows = csv.writer(closing.enter_context(path.open("w", newline="", encoding="utf-8")))
            rows.writerow(COLUMNS)
        try:
            while not stop() and not all(state.is_over for state in states.values()):
                _start_due(states, out, record, viewer)
                for state, message in _messages(states):
                    _take(state, message, observer, rows, start)
                _require_outputs(states)
                _bury_dead(states, observer)
                start.begin_if_ready(_expected(states))
        finally:
            _end(states, lambda state, message: _take(state, message, observer, rows, start))
            if any(state.has_no_outputs for state in states.values()):
                _remove_unused(states, is_begun=start.is_begun)
    if record is not None:
        _merge(states, record)
    return states


def _require_outputs(states: Mapping[str, SensorState]) -> None:
    """Raises OutputError if a sensor has had no frame because one of its outputs cannot be opened."""
    for name, state in states.items():
        if state.has_no_outputs:
            raise OutputError(f"{name}: {state.failure}")


def _start_due(
    states: Mapping[str, SensorState], out: Path | None, record: Path | None, viewer: SensorOptions
) -> None:
    """Start the processes that do not run and are due."""
    for name, state in states.items():
        if state.is_over or state.process is not None or time.monotonic() < state.start_at_s:
            continue
        part = None
        if record is not None:
            part = record.with_name(f"{record.stem}.{name}.{len(state.parts)}{record.suffix}")
            part.unlink(missing_ok=True)
            state.parts.append(part)
        suffix = f"-{state.restarts}" if state.restarts else ""
        options = SensorOptions(
            record=part,
            out=None if out is None else out / f"{name}{suffix}",
            viewer_host=viewer.viewer_host,
            page_origin=viewer.page_origin,
        )
        here, there = _CONTEXT.Pipe()
        process = _CONTEXT.Process(target=run_sensor, args=(there, state.sensor, options), name=name)
        process.start()
        there.close()
        state.process, state.connection = process, here


def _messages(states: Mapping[str, SensorState]) -> Iterator[tuple[SensorState, Any]]:
    """What the processes have sent."""
    by_handle: dict[Any, SensorState] = {}
    for state in states.values():
        if state.process is not None and state.connection is not None:
            by_handle[state.process.sentinel] = by_handle[state.connection] = state
    if not by_handle:
        time.sleep(POLL_S)
    found = dict.fromkeys(by_handle[handle] for handle in wait(list(by_handle), timeout=POLL_S))
    for state in found:
        yield from ((state, message) for message in _received(state))


def _received(state: SensorState) -> Iterator[Any]:
    try:
        while state.connection is not None and state.connection.poll():
            yield state.connection.recv()
    except (EOFError, OSError):
        if state.connection is not None:
            state.connection.close()
        state.connection = None


def _expected(states: Mapping[str, SensorState]) -> dict[str, bool]:
    """The sensors without a camera, and whether the others wait for each: not for one that has failed."""
    return {
        name: not state.is_over and not state.failures
        for name, state in states.items()
        if not is_camera(state.sensor.source)
    }


def _take(state: SensorState, message: Any, observer: RigObserver, rows: Any, start: CommonStart) -> None:
    name = state.sensor.name
    if isinstance(message, HealthMessage):
        state.health = message
        if message.frames:
            state.failures = 0
    elif isinstance(message, NoteMessage):
        state.viewer = message.viewer or state.viewer
        state.sensor_name = message.sensor_name or state.sensor_name
        state.failure = message.sentence if message.is_failure else state.failure
        state.has_no_outputs = message.is_of_outputs and not state.frames
        if not state.has_no_outputs:  # else it is the error that ends the rig
            observer.on_note(name, message.sentence)
    elif isinstance(message, ContactsMessage):
        time_s = (message.at_ns - start.began_ns) * 1e-9
        observer.on_contacts(name, time_s, message.contacts)
        if rows is not None:
            rows.writerows(contact.row(name, time_s) for contact in message.contacts)
    elif isinstance(message, ReadyMessage) and state.connection is not None:
        start.ready(name, state.connection, message)


def _bury_dead(states: Mapping[str, SensorState], observer: RigObserver) -> None:
    """Note which processes have ended; those that did not end by themselves are started again."""
    for name, state in states.items():
        process = state.process
        if process is None or process.is_alive() or (state.connection and state.connection.poll()):
            continue
        process.join()
        code = process.exitcode
        _forget_process(state)
        if code == 0:
            state.is_over = True
            continue
        state.failures += 1
        if state.failures >= MOST_FAILURES:
            state.is_over = True
            observer.on_note(name, f"given up after {MOST_FAILURES} failures: {state.failure or code}")
            continue
        state.restarts += 1
        pause_s = min(FIRST_PAUSE_S * 2 ** (state.failures - 1), LONGEST_PAUSE_S)
        state.start_at_s = time.monotonic() + pause_s
        observer.on_note(name, f"its process ended (exit status {code}); started again in {pause_s:g} s")


def _forget_process(state: SensorState) -> None:
    if state.connection is not None:
        state.connection.close()
    state.frames += state.health.frames
    state.dropped += state.health.dropped
    state.health = HealthMessage(frames=0, dropped=0, readings_per_s=0.0, source_state="ended")
    state.process = state.connection = state.viewer = None


def _end(states: Mapping[str, SensorState], take: Callable[[SensorState, Any], None]) -> None:
    """End all processes, which complete their files, and take what they still send."""
    running = [state for state in states.values() if state.process is not None]
    for state in running:
        assert state.process is not None
        state.process.terminate()
    limit_s = time.monotonic() + END_S
    for state in running:
        process = state.process
        assert process is not None
        while process.is_alive() and time.monotonic() < limit_s:
            for message in _received(state):
                take(state, message)
            process.join(POLL_S / 4)
        if process.is_alive():
            process.kill()
            process.join()
        for message in _received(state):
            take(state, message)
        _forget_process(state)


def _remove_unused(states: Mapping[str, SensorState], *, is_begun: bool) -> None:
    """Remove recordings without frames, and those of files and simulations that waited for the others."""
    for state in states.values():
        if not state.frames or not (is_begun or is_camera(state.sensor.source)):
            for part in state.parts:
                part.unlink(missing_ok=True)


def _merge(states: Mapping[str, SensorState], record: Path) -> None:
    """Join the recordings of the processes, which are removed then."""
    parts = {
        name: [part for part in state.parts if part.is_file() and part.stat().st_size > 0]
        for name, state in states.items()
    }
    if not any(parts.values()):
        return
    with atomic_file(record) as merged:
        merge_recordings(parts, merged)
    for part in (part for paths in parts.values() for part in paths):
        part.unlink()
