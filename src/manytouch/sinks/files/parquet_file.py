"""A Parquet file that is written in row groups."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from manytouch.sinks.files.atomic_output import output_errors


class ParquetFile:
    """A Parquet file whose errors name it, and that is released also when the disk is full."""

    def __init__(self, path: Path, schema: pa.Schema, *, use_dictionary: bool = True) -> None:
        self._path = path
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("wb")
            self._writer = pq.ParquetWriter(
                self._file, schema, compression="zstd", use_dictionary=use_dictionary
            )

    def append(self, rows: pa.Table) -> None:
        """Write rows as one group."""
        with output_errors(self._path):
            self._writer.write_table(rows, row_group_size=max(rows.num_rows, 1))

    def close(self) -> None:
        """Complete the file; a second call does nothing."""
        if not self._file.closed:
            with output_errors(self._path), self._file:
                self._writer.close()
