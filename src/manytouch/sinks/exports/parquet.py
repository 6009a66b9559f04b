"""Everything that a recording contains except its images, as Parquet tables.

The columns are those of `manytouch process` (docs/columns.md); the metadata of each column has its unit and
frame of reference, and that of the table the sensor file.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pc
import pyarrow.parquet as pq

from manytouch.recording.reader import Recording
from manytouch.sinks.exports.readings import readings_of
from manytouch.sinks.files.regions import RegionTable
from manytouch.sinks.files.sensor_description import plain_values
from manytouch.sinks.files.tables import ContactTable, FrameTable, MarkerTable
from manytouch.values import Sensor

UNITS = ("mm2", "pitch2", "Nmm", "mm", "pitch", "px", "rad", "N", "s")
TEXTS = ("phase", "shape", "status", "method")
INTEGERS = ("frame", "contact", "slip", "markers_seen", "contacts", "lost_ids", "new_ids")
NUMBERS = ("shape_probability", "milliseconds")


def write_parquet(recordings: Sequence[Recording], folder: Path) -> None:
    """Write contacts, markers, regions and frames of one recording into a folder."""
    (recording,) = recordings
    folder.mkdir(parents=True)
    for name, table in tables(recording, folder):
        pq.write_table(table, folder / f"{name}.parquet", compression="zstd")


def tables(recording: Recording, scratch: Path) -> Iterator[tuple[str, pa.Table]]:
    """The tables of a recording by name, with units in the metadata; `scratch` is a folder for them."""
    sensor = recording.sensor
    writers = (
        ContactTable(scratch, sensor),
        FrameTable(scratch, recording.method),
        MarkerTable(scratch, sensor),
        RegionTable(scratch, sensor),
    )
    for reading in readings_of(recording):
        for writer in writers:
            writer.write(reading)
    for writer in writers:
        writer.close()
    about = _about(recording)
    for name in ("contacts", "frames"):
        path = scratch / f"{name}.csv"
        kinds = pc.ConvertOptions(
            column_types={
                **dict.fromkeys(TEXTS, pa.string()),
                **dict.fromkeys(INTEGERS, pa.int64()),
                **dict.fromkeys(NUMBERS, pa.float64()),
                **{
                    column: pa.float64()
                    for column in path.read_text().partition("\n")[0].split(",")
                    if unit_of(column)
                },
            },
            strings_can_be_null=True,
        )
        table = pc.read_csv(path, convert_options=kinds)
        path.unlink()
        yield name, described(table, about)
    for name in ("markers", "regions"):
        path = scratch / f"{name}.parquet"
        table = pq.read_table(path)
        path.unlink()
        yield name, described(table, about)


def described(table: pa.Table, about: dict[bytes | str, bytes | str]) -> pa.Table:
    """The table with unit and frame of reference in the metadata of its columns."""
    columns = []
    for column in table.schema:
        found = attributes_of(column.name)
        columns.append(column.with_metadata(found) if found else column)
    return table.cast(pa.schema(columns, metadata=about))


def attributes_of(column: str) -> dict[bytes | str, bytes | str]:
    """Unit and frame of reference of a column, by its name."""
    unit = unit_of(column)
    if unit is None:
        return {"unit": "ms"} if column == "milliseconds" else {}
    place = {"px": "image", "s": "time since the start"}.get(unit, "sheet")
    return {"unit": unit, "frame": place}


def unit_of(column: str) -> str | None:
    """The unit at the end of a name; None if there is none."""
    return next((unit for unit in UNITS if column.endswith(f"_{unit}")), None)


def _about(recording: Recording) -> dict[bytes | str, bytes | str]:
    return {
        "manytouch": json.dumps(description(recording.sensor, recording.about)),
    }


def description(sensor: Sensor, about: dict[str, Any]) -> dict[str, Any]:
    """What made a recording: sensor, method, parameters, versions; which values are nominal or assumed."""
    return {
        "sensor": sensor.name,
        "length_unit": sensor.length_unit,
        "assumptions": list(sensor.assumptions),
        "nominal": _nominal(sensor),
        "sheet_std": _sheet_std(sensor),
        "provenance": plain_values(sensor.provenance),
        **{name: about[name] for name in ("method", "parameters", "versions", "source") if name in about},
        "started_unix_ns": about.get("started_unix_ns"),
    }


def _nominal(sensor: Sensor) -> list[str]:
    """Sections and keys of the sensor file that state a kind of sensor, and not this one."""
    if sensor.is_nominal:
        return ["camera", "sheet", "markers"]
    return ["sheet.size_mm", "sheet.thickness_mm"] if sensor.shape_is_nominal else []


def _sheet_std(sensor: Sensor) -> dict[str, float]:
    """Standard deviations of the sheet's values, as far as the sensor file states them."""
    if sensor.sheet is None:
        return {}
    return {
        name: value for name, value in asdict(sensor.sheet).items() if "_std" in name and value is not None
    }
