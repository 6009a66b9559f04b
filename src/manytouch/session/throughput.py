"""Rate and latency of a session."""

import time
from collections import deque

import numpy as np

from manytouch.values import Reading

RATE_OVER_NS = 2 * 10**9
LATENCIES = 300
"""Readings of whose latency median and 99th percentile are stated: ten seconds at 30 per second. A choice:
the latter needs some hundred, and with more, the numbers follow a change later."""
_COUNTED = 1000  # readings for the rate; above 500 per second they span less than two seconds


class ThroughputMeter:
    """The last sink of a session: counts readings that all others have. It may be read from other threads.

    Attributes:
        frames: readings so far.
        markers_seen: in the last reading.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.markers_seen = 0
        self._done_ns: deque[int] = deque(maxlen=_COUNTED)
        self._latency_ms: deque[float] = deque(maxlen=LATENCIES)

    def write(self, reading: Reading) -> None:
        """Count a reading, and the time since its frame arrived."""
        now_ns = time.monotonic_ns()
        self.frames += 1
        self.markers_seen = int(reading.grid.is_seen.sum())
        self._done_ns.append(now_ns)
        if reading.frame.arrived_ns is not None:
            self._latency_ms.append((now_ns - reading.frame.arrived_ns) * 1e-6)

    def close(self) -> None:
        """Nothing to finish."""

    @property
    def readings_per_s(self) -> float:
        """Rate over the last two seconds, or over the last `_COUNTED` readings if these took less."""
        now_ns = time.monotonic_ns()
        recent = [done_ns for done_ns in tuple(self._done_ns) if now_ns - done_ns < RATE_OVER_NS]
        span_ns = max(now_ns - recent[0], 1) if len(recent) > 1 else 0
        return (len(recent) - 1) * 1e9 / span_ns if span_ns else 0.0

    @property
    def latency_ms(self) -> tuple[float, float]:
        """Median and 99th percentile of the last readings; NaN before the first."""
        known = tuple(self._latency_ms)
        if not known:
            return float("nan"), float("nan")
        median_ms, p99_ms = np.percentile(known, [50, 99])
        return float(median_ms), float(p99_ms)
