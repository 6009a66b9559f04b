"""Lines about contacts as they come and go."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from manytouch.values import Contact, Phase, Reading, Sensor, Truth

HEADINGS = f"{'time':>9}  {'contact':<15} {'x':>8} {'y':>8}   {'depth':<17} {'what'}"


@dataclass(slots=True, eq=False)
class _Life:
    """What is remembered of one contact: when it came, and its deepest moment."""

    begun_ns: int
    deepest: Contact
    truth: Truth | None


class ContactLog:
    """Prints a line when a contact comes and one when it goes; a sink.

    Where the truth is known, the nearest true contact of the same moment stands beside it.
    """

    def __init__(
        self,
        sensor: Sensor,
        write_line: Callable[[str], None],
        truth: Callable[[int], Truth | None] | None = None,
    ) -> None:
        self._unit = sensor.length_unit
        self._line = write_line
        self._truth = truth
        self._lives: dict[int, _Life] = {}
        self._now_ns = 0
        self._has_headings = False

    def write(self, reading: Reading) -> None:
        """Take in a frame."""
        self._now_ns = reading.frame.timestamp_ns
        if not reading.contacts.contacts:
            return
        truth = None if self._truth is None else self._truth(reading.frame.index)
        for contact in reading.contacts.contacts:
            life = self._lives.get(contact.id)
            if contact.phase is Phase.END:
                if life is not None:
                    self._say_gone(contact.id, "gone")
                continue
            if life is None:
                self._lives[contact.id] = _Life(self._now_ns, contact, truth)
                self._say(contact, f"#{contact.id} touches", self._beside(contact, truth))
            elif not contact.depth_mm <= life.deepest.depth_mm:
                life.deepest, life.truth = contact, truth

    def close(self) -> None:
        """Name the contacts that are still there."""
        for number in sorted(self._lives):
            self._say_gone(number, "still there")

    def _say_gone(self, number: int, word: str) -> None:
        life = self._lives.pop(number)
        lasted_s = (self._now_ns - life.begun_ns) * 1e-9
        what = f"deepest of {lasted_s:.2f} s{self._beside(life.deepest, life.truth, ', ')}"
        self._say(life.deepest, f"#{number} {word}", what)

    def _say(self, contact: Contact, word: str, what: str) -> None:
        x, y = contact.centre_mm
        line = f"{self._now_ns * 1e-9:7.2f} s  {word:<15} {x:8.2f} {y:8.2f}   {_depth(contact):<17} {what}"
        if not self._has_headings:
            self._line(f"{HEADINGS}   (lengths in {self._unit})")
            self._has_headings = True
        self._line(line.rstrip())

    def _beside(self, contact: Contact, truth: Truth | None, before: str = "") -> str:
        if truth is None:
            return ""
        known = truth.contacts.touching
        if not known:
            return f"{before}truth: nothing touches"
        nearest = min(known, key=lambda other: math.dist(other.centre_mm, contact.centre_mm))
        x, y = nearest.centre_mm
        return f"{before}truth {x:.2f}, {y:.2f}, depth {nearest.depth_mm:.2f}"


def _depth(contact: Contact) -> str:
    if not math.isfinite(contact.depth_mm):
        return "not known"
    std = contact.std("depth")
    return f"{contact.depth_mm:.2f}" + (f" ± {std:.2f}" if math.isfinite(std) else "")
