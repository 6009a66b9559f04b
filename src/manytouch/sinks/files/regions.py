"""Table of the regions of contacts."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from manytouch.sinks.files.arrow_columns import arrow_column, point_lists
from manytouch.sinks.files.row_group_writer import RowGroupWriter
from manytouch.values import LengthUnit, Reading, Sensor

ROWS_PER_GROUP = 8192


def region_schema(unit: LengthUnit) -> pa.Schema:
    """Types of regions.parquet; the unit of the outline is in the metadata of its column."""
    kinds: dict[str, pa.DataType] = {
        "frame": pa.int32(),
        "contact": pa.int32(),
        "ring": pa.int32(),
        "is_hole": pa.bool_(),
    }
    outline = pa.field("outline", pa.list_(pa.list_(pa.float32(), 2)), metadata={"unit": unit})
    return pa.schema(kinds).append(outline)


class RegionTable:
    """regions.parquet: one line per ring of the outline of each touching contact per frame.

    `ring` counts the rings of a contact from 0. Contacts whose region is unknown have no line. Rows are
    gathered and appended as row groups, so memory does not grow with the recording.
    """

    def __init__(self, folder: Path, sensor: Sensor) -> None:
        self._schema = region_schema(sensor.length_unit)
        self._file = RowGroupWriter(folder / "regions.parquet", self._schema)
        self._waiting: list[tuple[int, int, int, bool]] = []
        self._outlines: list[np.ndarray] = []

    def write(self, reading: Reading) -> None:
        """Add the regions of a frame."""
        for contact in reading.contacts.touching:
            for number, ring in enumerate(contact.outline or ()):
                self._waiting.append((reading.frame.index, contact.id, number, ring.is_hole))
                self._outlines.append(np.round(ring.point_mm, 4))
        if len(self._waiting) >= ROWS_PER_GROUP:
            self._append()

    def close(self) -> None:
        """Complete the file."""
        self._append()
        self._file.close()

    def _append(self) -> None:
        waiting, self._waiting = self._waiting, []
        outlines, self._outlines = self._outlines, []
        if waiting:
            columns = np.array(waiting).T
            arrays = [
                arrow_column(column, kind) for column, kind in zip(columns, self._schema.types, strict=False)
            ]
            arrays.append(point_lists(outlines))
            self._file.append(pa.Table.from_arrays(arrays, schema=self._schema))
