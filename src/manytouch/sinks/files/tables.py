"""Tables of contacts, markers and frames.

An empty cell means that a value is unknown; it is never 0 by default.
"""

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from manytouch.sinks.files.arrow_columns import arrow_column
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.reserved_space import create_text
from manytouch.sinks.files.row_group_writer import RowGroupWriter
from manytouch.sinks.files.sensor_description import layout_of
from manytouch.values import Contact, LengthUnit, Reading, Sensor
from manytouch.values.tabular.rows import contact_row

ROWS_PER_GROUP = 16384  # of the markers; four times as many take 11 MB more memory in a file of the same size


def contact_column_names(unit: LengthUnit) -> tuple[str, ...]:
    """Names of the columns of contacts.csv; in pitch units, those of forces stay and have no values."""
    return (
        *("frame", "time_s", "contact", "phase"),
        *(f"x_{unit}", f"y_{unit}", f"depth_{unit}", "normal_force_N", "shear_x_N", "shear_y_N"),
        *(f"area_{unit}2", f"x_std_{unit}", f"y_std_{unit}", "force_std_N", "x_px", "y_px"),
        *(f"depth_std_{unit}", f"normal_force_over_E_{unit}2", "shear_x_std_N", "shear_y_std_N"),
        *("torque_Nmm", "torque_std_Nmm", f"area_std_{unit}2", "slip"),
        *(f"half_major_{unit}", f"half_minor_{unit}", "orientation_rad", "shape", "shape_probability"),
    )


def contact_list_column_names(unit: LengthUnit) -> tuple[str, ...]:
    """Names of the columns of contact_list.csv."""
    return (
        *("contact", "start_frame", "start_time_s", "end_frame", "end_time_s", "frames"),
        *("peak_frame", "peak_time_s", f"x_{unit}", f"y_{unit}", f"x_std_{unit}", f"y_std_{unit}"),
        *("x_px", "y_px", f"depth_{unit}", f"depth_std_{unit}", "normal_force_N", "force_std_N"),
        f"normal_force_over_E_{unit}2",
    )


def marker_column_names(unit: LengthUnit) -> tuple[str, ...]:
    """Names of the columns of markers.parquet."""
    return (
        *("frame", "time_s", "marker", "row", "column", "x_px", "y_px", "seen"),
        *(f"dx_{unit}", f"dy_{unit}", f"depth_{unit}", f"depth_std_{unit}"),
    )


FRAME_COLUMNS = (
    "frame",
    "time_s",
    "status",
    "markers_seen",
    "contacts",
    "milliseconds",
    "lost_ids",
    "new_ids",
    "method",
)

WITHOUT_SHEET = "perimeter"
"""The method whose values `mechanics` has in frames that do not show the sheet that was assumed."""


def time_s(timestamp_ns: int) -> float:
    """Seconds since the source's start."""
    return timestamp_ns * 1e-9


def six_digits(value: float) -> str:
    """Six significant digits; empty when not known, and no minus sign on a zero."""
    return f"{value + 0.0:.6g}" if math.isfinite(value) else ""


def cell(value: object) -> object:
    """A value of `contact_row` as it is written; empty when not known."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return int(value)
    return six_digits(value) if isinstance(value, float) else value


def seconds_text(timestamp_ns: int) -> str:
    """Seconds since the source's start, to the microsecond however long it has run."""
    return f"{time_s(timestamp_ns):.6f}"


class _CsvTable:
    """A CSV file."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self._path = path
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = create_text(path)
            self._writer = csv.writer(self._file, lineterminator="\n")
            self._writer.writerow(columns)

    def add(self, rows: Iterable[Sequence[object]]) -> None:
        with output_errors(self._path):
            self._writer.writerows(rows)

    def close(self) -> None:
        with output_errors(self._path):
            self._file.close()


class ContactTable:
    """contacts.csv: one line per contact per frame."""

    def __init__(self, folder: Path, sensor: Sensor) -> None:
        self._table = _CsvTable(folder / "contacts.csv", contact_column_names(sensor.length_unit))

    def write(self, reading: Reading) -> None:
        """Add the contacts of a frame, those that just ended too."""
        self._table.add(self._row(reading, contact) for contact in reading.contacts.contacts)

    def close(self) -> None:
        """Complete the file."""
        self._table.close()

    def _row(self, reading: Reading, contact: Contact) -> list[object]:
        values = contact_row(reading.frame, contact)
        values["time_s"] = seconds_text(reading.frame.timestamp_ns)
        return [cell(values[name]) for name in contact_column_names("mm")]


def method_of(reading: Reading, method: str) -> str:
    """The method that estimated a frame in a session with `method`; empty for a frame without a surface."""
    if not np.isfinite(reading.surface.displacement_mm).any():
        return ""
    return WITHOUT_SHEET if method == "mechanics" and reading.surface.spline is None else method


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactSummary:
    """One contact from its start to its end.

    Attributes:
        first, last: (frame, ns) in which it first and last touches.
        frames: number of frames in which it touches.
        peak: (frame, ns) of `at_peak`.
        at_peak: the contact where its normal force is largest, or its depth if no force is known.
        deepest: the contact where its depth is largest; its depth is NaN where none is known.
    """

    first: tuple[int, int]
    last: tuple[int, int]
    frames: int
    peak: tuple[int, int]
    at_peak: Contact
    deepest: Contact


class ContactList:
    """contact_list.csv: one line per contact, at the end.

    Attributes:
        contacts: the contacts so far, by number.
    """

    def __init__(self, folder: Path, sensor: Sensor) -> None:
        self._table = _CsvTable(folder / "contact_list.csv", contact_list_column_names(sensor.length_unit))
        self._is_written = False
        self.contacts: dict[int, ContactSummary] = {}

    def write(self, reading: Reading) -> None:
        """Add the contacts that touch in a frame."""
        now = reading.frame.index, reading.frame.timestamp_ns
        for contact in reading.contacts.touching:
            before = self.contacts.get(contact.id)
            if before is None:
                self.contacts[contact.id] = ContactSummary(
                    first=now, last=now, frames=1, peak=now, at_peak=contact, deepest=contact
                )
                continue
            is_peak = _strength(contact) > _strength(before.at_peak)
            is_deepest = _or_zero(contact.depth_mm) > _or_zero(before.deepest.depth_mm)
            self.contacts[contact.id] = replace(
                before,
                last=now,
                frames=before.frames + 1,
                peak=now if is_peak else before.peak,
                at_peak=contact if is_peak else before.at_peak,
                deepest=contact if is_deepest else before.deepest,
            )

    def close(self) -> None:
        """Write the lines and complete the file."""
        if not self._is_written:
            self._is_written = True
            self._table.add(self._row(number, found) for number, found in sorted(self.contacts.items()))
        self._table.close()

    def _row(self, number: int, found: ContactSummary) -> list[object]:
        peak, deepest = found.at_peak, found.deepest
        (first, first_ns), (last, last_ns), (frame, peak_ns) = found.first, found.last, found.peak
        return [
            *(number, first, seconds_text(first_ns), last, seconds_text(last_ns), found.frames),
            *(frame, seconds_text(peak_ns)),
            *(six_digits(float(value)) for value in peak.centre_mm),
            *(six_digits(peak.std(name)) for name in ("x", "y")),
            *(six_digits(float(value)) for value in peak.centre_px),
            *(six_digits(deepest.depth_mm), six_digits(deepest.std("depth"))),
            *(six_digits(-float(peak.force_N[2])), six_digits(peak.std("normal_force"))),
            six_digits(peak.normal_force_over_E_mm2),
        ]


def _or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def _strength(contact: Contact) -> tuple[float, float, float]:
    """By which the peak of a contact is chosen: normal force, force over E, depth; 0 where not known."""
    return (
        _or_zero(-float(contact.force_N[2])),
        _or_zero(contact.normal_force_over_E_mm2),
        _or_zero(contact.depth_mm),
    )


class FrameTable:
    """frames.csv: one line per frame, also for those that failed."""

    def __init__(self, folder: Path, method: str | None = None) -> None:
        """Begin the file.

        Args:
            folder: of the file.
            method: of the session; None: not known, and the column `method` is empty.
        """
        self._method = method
        self._table = _CsvTable(folder / "frames.csv", FRAME_COLUMNS)

    def write(self, reading: Reading) -> None:
        """Add a frame."""
        row = (
            reading.frame.index,
            seconds_text(reading.frame.timestamp_ns),
            reading.status,
            int(reading.grid.is_seen.sum()),
            len(reading.contacts.touching),
            six_digits(reading.milliseconds),
            *("" if count is None else count for count in (reading.grid.lost_ids, reading.grid.new_ids)),
            "" if self._method is None else method_of(reading, self._method),
        )
        self._table.add([row])

    def close(self) -> None:
        """Complete the file."""
        self._table.close()


class MarkerTable:
    """markers.parquet: one line per marker per frame; markers known to be absent have none.

    Rows are gathered and appended as row groups, so memory does not grow with the recording.
    """

    def __init__(self, folder: Path, sensor: Sensor) -> None:
        layout = layout_of(sensor)
        self._marker = np.flatnonzero(~layout.is_missing).astype(np.int32)
        place = layout.row_column
        self._row_column = None if place is None else place[self._marker].astype(np.int32)
        self._schema = marker_schema(sensor.length_unit)
        self._file = RowGroupWriter(folder / "markers.parquet", self._schema, use_dictionary=False)
        self._waiting: list[pa.RecordBatch] = []
        self._rows = 0

    def write(self, reading: Reading) -> None:
        """Add the markers of a frame."""
        kept, grid, surface = self._marker, reading.grid, reading.surface
        count = len(kept)
        place = self._row_column
        measured = np.round(np.where(grid.is_seen[:, None], grid.position_px, np.nan)[kept], 4)
        moved = np.round(surface.displacement_mm[kept], 5) + 0.0
        depth_std = np.round(np.sqrt(surface.covariance_mm2[kept, 2, 2]), 5)
        nothing = np.full(count, np.nan)
        columns = [
            np.full(count, reading.frame.index, dtype=np.int32),
            np.full(count, time_s(reading.frame.timestamp_ns)),
            kept,
            nothing if place is None else place[:, 0],
            nothing if place is None else place[:, 1],
            *measured.T,
            grid.is_seen[kept],
            *(moved[:, 0], moved[:, 1], 0.0 - moved[:, 2]),
            depth_std,
        ]
        arrays = [
            arrow_column(column, kind) for column, kind in zip(columns, self._schema.types, strict=True)
        ]
        self._waiting.append(pa.record_batch(arrays, schema=self._schema))
        self._rows += count
        if self._rows >= ROWS_PER_GROUP:
            self._append()

    def close(self) -> None:
        """Complete the file."""
        self._append()
        self._file.close()

    def _append(self) -> None:
        waiting, self._waiting, self._rows = self._waiting, [], 0
        if waiting:
            self._file.append(pa.Table.from_batches(waiting))


def marker_schema(unit: LengthUnit) -> pa.Schema:
    """Types of markers.parquet: float32 resolves 0.0002 px at 4096 px."""
    kinds: dict[str, pa.DataType] = dict.fromkeys(("frame", "marker", "row", "column"), pa.int32())
    kinds |= {"time_s": pa.float64(), "seen": pa.bool_()}
    return pa.schema([(name, kinds.get(name, pa.float32())) for name in marker_column_names(unit)])
