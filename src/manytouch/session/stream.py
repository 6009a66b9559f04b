"""Readings of a live session for Python programs, with `with` and `for`, or `async with` and `async for`."""

import asyncio
import threading
from collections.abc import AsyncIterator, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import NoneType, TracebackType
from typing import Any, get_args

from manytouch.errors import ManytouchError, require_type
from manytouch.pipeline import Controls
from manytouch.session.live import Live
from manytouch.session.methods import ParameterValue
from manytouch.session.prepare import prepare
from manytouch.session.result_hashes import Pitch
from manytouch.session.run import NoObserver, Observer
from manytouch.session.warm_up import warm_up_for
from manytouch.sinks.output_process.process import start_outputs
from manytouch.sinks.publishers.registry import check_addresses
from manytouch.sources import Source
from manytouch.values import Command, Health, Reading, Roi, Sensor


def stream(
    source: str | Path | int | Source,
    *,
    sensor: str | Path | Sensor | None = None,
    method: str | None = None,
    pitch_mm: Pitch | None = None,
    hfov_deg: float | None = None,
    roi_px: Roi | None = None,
    fps: float | None = None,
    parameters: Mapping[str, ParameterValue] | None = None,
    to: Sequence[str] = (),
    record: str | Path | None = None,
    observer: Observer | None = None,
) -> "Stream":
    """A live session whose readings are iterated over.

        with manytouch.stream("0", sensor="my-sensor.toml") as readings:
            for reading in readings:
                print(reading.contacts)

    With `async with` and `async for`, frames are waited for in a thread. Files and the simulated sensor run
    at their own rate, or at `fps`. If the loop is slower than a camera, frames are dropped, and counted in
    `health`.

    Args:
        source: see `manytouch.open_source`.
        sensor, method, pitch_mm, hfov_deg, roi_px, fps, parameters: see `manytouch.prepare`.
        to: addresses of outputs, as `manytouch run --to`.
        record: record everything into this file.
        observer: gets the messages of the session; None: only the progress of compiling is shown, on standard
            error.

    Raises:
        ManytouchError: an address of `to` is wrong. Everything else is raised when the block is entered.
    """
    require_type("to", to, (list, tuple), "a list of addresses, such as ['osc://127.0.0.1:9000']")
    require_type("record", record, (str, Path, NoneType), "the path of a file, such as 'press.mcap'")
    check_addresses(to)
    return Stream(
        source,
        {
            "sensor": sensor,
            "method": method,
            "pitch_mm": pitch_mm,
            "hfov_deg": hfov_deg,
            "roi_px": roi_px,
            "fps": fps,
            "parameters": parameters,
        },
        to=to,
        record=None if record is None else Path(record),
        observer=observer,
    )


class Stream:
    """Readings of a live session, in order, while its block lasts; made by `stream`.

    The block may be left while another thread, or a task that is cancelled, waits for a reading: that ends
    the iteration.
    """

    def __init__(
        self,
        source: str | Path | int | Source,
        request: Mapping[str, Any],
        *,
        to: Sequence[str],
        record: Path | None,
        observer: Observer | None,
    ) -> None:
        self._source, self._request, self._to, self._record = source, request, to, record
        self._given, self._observer = observer, NoObserver() if observer is None else observer
        self._live: Live | None = None
        self._closing = ExitStack()
        self._readings: Generator[Reading, None, None] | None = None
        self._is_left = threading.Event()
        self._use = threading.RLock()  # of the readings, which one thread at a time may request or close

    @property
    def sensor(self) -> Sensor:
        """The sensor in use."""
        return self._controls.sensor

    @property
    def health(self) -> Health:
        """State of source, session and outputs."""
        return self._controls.health()

    def send(self, command: Command) -> None:
        """Request something, such as `Tare()`; it is carried out between two frames."""
        require_type("the command", command, get_args(Command), "one of manytouch.values, such as Tare()")
        self._controls.send(command)

    def __enter__(self) -> "Stream":
        if self._live is not None:
            raise ManytouchError("a stream can be entered once: call manytouch.stream again")
        job = prepare(self._source, observer=self._given, **self._request)
        warm_up_for(job.method, job.sensor, None if self._given is None else self._given.on_message)
        with ExitStack() as closing:
            live = Live(job, record=self._record)
            closing.callback(live.close)
            live.attach(start_outputs(self._to, live))
            for sink in live.own_sinks:
                closing.callback(sink.close)
            self._readings = live.start(self._observer, self._is_left.is_set)
            closing.callback(self._readings.close)
            with self._use:
                if self._is_left.is_set():
                    raise ManytouchError("the stream was closed while it was prepared")
                self._live = live
                self._closing = closing.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._leave()

    def __iter__(self) -> Iterator[Reading]:
        return self

    def __next__(self) -> Reading:
        live = self._live
        if live is None or self._readings is None:
            raise ManytouchError("a stream is iterated in its block: with manytouch.stream(...) as readings")
        with self._use:
            reading = next(self._readings)
            for sink in live.own_sinks:
                sink.write(reading)
        return reading

    async def __aenter__(self) -> "Stream":
        try:
            return await asyncio.to_thread(self.__enter__)
        except asyncio.CancelledError:  # the thread goes on: it closes what it has opened when it is done
            await asyncio.to_thread(self._leave)
            raise

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await asyncio.to_thread(self._leave)

    def __aiter__(self) -> AsyncIterator[Reading]:
        return self

    async def __anext__(self) -> Reading:
        reading = await asyncio.to_thread(next, self, None)
        if reading is None:
            raise StopAsyncIteration
        return reading

    def _leave(self) -> None:
        """End the session; a thread that waits for a reading is released first."""
        self._is_left.set()
        live = self._live
        if live is not None:
            live.close()
        with self._use:
            self._closing.close()

    @property
    def _controls(self) -> Controls:
        if self._live is None:
            raise ManytouchError("a stream has no session before its block is entered")
        return self._live
