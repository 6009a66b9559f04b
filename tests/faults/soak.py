"""A long live session: memory, threads, open files and latency must stay as they are. `make soak`.

    python tests/faults/soak.py [--frames 1000000] [--minutes 60]

Pictures of 854 x 480 px, drawn in advance, are processed as fast as possible with a viewer, two clients that
come and go, and a recording that begins and ends again and again. The goals: less than 20 MB more memory than
after the first 10 000 frames, no thread and no open file left at the end, and the latency (p99) of the last
tenth not above one and a half times that of the first.
"""

import argparse
import os
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from faults.client import Listener
from faults.loop_source import LoopSource, rendered
from manytouch.session import Live, prepare, run
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sinks.viewer import UPDATE_INTERVAL_S, Viewer
from manytouch.values import Reading, Record, StopRecording

SETTLED, RECORD_EVERY, RECORD_FOR = 10_000, 5_000, 500
MAX_GROWTH_MB, MAX_RATIO = 20.0, 1.5


def memory_mb() -> float:
    """Resident memory of this process, MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def open_files() -> int:
    """Number of open files of this process."""
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


class Watch:
    """A sink that measures latency and memory, and switches the recording on and off."""

    def __init__(self, live: Live, folder: Path, frames: int) -> None:
        self._live, self._folder = live, folder
        self._latency_ms = np.full(frames, np.nan)  # in memory from the beginning: a list grows by 40 MB
        self.count = 0
        self.settled_mb = self.peak_mb = 0.0
        self.recordings = 0

    def write(self, reading: Reading) -> None:
        assert reading.frame.arrived_ns is not None
        self._latency_ms[self.count] = (time.monotonic_ns() - reading.frame.arrived_ns) * 1e-6
        self.count = count = self.count + 1
        if count % 500 == 0 and count >= SETTLED:
            present_mb = memory_mb()
            self.settled_mb = self.settled_mb or present_mb
            self.peak_mb = max(self.peak_mb, present_mb)
        if count % RECORD_EVERY == 1000:
            self._live.send(Record())
            self.recordings += 1
        elif count % RECORD_EVERY == 1000 + RECORD_FOR:
            self._live.send(StopRecording())
        elif count % RECORD_EVERY == 0:
            for path in self._folder.glob("*.mcap"):
                path.unlink()

    def close(self) -> None:
        pass

    @property
    def latency_ms(self) -> np.ndarray:
        """Of all readings so far."""
        return self._latency_ms[: self.count]


def come_and_go(viewer: Viewer, over: threading.Event, stay_s: float) -> None:
    """Connect for some seconds, again and again."""
    while not over.is_set():
        with Listener(viewer):
            over.wait(stay_s)
        over.wait(0.5)


def soak(frames: int, minutes: float, folder: Path) -> list[tuple[str, str, bool]]:
    """Run the session; the rows of the table: what, found, whether the goal is met."""
    before = threading.active_count(), open_files()
    source = LoopSource(rendered(), is_live=False, fps=2000.0, limit=frames)
    live = Live(prepare(source, method="perimeter"), recordings=folder)
    watch, viewer, over = Watch(live, folder, frames), Viewer(live), threading.Event()
    visitors = [threading.Thread(target=come_and_go, args=(viewer, over, stay_s)) for stay_s in (2.0, 3.5)]
    end_s, begin_s = time.monotonic() + 60.0 * minutes, time.monotonic()

    def is_late() -> bool:
        if watch.count >= frames - 100:
            over.set()  # the clients go before the viewer is closed
        return time.monotonic() > end_s

    for visitor in visitors:
        visitor.start()
    run(live, [watch, LatestOnly(viewer, interval_s=UPDATE_INTERVAL_S)], stop=is_late)
    over.set()
    for visitor in visitors:
        visitor.join()
    spent_s = time.monotonic() - begin_s
    for _ in range(100):
        after = threading.active_count(), open_files()
        if after == before:
            break
        time.sleep(0.1)
    count = watch.count
    tenth = max(count // 10, 1)
    first, last = (
        float(np.percentile(part, 99)) for part in (watch.latency_ms[:tenth], watch.latency_ms[-tenth:])
    )
    grown_mb = watch.peak_mb - watch.settled_mb
    return [
        ("frames", f"{count} in {spent_s:.0f} s, {count / spent_s:.0f} per second", count == frames),
        ("recordings", f"{watch.recordings}", True),
        (f"memory beyond the first {SETTLED}", f"{grown_mb:.1f} MB", grown_mb < MAX_GROWTH_MB),
        ("threads before and after", f"{before[0]}, {after[0]}", after[0] <= before[0]),
        ("open files before and after", f"{before[1]}, {after[1]}", after[1] <= before[1]),
        ("latency p99, first and last tenth", f"{first:.1f}, {last:.1f} ms", last < MAX_RATIO * first),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--minutes", type=float, default=60.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = soak(options.frames, options.minutes, Path(folder))
    for name, found, is_met in rows:
        print(f"{name:34} {found:40} {'met' if is_met else 'MISSED'}")
    return int(not all(is_met for _, _, is_met in rows))


if __name__ == "__main__":
    sys.exit(main())
