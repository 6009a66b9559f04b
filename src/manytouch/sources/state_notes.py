"""Sentences for the user when a camera stops giving images, and when it gives them again."""

import re
from collections.abc import Callable

from manytouch.sources.source import Source
from manytouch.values import Reading


class StateNotes:
    """Passes on each change of the state of a source's device; a sink, so that it looks after each reading.

    While no reading comes, the condition that `checked` returns looks too.
    """

    def __init__(self, source: Source, note: Callable[[str], None]) -> None:
        """Nothing is wrong at the beginning.

        Args:
            source: whose device is observed; without one nothing is ever passed on.
            note: gets the sentences, in the thread that looks.
        """
        self._source = source
        self._note = note
        self._noted = "ok"

    def write(self, reading: Reading) -> None:
        """Look at the state."""
        self._check()

    def close(self) -> None:
        """Nothing to do."""

    def checked(self, stop: Callable[[], bool]) -> Callable[[], bool]:
        """A condition that looks at the state before each call of another one."""

        def look_and_stop() -> bool:
            self._check()
            return stop()

        return look_and_stop

    def _check(self) -> None:
        device = self._source.capabilities.device
        state = "ok" if device is None else device.status
        kind = re.sub(r"\d+", "", state)  # the seconds of a silence count up
        if kind == self._noted:
            return
        self._noted = kind
        self._note(f"{self._source.name} gives images again" if state == "ok" else state)
