"""Lines on the console about contacts that start and end."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from manytouch.values import Contact, Phase, Reading, Sensor, Status, Truth
from manytouch.values.display.text import with_std

HEADINGS = f"{'time':>9}  {'contact':<15} {'x':>8} {'y':>8}   {'depth':<17}"
FORCE_HEADING = f"{'force (N)':<15}"
JUMP_FRAMES = 30  # a recording that skips more was moved to another place


@dataclass(slots=True, eq=False)
class _OpenContact:
    """A contact that has started: its start, and its deepest frame."""

    started_ns: int
    deepest: Contact
    truth: Truth | None


class ContactLog:
    """Prints a line at the start and at the end of a contact; a sink.

    A playback may go back and forth: each contact is printed once.
    Lines have a column of normal forces if the sensor states the modulus of its sheet, and the nearest true
    contact of the same frame if the ground truth is known.
    """

    def __init__(
        self,
        sensor: Sensor,
        write_line: Callable[[str], None],
        truth: Callable[[int], Truth | None] | None = None,
    ) -> None:
        self._unit = sensor.length_unit
        self._has_forces = sensor.sheet is not None and sensor.sheet.young_MPa is not None
        self._line = write_line
        self._truth = truth
        self._open: dict[int, _OpenContact] = {}
        self._printed: set[int] = set()
        self._now_ns, self._last_index = 0, 0
        self._has_headings = False

    def write(self, reading: Reading) -> None:
        """Print the contacts that start or end in a frame."""
        is_jump = reading.frame.index > self._last_index + JUMP_FRAMES
        self._last_index = max(self._last_index, reading.frame.index)
        self._now_ns = max(self._now_ns, reading.frame.timestamp_ns)
        known = {contact.id for contact in reading.contacts.contacts}
        if is_jump and reading.contacts.status is Status.OK:
            for number in sorted(set(self._open) - known):
                self._print_end(number, "gone")  # in frames that were left out
        if not known:
            return
        truth = None if self._truth is None else self._truth(reading.frame.index)
        for contact in reading.contacts.contacts:
            touch = self._open.get(contact.id)
            if contact.phase is Phase.END:
                if touch is not None:
                    self._print_end(contact.id, "gone")
            elif touch is not None:
                if not contact.depth_mm <= touch.deepest.depth_mm:
                    touch.deepest, touch.truth = contact, truth
            elif contact.id not in self._printed:
                started_ns = reading.frame.timestamp_ns
                self._open[contact.id] = _OpenContact(started_ns, contact, truth)
                self._printed.add(contact.id)
                what = self._describe_truth(contact, truth)
                self._print(started_ns, contact, f"#{contact.id} touches", what)

    def close(self) -> None:
        """Print the contacts that have not ended."""
        for number in sorted(self._open):
            self._print_end(number, "still there")

    def _print_end(self, number: int, word: str) -> None:
        touch = self._open.pop(number)
        lasted_s = (self._now_ns - touch.started_ns) * 1e-9
        what = f"deepest of {lasted_s:.2f} s{self._describe_truth(touch.deepest, touch.truth, ', ')}"
        self._print(self._now_ns, touch.deepest, f"#{number} {word}", what)

    def _print(self, at_ns: int, contact: Contact, word: str, what: str) -> None:
        x, y = contact.centre_mm
        line = f"{at_ns * 1e-9:7.2f} s  {word:<15} {x:8.2f} {y:8.2f}   {_depth(contact):<17}"
        if not self._has_headings:
            force = f" {FORCE_HEADING}" if self._has_forces else ""
            self._line(f"{HEADINGS}{force} what   (lengths in {self._unit})")
            self._has_headings = True
        if self._has_forces:
            line += f" {_force(contact):<15}"
        self._line(f"{line} {what}".rstrip())

    def _describe_truth(self, contact: Contact, truth: Truth | None, before: str = "") -> str:
        if truth is None:
            return ""
        known = truth.contacts.touching
        if not known:
            return f"{before}truth: no contact"
        nearest = min(known, key=lambda other: math.dist(other.centre_mm, contact.centre_mm))
        x, y = nearest.centre_mm
        force_N = nearest.normal_force_N
        force = f", {with_std(force_N, math.nan)} N" if self._has_forces and math.isfinite(force_N) else ""
        return f"{before}truth {x:.2f}, {y:.2f}, depth {nearest.depth_mm:.2f}{force}"


def _depth(contact: Contact) -> str:
    return with_std(contact.depth_mm, contact.std("depth"), unknown="unknown")


def _force(contact: Contact) -> str:
    return with_std(contact.normal_force_N, contact.std("normal_force"), unknown="unknown")
