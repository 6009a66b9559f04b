"""A sink that passes on the start of a run only."""

from manytouch.pipeline import Sink
from manytouch.values import Reading


class FirstSeconds:
    """Passes readings to another sink up to a time; a sink."""

    def __init__(self, sink: Sink, seconds: float) -> None:
        self._sink, self._last_ns = sink, round(seconds * 1e9)

    def write(self, reading: Reading) -> None:
        """Pass on a reading unless its frame is later than the limit."""
        if reading.frame.timestamp_ns <= self._last_ns:
            self._sink.write(reading)

    def close(self) -> None:
        """Close the other sink."""
        self._sink.close()
