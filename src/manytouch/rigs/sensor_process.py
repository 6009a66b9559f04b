"""The process of one sensor: it captures, processes, records and shows.

Contacts go to the first process, which is that of `run_rig`.
"""

import contextlib
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path

from manytouch.errors import ManytouchError
from manytouch.pipeline import Sink
from manytouch.rigs.common_start import BeginMessage, ReadyMessage
from manytouch.rigs.rig_contact import RigContact, in_rig
from manytouch.rigs.rig_file import RigSensor
from manytouch.values import Reading, Sensor

HEALTH_EVERY_S, POLL_S = 0.5, 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactsMessage:
    """The contacts of one frame; `at_ns` is by the clock that all processes of a machine share.

    It is the arrival of a camera's frame; that of a file or a simulation follows from its timestamp.
    """

    at_ns: int
    contacts: tuple[RigContact, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthMessage:
    """Counts of a sensor since its process began.

    Attributes:
        frames, dropped, readings_per_s, source_state: see `manytouch.values.Health`; the last may also be
            "starting" or "compiling" before the first frame, and "ended".
    """

    frames: int
    dropped: int
    readings_per_s: float
    source_state: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NoteMessage:
    """A sentence for the user.

    Attributes:
        sentence: of the process.
        viewer: address of its viewer.
        sensor_name: of its sensor, if there is a viewer.
        is_failure: the process ends for this reason.
        is_of_outputs: the reason is an output that cannot be opened, as no other attempt would.
    """

    sentence: str
    viewer: str | None = None
    sensor_name: str | None = None
    is_failure: bool = False
    is_of_outputs: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorOptions:
    """What the process of a sensor does in addition to processing.

    Attributes:
        record: file of its part of the recording; None: nothing is recorded.
        out: its result folder; None: no tables.
        viewer_host: address of its viewer; None: no viewer.
        page_origin: of the page that shows the viewer in a tile; None: none may.
    """

    record: Path | None = None
    out: Path | None = None
    viewer_host: str | None = None
    page_origin: str | None = None


class ContactStream:
    """A sink that sends contacts, and from time to time the health of the session."""

    def __init__(
        self,
        rig_sensor: RigSensor,
        sensor: Callable[[], Sensor],
        health: Callable[[], HealthMessage],
        to: Connection,
        begun_ns: Callable[[], int | None],
    ) -> None:
        self._rig_sensor, self._sensor, self._health, self._to = rig_sensor, sensor, health, to
        self._begun_ns = begun_ns
        self._sent_s = 0.0

    def write(self, reading: Reading) -> None:
        """Send the contacts of a frame, those that just ended too."""
        frame, sensor = reading.frame, self._sensor()
        if reading.contacts.contacts:
            begun_ns = self._begun_ns()
            arrived_ns = time.monotonic_ns() if frame.arrived_ns is None else frame.arrived_ns
            at_ns = arrived_ns if begun_ns is None else begun_ns + frame.timestamp_ns
            found = (
                in_rig(contact, sensor, self._rig_sensor, frame) for contact in reading.contacts.contacts
            )
            self._to.send(ContactsMessage(at_ns=at_ns, contacts=tuple(found)))
        if time.monotonic() - self._sent_s > HEALTH_EVERY_S:
            self._sent_s = time.monotonic()
            self._to.send(self._health())

    def close(self) -> None:
        """Send the last counts."""
        with contextlib.suppress(OSError):
            self._to.send(self._health())


class _Notes:
    """An observer that sends messages to the first process."""

    def __init__(self, to: Connection) -> None:
        self._to = to

    def on_message(self, sentence: str) -> None:
        self._to.send(NoteMessage(sentence=sentence))

    def on_begin(self, sensor: Sensor, frame_count: int | None) -> None:
        pass

    def on_reading(self, reading: Reading) -> None:
        pass


class _Begin:
    """Waits until the first process lets files and simulations begin.

    Attributes:
        at_ns: when timestamp 0 is due; None before, and for a camera.
    """

    def __init__(self, connection: Connection, started_unix_ns: int | None, stop: Callable[[], bool]) -> None:
        self._connection, self._started_unix_ns, self._stop = connection, started_unix_ns, stop
        self.at_ns: int | None = None

    def __call__(self) -> int:
        self._connection.send(ReadyMessage(started_unix_ns=self._started_unix_ns))
        while not self._stop() and not self._connection.poll(POLL_S):
            pass
        message = self._connection.recv() if self._connection.poll() else None
        self.at_ns = message.at_ns if isinstance(message, BeginMessage) else time.monotonic_ns()
        return self.at_ns


def run_sensor(connection: Connection, rig_sensor: RigSensor, options: SensorOptions) -> None:
    """Run one sensor until its source ends or SIGTERM; its failure is a message, and exit status 1."""
    stopped = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process decides
    if sys.platform != "win32":
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: stopped.set())
    threading.Thread(target=_end_with_the_first, args=(stopped,), daemon=True).start()
    try:
        _run(connection, rig_sensor, options, stopped.is_set)
    except Exception as error:  # noqa: BLE001 - the first process reports it
        note = NoteMessage(
            sentence=" ".join(str(error).split()),
            is_failure=True,
            is_of_outputs=isinstance(error, _OutputsRefusedError),
        )
        with contextlib.suppress(OSError):
            connection.send(note)
        raise SystemExit(1) from None


class _OutputsRefusedError(ManytouchError):
    """An output of the sensor cannot be opened."""


def _run(
    connection: Connection, rig_sensor: RigSensor, options: SensorOptions, stop: Callable[[], bool]
) -> None:
    from manytouch.session import Live, ResultFiles, prepare, run
    from manytouch.sinks.output_process.process import start_outputs
    from manytouch.sources.cameras.capture import CameraRequest

    notes = _Notes(connection)
    job = prepare(
        rig_sensor.source,
        sensor=rig_sensor.sensor,
        method=rig_sensor.method,
        fps=rig_sensor.fps,
        camera=CameraRequest(size_px=rig_sensor.size_px, is_mjpg=True),
        observer=notes,
    )
    begin = _Begin(connection, job.source.capabilities.started_unix_ns, stop)
    live = Live(job, record=options.record, begin=None if job.source.is_live else begin)
    try:
        outputs = start_outputs(rig_sensor.to, live)
    except ManytouchError as error:
        raise _OutputsRefusedError(str(error)) from error
    live.attach(outputs)
    for description in (each for output in outputs for each in output.descriptions):
        notes.on_message(description)

    def health() -> HealthMessage:
        found = live.health()
        return HealthMessage(
            frames=found.frames,
            dropped=found.dropped,
            readings_per_s=found.readings_per_s or 0.0,
            source_state=found.source_state,
        )

    sinks: list[Sink] = [
        ContactStream(rig_sensor, lambda: live.sensor, health, connection, lambda: begin.at_ns)
    ]
    if options.viewer_host is not None:
        from manytouch.sinks.latest_only import LatestOnly
        from manytouch.sinks.viewer import UPDATE_INTERVAL_S, Viewer

        viewer = Viewer(live, host=options.viewer_host, embedded_in=options.page_origin)
        note = NoteMessage(
            sentence=f"viewer at {viewer.url}", viewer=viewer.url, sensor_name=live.sensor.name
        )
        connection.send(note)
        sinks.append(LatestOnly(viewer, interval_s=UPDATE_INTERVAL_S))
    connection.send(replace(health(), source_state="compiling"))
    if options.out is None:
        run(live, sinks, notes, stop)
        return
    with ResultFiles(options.out, job, is_repeatable=False, warnings=lambda: live.warnings) as files:
        files.is_complete = run(live, [*files.sinks, *sinks], notes, stop)


def _end_with_the_first(stopped: threading.Event) -> None:
    import multiprocessing

    first = multiprocessing.parent_process()
    if first is not None:
        first.join()
        stopped.set()  # files are completed
