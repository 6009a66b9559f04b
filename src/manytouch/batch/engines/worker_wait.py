"""The wait for workers of a cluster, which is reported and has an end."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from manytouch.errors import ManytouchError
from manytouch.values.display.text import count_of

LONGEST_WAIT_H = 24.0
"""Longest time without any worker, in hours: jobs of a busy cluster begin after hours."""
REPORT_WAIT_S = 10.0
"""Time without any worker after which the wait is reported."""
COUNT_INTERVAL_S = 1.0
"""Time between two requests for the number of workers, while none ends a task."""


@dataclass(eq=False, kw_only=True)
class WorkerWait:
    """Reports that there is no worker, and ends the batch if none comes.

    Attributes:
        notify: gets sentences for the user.
        longest_h: time without any worker after which the batch fails.
    """

    notify: Callable[[str], None] = print
    longest_h: float = LONGEST_WAIT_H
    _since_s: float = 0.0
    _counted_s: float = 0.0
    _is_reported: bool = False

    def begin(self) -> None:
        """Count the time from now."""
        self._since_s = self._counted_s = time.monotonic()

    def check(self, threads: Callable[[], int]) -> None:
        """Count the threads of all workers, if that is due.

        Raises:
            ManytouchError: there has been none for the longest time.
        """
        now_s = time.monotonic()
        if now_s - self._counted_s < COUNT_INTERVAL_S:
            return
        self._counted_s, found = now_s, threads()
        waited_s = now_s - self._since_s
        if found:
            self._since_s = now_s
            if self._is_reported:
                self._is_reported = False
                self.notify(f"workers with {count_of(found, 'thread')} are there")
        elif waited_s > 3600 * self.longest_h:
            raise ManytouchError(
                f"no worker was there for {_hours(self.longest_h)}: check that jobs or workers start (with "
                "'squeue --me', and in their log files), or wait longer with --wait-h; the same command "
                "continues"
            )
        elif waited_s > REPORT_WAIT_S and not self._is_reported:
            self._is_reported = True
            self.notify(
                f"waiting for workers: none is there; after {_hours(self.longest_h)} without any the batch "
                "ends (--wait-h)"
            )


def _hours(hours: float) -> str:
    return f"{hours:g} h" if hours >= 1 else f"{60 * hours:.2g} min"
