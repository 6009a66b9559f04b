"""Contacts of the last seconds, for the curves of pages that are opened later."""

import threading
from collections import deque
from typing import Any

import numpy as np

from manytouch.sinks.files.tables import contact_column_names
from manytouch.sinks.viewer.update_format import number
from manytouch.values import Contact, ContactShape, Frame, Phase, Reading
from manytouch.values.tabular.rows import contact_row

SPAN_S = 20.0
MAX_ROWS = 4096
COLUMNS = ("frame", "phase", *contact_column_names("mm")[4:])
"""What is kept of a contact, in the columns of contacts.csv after time and identity."""
CODES = {"phase": tuple(Phase), "shape": tuple(ContactShape)}
"""Texts of columns in which a row has their place; each column of texts is named here."""


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
            self._rows.extend(
                [number(time_s), contact.id, *row_of(reading.frame, contact)]
                for contact in reading.contacts.touching
            )

    def message(self) -> dict[str, Any]:
        """The message for a page: time of the last reading, columns, rows of time, identity and numbers."""
        with self._lock:
            return {
                "kind": "recent",
                "time_s": number(self._last_s),
                "columns": COLUMNS,
                "codes": CODES,
                "rows": list(self._rows),
            }


def row_of(frame: Frame, contact: Contact) -> list[float | int | None]:
    """The numbers of a contact in the order of `COLUMNS`; None where not known."""
    known = contact_row(frame, contact)
    return [_number(name, known[name]) for name in COLUMNS]


def _number(name: str, value: Any) -> float | int | None:
    if value is None:
        return None
    if name in CODES:
        return CODES[name].index(value)
    return int(value) if isinstance(value, bool | int) else float(f"{value:.6g}")
