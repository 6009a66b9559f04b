"""Tares during which something touched the sheet: they are carried out, and noted as warnings."""

from collections import deque
from dataclasses import dataclass

from manytouch.session.commands.tare import TareTime
from manytouch.values import Reading
from manytouch.values.display.text import count_of

KEPT_FRAMES = 10_000
"""Touched frames that are known when a tare takes effect, which may be seconds after its frames."""


@dataclass(eq=False, kw_only=True)
class _TouchedTare:
    """A tare with contacts; `end_ns` is when another reference replaced its own, None: it is in use."""

    tare: TareTime
    contacts: int
    end_ns: int | None = None

    def describe(self, period: str) -> str:
        touched = f"{count_of(self.contacts, 'contact')} touched the sheet when it was tared"
        return (
            f"{touched} at {_seconds(self.tare.begin_ns)}: contacts, depths and forces {period} are relative "
            "to the touched shape"
        )


class TouchedTares:
    """Compares the contacts of a session with its tares, in the thread that estimates."""

    def __init__(self) -> None:
        """No tare so far."""
        self._touched: deque[tuple[int, int]] = deque(maxlen=KEPT_FRAMES)
        self._now_ns = 0
        self._tare: TareTime | None = None
        self._found: dict[TareTime, _TouchedTare] = {}

    def add(self, reading: Reading) -> None:
        """Note whether something touches the sheet in a frame."""
        self._now_ns = reading.frame.timestamp_ns
        if reading.contacts.touching:
            self._touched.append((self._now_ns, len(reading.contacts.touching)))

    def use(self, tare: TareTime | None) -> str | None:
        """Note which tare the reference of the following frames is from.

        Returns:
            A sentence if it is a new one and something touched the sheet; else None.
        """
        if tare is self._tare:
            return None
        before = None if self._tare is None else self._found.get(self._tare)
        if before is not None:
            before.end_ns = self._now_ns
        self._tare = tare
        if tare is None:
            return None
        if tare in self._found:  # a later one was undone
            self._found[tare].end_ns = None
            return self.warning
        counts = [count for time_ns, count in self._touched if tare.begin_ns <= time_ns <= tare.end_ns]
        if counts:
            self._found[tare] = _TouchedTare(tare=tare, contacts=max(counts))
        return self.warning

    @property
    def warning(self) -> str | None:
        """A sentence if the reference in use is that of a touched sheet."""
        found = None if self._tare is None else self._found.get(self._tare)
        if found is None:
            return None
        return f"{found.describe('since then')}; undo the tare, and tare while nothing touches"

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence on each reference that was that of a touched sheet, with the times of its use."""
        return tuple(
            each.describe("after it" if each.end_ns is None else f"until {_seconds(each.end_ns)}")
            for each in self._found.values()
        )


def _seconds(time_ns: int) -> str:
    return f"{time_ns * 1e-9:.2f} s"
