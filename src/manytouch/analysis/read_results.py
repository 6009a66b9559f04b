"""The tables of a result folder in memory."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from manytouch.errors import SourceError, require_type
from manytouch.sinks.files.regions import region_schema
from manytouch.sinks.files.tables import FRAME_COLUMNS, contact_column_names
from manytouch.values import LengthUnit
from manytouch.values.display.html import facts_table

INTEGERS = ("frame", "contact", "markers_seen", "contacts", "lost_ids", "new_ids")
TEXTS = ("phase", "shape", "status", "method")
TRACKPY = {"frame": "frame", "marker": "particle", "x_px": "x", "y_px": "y"}
"""Columns of markers.parquet and their names in trackpy."""
REQUIRED_CONTACT_COLUMNS = 16
"""First columns of contacts.csv, which every version writes; older results have no others."""
REQUIRED_FRAME_COLUMNS = 6
"""First columns of frames.csv, which every version writes."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Results:
    """What `manytouch process` wrote; `.to_pandas()` of a table gives a pandas data frame.

    Attributes:
        folder: where it was read from.
        contacts: contacts.csv, one row per contact and frame; null where a value is not known.
        markers: markers.parquet, one row per marker and frame.
        frames: frames.csv, one row per frame.
        regions: regions.parquet, one row per ring of the outline of a contact and frame; empty where the
            folder has none, as of an older version.
        summary: summary.json.
        unit: of lengths: "mm", or "pitch" if the scale was not known; columns end in it.
    """

    folder: Path
    contacts: pa.Table
    markers: pa.Table
    frames: pa.Table
    regions: pa.Table
    summary: dict[str, Any]
    unit: LengthUnit

    def trackpy(self) -> pa.Table:
        """The markers that were seen, in trackpy's columns: frame, particle, x, y (px)."""
        seen = self.markers.filter(self.markers["seen"])
        return seen.select(list(TRACKPY)).rename_columns(list(TRACKPY.values()))

    def __repr__(self) -> str:
        return (
            f"Results({fspath(self.folder)!r}, {len(self.frames)} frames, "
            f"{len(set(self.contacts['contact'].to_pylist()))} contacts, lengths in {self.unit})"
        )

    def _repr_html_(self) -> str:
        tables = {name: getattr(self, name) for name in ("contacts", "markers", "frames", "regions")}
        rows = [
            (name, f"{len(table)} rows: {', '.join(table.column_names)}") for name, table in tables.items()
        ]
        return facts_table(f"Results of {fspath(self.folder)}", rows)


def read_results(folder: str | PathLike[str]) -> Results:
    """Read what `manytouch process` wrote into the folder of one input.

    Args:
        folder: that contains contacts.csv, markers.parquet, frames.csv and summary.json.

    Raises:
        SourceError: a file is missing, except regions.parquet, or damaged.
    """
    require_type("the folder of results", folder, (str, PathLike), "a path, such as 'results/press'")
    path = Path(folder)
    if not path.is_dir():
        raise SourceError(f"there is no folder {fspath(folder)!r}: give one that manytouch process wrote")
    if not (path / "contacts.csv").is_file():
        inside = sorted(each.parent.name for each in path.glob("*/contacts.csv"))
        hint = f": give one of its folders, such as {fspath(path / inside[0])!r}" if inside else ""
        raise SourceError(
            f"the folder {fspath(folder)!r} has no contacts.csv{hint or ', which manytouch process writes'}"
        )
    contacts = _csv(path / "contacts.csv")
    unit: LengthUnit = "mm" if "depth_mm" in contacts.column_names else "pitch"
    _require_columns(contacts, contact_column_names(unit)[:REQUIRED_CONTACT_COLUMNS], path / "contacts.csv")
    frames = _csv(path / "frames.csv")
    _require_columns(frames, FRAME_COLUMNS[:REQUIRED_FRAME_COLUMNS], path / "frames.csv")
    markers = _parquet(path / "markers.parquet")
    _require_columns(markers, (*TRACKPY, "seen", f"depth_{unit}"), path / "markers.parquet")
    return Results(
        folder=path,
        contacts=contacts,
        markers=markers,
        frames=frames,
        regions=_regions(path / "regions.parquet", unit),
        summary=_summary(path / "summary.json"),
        unit=unit,
    )


def _csv(path: Path) -> pa.Table:
    kinds: dict[str, pa.DataType] = dict.fromkeys(INTEGERS, pa.int64())
    kinds |= dict.fromkeys(TEXTS, pa.string())
    try:
        with path.open(encoding="utf-8") as file:
            names = file.readline().strip().split(",")
        options = pa.csv.ConvertOptions(
            column_types={name: kinds.get(name, pa.float64()) for name in names} | {"slip": pa.bool_()},
            strings_can_be_null=True,
            null_values=[""],
        )
        return pa.csv.read_csv(path, convert_options=options)
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        raise SourceError(_unreadable(path, error)) from error


def _parquet(path: Path) -> pa.Table:
    try:
        return pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise SourceError(_unreadable(path, error)) from error


def _regions(path: Path, unit: LengthUnit) -> pa.Table:
    empty = region_schema(unit).empty_table()
    if not path.exists():
        return empty
    table = _parquet(path)
    _require_columns(table, empty.column_names, path)
    return table


def _summary(path: Path) -> dict[str, Any]:
    try:
        contents = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SourceError(_unreadable(path, error)) from error
    if not isinstance(contents, dict):
        raise SourceError(_unreadable(path, "not an object"))
    return contents


def _require_columns(table: pa.Table, names: Sequence[str], path: Path) -> None:
    if missing := [name for name in names if name not in table.column_names]:
        raise SourceError(_unreadable(path, f"it lacks {', '.join(missing)}"))


def _unreadable(path: Path, reason: object) -> str:
    first = (str(reason).splitlines() or ["damaged"])[0]
    return f"{path} cannot be read ({first}): process the input again"
