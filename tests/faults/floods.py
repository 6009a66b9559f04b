"""Floods of messages from one client, and what the sensing and another client notice of them.

    python tests/faults/floods.py [--seconds 6]

A camera of 60 frames per second (480p, drawn in advance) is processed live. One client sends 992 `method`,
4660 `tare` or 5760 `show` messages in 6 s, as in the attacks that stopped earlier versions; another one
measures the latency of its updates. The goals: no gap of a second between readings, and a latency of less
than 100 ms (p50) and 1 s (p99). A method that is really changed, once a second at most, starts again.
"""

import argparse
import json
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from faults.client import Listener, connect_to
from faults.loop_source import LoopSource, rendered
from manytouch.session import Live, prepare, run
from manytouch.session.warm_up import warm_up_kernels
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sinks.viewer import UPDATE_INTERVAL_S, Viewer
from manytouch.values import Reading

MAX_GAP_S, MAX_P50_MS, MAX_P99_MS = 1.0, 100.0, 1000.0
METHODS = ("mechanics", "perimeter", "paper")
FLOODS: dict[str, tuple[int, Callable[[int], dict[str, object]]]] = {
    "none": (0, lambda _: {}),
    "method": (992, lambda number: {"type": "method", "method": METHODS[number % 3]}),
    "tare": (4660, lambda _: {"type": "tare"}),
    "show": (
        5760,
        lambda number: {"type": "show", "layer": ("depth", "strain", "pressure")[number % 3], "image": True},
    ),
    "tune": (
        4660,
        lambda number: {"type": "tune", "parameter": "detect.least_snr", "value": 2.0 + 1e-4 * number},
    ),
}


class Times:
    """A sink that keeps the times of its readings."""

    def __init__(self) -> None:
        self.at_s: list[float] = []

    def write(self, reading: Reading) -> None:
        self.at_s.append(time.monotonic())

    def close(self) -> None:
        pass


def flood(pictures: tuple[np.ndarray, ...], name: str, seconds: float) -> tuple[float, float, float, int]:
    """Longest gap between readings (s), p50 and p99 of the other client's latency (ms), frames dropped."""
    live = Live(prepare(LoopSource(pictures), method="perimeter"))
    times, over = Times(), threading.Event()
    viewer = Viewer(live)
    session = threading.Thread(
        target=run, args=(live, [times, LatestOnly(viewer, interval_s=UPDATE_INTERVAL_S)], None, over.is_set)
    )
    session.start()
    try:
        while len(times.at_s) < 30:
            time.sleep(0.05)
        count, message = FLOODS[name]
        with Listener(viewer) as other, connect_to(viewer) as attacker:
            time.sleep(1.0)
            begin_s, dropped = time.monotonic(), live.health().dropped
            for number in range(count):
                attacker.send(json.dumps(message(number)))
                time.sleep(max(0.0, begin_s + number * seconds / count - time.monotonic()))
            time.sleep(max(0.0, begin_s + seconds - time.monotonic()))
            end_s, dropped = time.monotonic(), live.health().dropped - dropped
        at_s = np.array([at for at in (*times.at_s,) if begin_s <= at <= end_s])
        gap_s = float(np.diff([begin_s, *at_s, end_s]).max())
        late = [ms for at, ms in zip(other.at_s, other.latency_ms, strict=True) if begin_s <= at <= end_s]
        return gap_s, *(float(value) for value in np.percentile(late, (50, 99))), dropped
    finally:
        over.set()
        session.join()


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=6.0)
    options = parser.parse_args()
    for method in METHODS:
        warm_up_kernels(method)
    pictures = rendered()
    print(f"{'flood':8} {'messages':>8} {'longest gap s':>13} {'p50 ms':>7} {'p99 ms':>7} {'dropped':>7}")
    is_met = True
    for name, (count, _) in FLOODS.items():
        gap_s, p50_ms, p99_ms, dropped = flood(pictures, name, options.seconds)
        is_met &= gap_s < MAX_GAP_S and p50_ms < MAX_P50_MS and p99_ms < MAX_P99_MS
        print(f"{name:8} {count:8d} {gap_s:13.2f} {p50_ms:7.1f} {p99_ms:7.1f} {dropped:7d}", flush=True)
    print("goals met" if is_met else "goals missed")
    return int(not is_met)


if __name__ == "__main__":
    sys.exit(main())
