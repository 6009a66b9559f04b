"""Contacts of the last seconds, for the curves of pages that are opened later."""

import threading
from collections import deque
from typing import Any

import numpy as np

from manytouch.sinks.viewer.update_format import number
from manytouch.values import Contact, Reading

SPAN_S = 20.0
MAX_ROWS = 4096
COLUMNS = (
    "x_mm",
    "y_mm",
    "depth_mm",
    "depth_std_mm",
    "normal_force_N",
    "force_std_N",
    "shear_x_N",
    "shear_y_N",
    "torque_Nmm",
    "slip",
)
"""What is kept of a contact, in the columns of contacts.csv."""


class RecentContacts:
    """Contacts of the readings of the last `SPAN_S` seconds, at most `MAX_ROWS` of them.

    A reading from another place of a recording begins again, as the curves of a page do.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()  # readings come in a thread of the session
        self._rows: deque[list[float | int | None]] = deque(maxlen=MAX_ROWS)
        self._last_s = -np.inf

    def add(self, reading: Reading) -> None:
        """Take a new reading."""
        time_s = reading.frame.timestamp_ns * 1e-9
        with self._lock:
            if not 0.0 <= time_s - self._last_s <= SPAN_S:
                self._rows.clear()
            elif time_s == self._last_s:
                return
            self._last_s = time_s
            while self._rows and (self._rows[0][0] or 0.0) < time_s - SPAN_S:
                self._rows.popleft()
            self._rows.extend(_row(time_s, contact) for contact in reading.contacts.touching)

    def message(self) -> dict[str, Any]:
        """The message for a page: time of the last reading, columns, rows of time, identity and numbers."""
        with self._lock:
            return {
                "kind": "recent",
                "time_s": number(self._last_s),
                "columns": COLUMNS,
                "rows": list(self._rows),
            }


def _row(time_s: float, contact: Contact) -> list[float | int | None]:
    (x_mm, y_mm), (shear_x_N, shear_y_N, force_z_N) = contact.centre_mm, contact.force_N
    numbers = (
        x_mm,
        y_mm,
        contact.depth_mm,
        contact.std("depth"),
        -force_z_N,
        contact.std("normal_force"),
        shear_x_N,
        shear_y_N,
        contact.torque_Nmm,
    )
    slip = None if contact.slip is None else int(contact.slip)
    return [number(time_s), contact.id, *(number(value) for value in numbers), slip]
