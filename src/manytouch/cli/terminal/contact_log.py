"""Lines on the console about contacts that start and end."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from manytouch.values import Contact, Phase, Reading, Sensor, Truth

HEADINGS = f"{'time':>9}  {'contact':<15} {'x':>8} {'y':>8}   {'depth':<17} {'what'}"


@dataclass(slots=True, eq=False)
class _OpenContact:
    """A contact that has started: its start, and its deepest frame."""

    started_ns: int
    deepest: Contact
    truth: Truth | None


class ContactLog:
    """Prints a line at the start and at the end of a contact; a sink.

    If the ground truth is known, the line contains the nearest true contact of the same frame.
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
        self._open: dict[int, _OpenContact] = {}
        self._now_ns = 0
        self._has_headings = False

    def write(self, reading: Reading) -> None:
        """Print the contacts that start or end in a frame."""
        self._now_ns = reading.frame.timestamp_ns
        if not reading.contacts.contacts:
            return
        truth = None if self._truth is None else self._truth(reading.frame.index)
        for contact in reading.contacts.contacts:
            touch = self._open.get(contact.id)
            if contact.phase is Phase.END:
                if touch is not None:
                    self._print_end(contact.id, "gone")
                continue
            if touch is None:
                self._open[contact.id] = _OpenContact(self._now_ns, contact, truth)
                self._print(contact, f"#{contact.id} touches", self._describe_truth(contact, truth))
            elif not contact.depth_mm <= touch.deepest.depth_mm:
                touch.deepest, touch.truth = contact, truth

    def close(self) -> None:
        """Print the contacts that have not ended."""
        for number in sorted(self._open):
            self._print_end(number, "still there")

    def _print_end(self, number: int, word: str) -> None:
        touch = self._open.pop(number)
        lasted_s = (self._now_ns - touch.started_ns) * 1e-9
        what = f"deepest of {lasted_s:.2f} s{self._describe_truth(touch.deepest, touch.truth, ', ')}"
        self._print(touch.deepest, f"#{number} {word}", what)

    def _print(self, contact: Contact, word: str, what: str) -> None:
        x, y = contact.centre_mm
        line = f"{self._now_ns * 1e-9:7.2f} s  {word:<15} {x:8.2f} {y:8.2f}   {_depth(contact):<17} {what}"
        if not self._has_headings:
            self._line(f"{HEADINGS}   (lengths in {self._unit})")
            self._has_headings = True
        self._line(line.rstrip())

    def _describe_truth(self, contact: Contact, truth: Truth | None, before: str = "") -> str:
        if truth is None:
            return ""
        known = truth.contacts.touching
        if not known:
            return f"{before}truth: no contact"
        nearest = min(known, key=lambda other: math.dist(other.centre_mm, contact.centre_mm))
        x, y = nearest.centre_mm
        return f"{before}truth {x:.2f}, {y:.2f}, depth {nearest.depth_mm:.2f}"


def _depth(contact: Contact) -> str:
    if not math.isfinite(contact.depth_mm):
        return "unknown"
    std = contact.std("depth")
    return f"{contact.depth_mm:.2f}" + (f" ± {std:.2f}" if math.isfinite(std) else "")
