"""Tables of contacts, markers and frames.

An empty cell means that a value is unknown; it is never 0 by default.
"""

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from manytouch.sinks.files.atomic_output import AtomicOutput, output_errors
from manytouch.sinks.files.sensor_description import layout_of
from manytouch.values import Contact, LengthUnit, Reading, Sensor

ROWS_PER_GROUP = 65536


def contact_columns(unit: LengthUnit) -> tuple[str, ...]:
    """Columns of contacts.csv; forces keep their names in pitch units and stay empty."""
    return (
        *("frame", "time_s", "contact", "phase"),
        *(f"x_{unit}", f"y_{unit}", f"depth_{unit}", "normal_force_N", "shear_x_N", "shear_y_N"),
        *(f"area_{unit}2", f"x_std_{unit}", f"y_std_{unit}", "force_std_N", "x_px", "y_px"),
        *(f"depth_std_{unit}", f"normal_force_over_E_{unit}2", "shear_x_std_N", "shear_y_std_N"),
        *("torque_Nmm", "torque_std_Nmm", f"area_std_{unit}2", "slip"),
    )


def marker_columns(unit: LengthUnit) -> tuple[str, ...]:
    """Columns of markers.parquet."""
    return (
        *("frame", "time_s", "marker", "row", "column", "x_px", "y_px", "seen"),
        *(f"dx_{unit}", f"dy_{unit}", f"depth_{unit}", f"depth_std_{unit}"),
    )


FRAME_COLUMNS = ("frame", "time_s", "status", "markers_seen", "contacts", "milliseconds")


def time_s(timestamp_ns: int) -> float:
    """Seconds since the source's start."""
    return timestamp_ns * 1e-9


def fixed_point(value: float, decimals: int) -> str:
    """Fixed precision; empty when not known, and no minus sign on a zero."""
    if not math.isfinite(value):
        return ""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


class _CsvTable:
    """A CSV file that appears when it is complete."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self._output = AtomicOutput(path)
        with output_errors(path):
            self._file = self._output.temporary_path.open("w", newline="", encoding="utf-8")
            self._writer = csv.writer(self._file, lineterminator="\n")
            self._writer.writerow(columns)

    def add(self, rows: Iterable[Sequence[object]]) -> None:
        with output_errors(self._output.path):
            self._writer.writerows(rows)

    def close(self) -> None:
        with output_errors(self._output.path):
            self._file.close()
        self._output.commit()


class ContactTable:
    """contacts.csv: one line per contact per frame."""

    def __init__(self, folder: Path, sensor: Sensor) -> None:
        self._table = _CsvTable(folder / "contacts.csv", contact_columns(sensor.length_unit))

    def write(self, reading: Reading) -> None:
        """Add the contacts of a frame, those that just ended too."""
        self._table.add(self._row(reading, contact) for contact in reading.contacts.contacts)

    def close(self) -> None:
        """Complete the file."""
        self._table.close()

    def _row(self, reading: Reading, contact: Contact) -> list[object]:
        normal_force_N = -float(contact.force_N[2])
        return [
            *(reading.frame.index, fixed_point(time_s(reading.frame.timestamp_ns), 6)),
            *(contact.id, contact.phase.value),
            *(fixed_point(float(value), 4) for value in contact.centre_mm),
            *(fixed_point(contact.depth_mm, 4), fixed_point(normal_force_N, 4)),
            *(fixed_point(float(value), 4) for value in contact.force_N[:2]),
            fixed_point(contact.area_mm2, 4),
            *(fixed_point(contact.std(name), 4) for name in ("x", "y", "normal_force")),
            *(fixed_point(float(value), 2) for value in contact.centre_px),
            *(fixed_point(contact.std("depth"), 4), fixed_point(contact.normal_force_over_E_mm2, 5)),
            *(fixed_point(contact.std(name), 4) for name in ("shear_x", "shear_y")),
            *(fixed_point(contact.torque_Nmm, 4), fixed_point(contact.std("torque"), 4)),
            fixed_point(contact.std("area"), 4),
            "" if contact.slip is None else int(contact.slip),
        ]


class FrameTable:
    """frames.csv: one line per frame, also for those that failed."""

    def __init__(self, folder: Path) -> None:
        self._table = _CsvTable(folder / "frames.csv", FRAME_COLUMNS)

    def write(self, reading: Reading) -> None:
        """Add a frame."""
        row = (
            reading.frame.index,
            fixed_point(time_s(reading.frame.timestamp_ns), 6),
            reading.status,
            int(reading.grid.is_seen.sum()),
            len(reading.contacts.touching),
            fixed_point(reading.milliseconds, 3),
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
        self._output = AtomicOutput(folder / "markers.parquet")
        with output_errors(self._output.path):
            self._file = pq.ParquetWriter(
                self._output.temporary_path, self._schema, compression="zstd", use_dictionary=False
            )
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
        nothing = pa.nulls(count, pa.int32())
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
            pa.array(column, type=kind, from_pandas=True)
            for column, kind in zip(columns, self._schema.types, strict=True)
        ]
        self._waiting.append(pa.record_batch(arrays, schema=self._schema))
        self._rows += count
        if self._rows >= ROWS_PER_GROUP:
            self._append()

    def close(self) -> None:
        """Complete the file."""
        self._append()
        with output_errors(self._output.path):
            self._file.close()
        self._output.commit()

    def _append(self) -> None:
        if self._waiting:
            with output_errors(self._output.path):
                self._file.write_table(pa.Table.from_batches(self._waiting), row_group_size=self._rows)
        self._waiting, self._rows = [], 0


def marker_schema(unit: LengthUnit) -> pa.Schema:
    """Types of markers.parquet: float32 holds 0.0002 px at 4096 px."""
    kinds: dict[str, pa.DataType] = dict.fromkeys(("frame", "marker", "row", "column"), pa.int32())
    kinds |= {"time_s": pa.float64(), "seen": pa.bool_()}
    return pa.schema([(name, kinds.get(name, pa.float32())) for name in marker_columns(unit)])
