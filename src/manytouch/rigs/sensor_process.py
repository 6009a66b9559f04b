"""The process of one sensor: it captures, processes, records and shows; contacts go to the first process."""

import contextlib
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from manytouch.pipeline import Sink
from manytouch.rigs.rig_file import RigSensor
from manytouch.values import Contact, Reading, Sensor

HEALTH_EVERY_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class RigContact:
    """A contact in the frame of the rig; NaN where the sensor does not state it.

    Attributes:
        id, phase, frame: see `manytouch.Contact`.
        position_mm: of its centre on the pressed surface.
        force_N: of the object on the sheet.
        depth_mm: see `manytouch.Contact`.
    """

    id: int
    phase: str
    frame: int
    position_mm: tuple[float, float, float]
    force_N: tuple[float, float, float]
    depth_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactsMessage:
    """The contacts of one frame; `arrived_ns` is by the clock that all processes of a machine share."""

    arrived_ns: int
    contacts: tuple[RigContact, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthMessage:
    """Counts of a sensor since its process began."""

    frames: int
    dropped: int
    fps: float
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NoteMessage:
    """A sentence for the user; `viewer` is an address instead."""

    sentence: str
    viewer: str | None = None
    is_failure: bool = False


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


def in_rig(contact: Contact, sensor: Sensor, rig: RigSensor, frame: int) -> RigContact:
    """A contact in the frame of the rig; without coordinates if the sensor's scale is not known."""
    x, y = (float(value) for value in contact.centre_mm)
    if sensor.length_unit == "mm":
        position = rig.rotation @ np.array([x, y, -contact.depth_mm]) + rig.translation_mm
    else:
        position = np.full(3, np.nan)
    force = rig.rotation @ np.asarray(contact.force_N, dtype=np.float64)
    return RigContact(
        id=contact.id,
        phase=contact.phase.value,
        frame=frame,
        position_mm=(float(position[0]), float(position[1]), float(position[2])),
        force_N=(float(force[0]), float(force[1]), float(force[2])),
        depth_mm=float(contact.depth_mm) if sensor.length_unit == "mm" else float("nan"),
    )


class ContactStream:
    """A sink that sends contacts, and from time to time the health of the session."""

    def __init__(
        self,
        rig: RigSensor,
        sensor: Callable[[], Sensor],
        health: Callable[[], HealthMessage],
        to: Connection,
    ) -> None:
        self._rig, self._sensor, self._health, self._to = rig, sensor, health, to
        self._sent_s = 0.0

    def write(self, reading: Reading) -> None:
        """Send the contacts of a frame, those that just ended too."""
        frame, sensor = reading.frame, self._sensor()
        if reading.contacts.contacts:
            arrived_ns = time.monotonic_ns() if frame.arrived_ns is None else frame.arrived_ns
            found = (in_rig(contact, sensor, self._rig, frame.index) for contact in reading.contacts.contacts)
            self._to.send(ContactsMessage(arrived_ns=arrived_ns, contacts=tuple(found)))
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


def run_sensor(connection: Connection, rig: RigSensor, options: SensorOptions) -> None:
    """Run one sensor until its source ends or SIGTERM; its failure is a message, and exit status 1."""
    stopped = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process decides
    signal.signal(signal.SIGTERM, lambda *_: stopped.set())
    threading.Thread(target=_end_with_the_first, args=(stopped,), daemon=True).start()
    try:
        _run(connection, rig, options, stopped.is_set)
    except Exception as error:  # noqa: BLE001 - the first process reports it
        with contextlib.suppress(OSError):
            connection.send(NoteMessage(sentence=" ".join(str(error).split()), is_failure=True))
        raise SystemExit(1) from None


def _run(connection: Connection, rig: RigSensor, options: SensorOptions, stop: Callable[[], bool]) -> None:
    from manytouch.session import Live, ResultFiles, prepare, run
    from manytouch.sources.cameras.capture import CameraRequest

    notes = _Notes(connection)
    job = prepare(
        rig.source,
        sensor=rig.sensor,
        method=rig.method,
        fps=rig.fps,
        camera=CameraRequest(size_px=rig.size_px, is_mjpg=True),
        observer=notes,
    )
    live = Live(job, record=options.record)

    def health() -> HealthMessage:
        found = live.health()
        return HealthMessage(
            frames=found.frames, dropped=found.dropped, fps=found.fps or 0.0, source=found.source
        )

    sinks: list[Sink] = [ContactStream(rig, lambda: live.sensor, health, connection)]
    if options.viewer_host is not None:
        from manytouch.sinks.latest_only import LatestOnly
        from manytouch.sinks.viewer import Viewer

        viewer = Viewer(live, host=options.viewer_host, embedded_in=options.page_origin)
        connection.send(NoteMessage(sentence=f"viewer at {viewer.url}", viewer=viewer.url))
        sinks.append(LatestOnly(viewer))
    connection.send(health())
    if options.out is None:
        run(live, sinks, notes, stop)
        return
    with ResultFiles(options.out, job, is_repeatable=False) as files:
        files.is_complete = run(live, [*files.sinks, *sinks], notes, stop)


def _end_with_the_first(stopped: threading.Event) -> None:
    import multiprocessing

    first = multiprocessing.parent_process()
    if first is not None:
        first.join()
        stopped.set()  # files are completed
