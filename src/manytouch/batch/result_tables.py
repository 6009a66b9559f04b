"""results.parquet, a line per input, and contacts.parquet, all contacts: rebuilt from the result folders."""

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from manytouch.batch.completion import parse_summary
from manytouch.batch.storage import SUMMARY, Store
from manytouch.batch.tasks import Outcome
from manytouch.errors import OutputError, without_password
from manytouch.sinks.files.row_group_writer import RowGroupWriter
from manytouch.sinks.files.tables import contact_column_names

ROWS_PER_GROUP = 65536
LINES_PER_GROUP = 4096
_LINE: dict[str, pa.DataType] = {
    **dict.fromkeys(("name", "input", "state", "failure", "method", "sensor", "unit"), pa.string()),
    **dict.fromkeys(("frames", "frames_ok", "frames_with_contact", "contacts"), pa.int64()),
    **dict.fromkeys(("contacts_at_once", "markers", "width_px", "height_px"), pa.int64()),
    **dict.fromkeys(("fps", "milliseconds_p50", "milliseconds_p99", "noise_px"), pa.float64()),
    **dict.fromkeys(("hash", "input_hash", "sensor_hash", "parameters_hash", "version"), pa.string()),
    "warnings": pa.list_(pa.string()),
}
RESULTS = pa.schema(_LINE)
_KINDS: dict[str, pa.DataType] = {
    **dict.fromkeys(("frame", "contact"), pa.int32()),
    **dict.fromkeys(("phase", "shape"), pa.string()),
    "slip": pa.int8(),
}


def contacts_schema(units: Iterable[str]) -> pa.Schema:
    """Columns of contacts.parquet: name of the result, unit, and those of contacts.csv in each unit."""
    names = dict.fromkeys(
        column for unit in ("mm", "pitch") if unit in set(units) for column in contact_column_names(unit)
    )
    columns = [(name, _KINDS.get(name, pa.float64())) for name in names]
    return pa.schema([("name", pa.string()), ("unit", pa.string()), *columns])


def write_result_tables(
    store: Store, names: Sequence[str], failed: Mapping[str, Outcome], results: str, contacts: str
) -> int:
    """Write both tables from the result folders; each replaces the table of that name, if there is one.

    Args:
        store: of the result folders.
        names: of the folders; those without a result are left out, unless they are in `failed`.
        failed: failures by name.
        results, contacts: names of the tables.

    Returns:
        The number of complete results.

    Raises:
        OutputError: a table cannot be written, or a contacts.csv cannot be read.
    """
    units: dict[str, str] = {}
    complete = 0
    with store.new_file(results) as path:
        table = RowGroupWriter(path, RESULTS)
        lines: list[dict[str, Any]] = []
        for name in sorted({*names, *failed}):
            summary = parse_summary(store.read(f"{name}/{SUMMARY}"))
            if summary is None and name not in failed:
                continue
            line = _line(name, summary, failed.get(name))
            lines.append(line)
            complete += line["state"] == "complete"
            if line["unit"] is not None:
                units[name] = line["unit"]
            if len(lines) >= LINES_PER_GROUP:
                table.append(pa.Table.from_pylist(lines, schema=RESULTS))
                lines = []
        table.append(pa.Table.from_pylist(lines, schema=RESULTS))
        table.close()
    schema = contacts_schema(units.values() or ("mm",))
    with store.new_file(contacts) as path:
        _write_groups(path, schema, (_contacts(store, name, unit, schema) for name, unit in units.items()))
    return complete


def merge_result_tables(store: Store, parts: Sequence[tuple[str, str]], results: str, contacts: str) -> None:
    """Join the pairs of tables of shards.

    Args:
        store: of the tables.
        parts: names of the pairs.
        results, contacts: names of the joined tables.

    Raises:
        OutputError: a table of a shard is no longer there, or a joined table cannot be written.
    """
    with store.new_file(results) as path:
        _write_groups(path, RESULTS, (table for part, _ in parts for table in _groups(store, part)))
    schemas = [_opened(store, part).schema_arrow for _, part in parts]
    units = [unit for unit in ("mm", "pitch") if any(f"x_{unit}" in schema.names for schema in schemas)]
    schema = contacts_schema(units)
    with store.new_file(contacts) as path:
        tables = (table for _, part in parts for table in _groups(store, part))
        _write_groups(path, schema, (_with_columns(table, schema) for table in tables))


def _line(name: str, summary: Mapping[str, Any] | None, failed: Outcome | None) -> dict[str, Any]:
    """A line of results.parquet."""
    found: dict[str, Any] = dict.fromkeys(RESULTS.names)
    found |= {"name": name, "state": "absent", "failure": None if failed is None else failed.reason}
    if failed is not None:
        found["input"] = without_password(failed.task.input)
    if summary is None:
        return found
    described, sensor, counts = (_mapping(summary, key) for key in ("input", "sensor", "counts"))
    hashes, latency, noise = (_mapping(summary, key) for key in ("hashes", "milliseconds", "noise_px"))
    found |= {name: counts.get(name) for name in counts if name in found}
    found |= {name: described.get(name) for name in ("width_px", "height_px", "fps")}
    return found | {
        "input": found["input"] or described.get("source"),
        "state": "complete" if summary.get("complete") is True else "incomplete",
        "method": summary.get("method"),
        "sensor": sensor.get("name"),
        "unit": sensor.get("unit"),
        "frames_ok": _mapping(counts, "status").get("ok", 0),
        "milliseconds_p50": latency.get("p50"),
        "milliseconds_p99": latency.get("p99"),
        "noise_px": noise.get("median"),
        "hash": summary.get("hash"),
        **{f"{part}_hash": hashes.get(part) for part in ("input", "sensor", "parameters")},
        "version": hashes.get("version"),
        "warnings": summary.get("warnings", summary.get("odd")),  # results before 0.2 have only the latter
    }


def _mapping(found: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = found.get(key)
    return value if isinstance(value, dict) else {}


def _contacts(store: Store, name: str, unit: str, schema: pa.Schema) -> pa.Table:
    """The contacts of one result."""
    content = store.read(f"{name}/contacts.csv")
    if not content:
        return schema.empty_table()
    options = pa_csv.ConvertOptions(
        column_types=dict(zip(schema.names, schema.types, strict=True)),
        strings_can_be_null=True,
    )
    try:
        found = pa_csv.read_csv(io.BytesIO(content), convert_options=options)
    except pa.ArrowInvalid as error:
        raise OutputError(
            f"{name}/contacts.csv cannot be read ({error}): remove the folder {name} and run the batch again"
        ) from error
    count = found.num_rows
    found = found.append_column("name", pa.array([name] * count, pa.string()))
    return _with_columns(found.append_column("unit", pa.array([unit] * count, pa.string())), schema)


def _with_columns(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """The table with all columns of a schema; those that it lacks are null."""
    columns = [
        table.column(field.name).cast(field.type)
        if field.name in table.column_names
        else pa.nulls(table.num_rows, field.type)
        for field in schema
    ]
    return pa.Table.from_arrays(columns, schema=schema)


def _opened(store: Store, name: str) -> pq.ParquetFile:
    content = store.read(name)
    if content is None:
        raise OutputError(f"{name} has vanished while the shards were merged: run the merge again")
    return pq.ParquetFile(pa.BufferReader(content))


def _groups(store: Store, name: str) -> Iterator[pa.Table]:
    file = _opened(store, name)
    for number in range(file.num_row_groups):
        yield file.read_row_group(number)


def _write_groups(path: Path, schema: pa.Schema, tables: Iterable[pa.Table]) -> None:
    """Write tables one after the other, in row groups of a useful size."""
    file = RowGroupWriter(path, schema)
    waiting: list[pa.Table] = []
    rows = 0
    for table in tables:
        if table.num_rows:
            waiting.append(table)
            rows += table.num_rows
        if rows >= ROWS_PER_GROUP:
            file.append(pa.concat_tables(waiting).combine_chunks())
            waiting, rows = [], 0
    file.append(pa.concat_tables([schema.empty_table(), *waiting]).combine_chunks())
    file.close()
