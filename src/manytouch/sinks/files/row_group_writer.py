"""Writes a Parquet file in row groups, for the sinks and batches that write tables."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.reserved_space import create_binary


class RowGroupWriter:
    """A Parquet file that is open for writing; errors name it. Not a sink: it takes tables, not readings."""

    def __init__(self, path: Path, schema: pa.Schema, *, use_dictionary: bool = True) -> None:
        """Create the file, and its folder if that does not exist.

        Args:
            path: of the file; one that exists is overwritten.
            schema: of all rows.
            use_dictionary: store each value of a column once, and its number in the rows: smaller where
                values are repeated, slower where they are not, as measured numbers.

        Raises:
            OutputError: it cannot be written.
        """
        self._path = path
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = create_binary(path)
            self._writer = pq.ParquetWriter(
                self._file, schema, compression="zstd", use_dictionary=use_dictionary
            )

    def append(self, rows: pa.Table) -> None:
        """Write rows as one group.

        Raises:
            OutputError: they cannot be written.
        """
        with output_errors(self._path):
            self._writer.write_table(rows, row_group_size=max(rows.num_rows, 1))

    def close(self) -> None:
        """Complete the file; a second call does nothing. The file handle is closed even if that fails.

        Raises:
            OutputError: its end cannot be written, so that it cannot be read.
        """
        if not self._file.closed:
            with output_errors(self._path), self._file:
                self._writer.close()
