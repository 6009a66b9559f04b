"""Waiting for what another thread does."""

import time
from collections.abc import Callable


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait up to 10 s until a condition is met.

    Raises:
        AssertionError: it was not met.
    """
    end_s = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end_s, "the condition was not met within 10 s"
        time.sleep(0.005)
