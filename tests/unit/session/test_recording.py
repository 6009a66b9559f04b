"""Times in the recording of a live session follow the wall clock, whenever it is begun."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from clips import picture
from drawn_source import DrawnSource
from manytouch.recording.reader import Recording
from manytouch.session import Live, prepare, run
from manytouch.sinks import recorder as recorder_module
from manytouch.sources import Capabilities, open_source
from manytouch.values import Frame, Reading, Record

pytest.importorskip("mcap")
UNIX_NS, MONOTONIC_NS = 1_700_000_000_000_000_000, 5_000_000_000
WARM_UP_NS, STEP_NS, LATENCY_NS = 20_000_000_000, 100_000_000, 3_000_000


class Clock:
    """Wall and monotonic clock of a machine; it stands in for the module `time`."""

    def __init__(self) -> None:
        self.passed_ns = 0

    def time_ns(self) -> int:
        return UNIX_NS + self.passed_ns

    def monotonic_ns(self) -> int:
        return MONOTONIC_NS + self.passed_ns


@dataclass
class Camera:
    """A live source whose first frames come long before the session processes any."""

    clock: Clock
    name: str = "bench"
    fps: float | None = 10.0
    frame_count: int | None = None
    width_px: int = 320
    height_px: int = 240
    is_live: bool = True
    is_colour: bool = False
    status: str = "ok"
    settings: tuple[Any, ...] = ()
    tap: Any = None

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(device=self)

    def listen(self, tap: Any) -> None:
        self.tap = tap

    def close(self) -> None: ...

    def __iter__(self) -> Iterator[Frame]:
        recorded = 0
        for index in range(4000):
            if recorded == 20:
                return
            if index > 30:
                time.sleep(0.005)  # until the session has processed those before
            self.clock.passed_ns = STEP_NS * index + (WARM_UP_NS if index >= 15 else 0)
            frame = Frame(
                index=index,
                timestamp_ns=self.clock.passed_ns,
                camera=self.name,
                image=picture(seed=index),
                arrived_ns=self.clock.monotonic_ns(),
            )
            self.clock.passed_ns += LATENCY_NS
            if self.tap is not None:
                recorded += 1
                self.tap(frame)
            yield frame


class RecordLater:
    """A sink that requests a recording when the session has run for a while."""

    def __init__(self, live: Live, path: Path) -> None:
        self._live, self._path, self._is_sent = live, path, False

    def write(self, reading: Reading) -> None:
        if reading.frame.index > 21 and not self._is_sent:
            self._live.send(Record(path=self._path))
            self._is_sent = True

    def close(self) -> None: ...


@pytest.mark.parametrize("is_late", [False, True])
def test_log_times_are_those_of_the_wall_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_late: bool
) -> None:
    clock, path = Clock(), tmp_path / "x.mcap"
    monkeypatch.setattr(recorder_module, "time", clock)
    live = Live(prepare(Camera(clock)), record=None if is_late else path)
    run(live, [RecordLater(live, path)] if is_late else [])
    from mcap.reader import make_reader

    with path.open("rb") as file:
        log_ns = [message.log_time for _, _, message in make_reader(file).iter_messages()]
    assert max(log_ns) == UNIX_NS + clock.passed_ns - LATENCY_NS
    assert min(log_ns) >= UNIX_NS
    first = next(iter(open_source(path)))
    assert (first.index > 20) == is_late


class Slow:
    """A live source with the clocks of this machine, whose timestamps began long before its frames."""

    name, fps, frame_count, width_px, height_px = "bench", 30.0, None, 320, 240
    is_live, is_colour, status, settings = True, False, "ok", ()

    def __init__(self) -> None:
        self.tap: Any = None
        self.arrived_unix_ns: list[int] = []

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(device=self)

    def listen(self, tap: Any) -> None:
        self.tap = tap

    def close(self) -> None: ...

    def __iter__(self) -> Iterator[Frame]:
        begun_ns = time.monotonic_ns() - 20 * 10**9
        for index in range(30):
            if index > 15:
                time.sleep(0.1)
            now_ns = time.monotonic_ns()
            self.arrived_unix_ns.append(time.time_ns())
            frame = Frame(
                index=index,
                timestamp_ns=now_ns - begun_ns,
                camera=self.name,
                image=picture(seed=index),
                arrived_ns=now_ns,
            )
            if self.tap is not None:
                self.tap(frame)
            yield frame


def test_the_last_log_time_is_when_the_last_frame_arrived_and_not_after_the_file_was_changed(
    tmp_path: Path,
) -> None:
    from mcap.reader import make_reader

    path, source = tmp_path / "x.mcap", Slow()
    run(Live(prepare(source), record=path), [])
    with path.open("rb") as file:
        log_ns = [message.log_time for _, _, message in make_reader(file).iter_messages(topics=["/camera"])]
    assert abs(max(log_ns) - source.arrived_unix_ns[-1]) < 50_000_000
    assert max(log_ns) < path.stat().st_mtime_ns + 50_000_000


def test_frames_of_a_live_source_without_a_device_are_recorded(tmp_path: Path) -> None:
    path = tmp_path / "own.mcap"
    job = prepare(DrawnSource(frames=60, is_touched=False, is_live=True), method="perimeter", pitch_mm=4.0)
    live = Live(job, record=path)
    run(live)
    assert len(Recording(path)) == live.health().frames + live.health().dropped > 0
