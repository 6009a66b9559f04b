"""A sink that passes on the start of a run."""

from collections.abc import Callable

from manytouch.sinks.first_seconds import FirstSeconds
from manytouch.values import Reading


class Store:
    """A sink that stores the readings that it receives."""

    def __init__(self) -> None:
        self.readings: list[Reading] = []
        self.is_closed = False

    def write(self, reading: Reading) -> None:
        self.readings.append(reading)

    def close(self) -> None:
        self.is_closed = True


def test_readings_up_to_the_limit_are_passed_on(reading_of: Callable[..., Reading]) -> None:
    store = Store()
    sink = FirstSeconds(store, 0.08)
    for index in range(5):  # 40 ms apart
        sink.write(reading_of(index))
    assert [reading.frame.index for reading in store.readings] == [0, 1, 2]
    assert not store.is_closed
    sink.close()
    assert store.is_closed
