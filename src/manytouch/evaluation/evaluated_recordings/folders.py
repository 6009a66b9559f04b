"""Results and truth from the files of their folders."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from manytouch.evaluation.evaluated_recordings.evaluated_recording import (
    ContactRows,
    EvaluatedRecording,
    EvaluationError,
    contact_rows,
    display_name,
)
from manytouch.values import LengthUnit
from manytouch.values.arrays import read_only

LENGTHS = ("x", "y", "depth", "x_std", "y_std", "depth_std")
FORCES = ("normal_force_N", "shear_x_N", "shear_y_N", "force_std_N", "shear_x_std_N", "shear_y_std_N")
REGIONS = {
    "torque": "torque_Nmm",
    "torque_std": "torque_std_Nmm",
    "area": "area_{unit}2",
    "area_std": "area_std_{unit}2",
    "half_major": "half_major_{unit}",
    "half_minor": "half_minor_{unit}",
    "orientation": "orientation_rad",
}
"""Columns of torque and region by the name of their value; they may be absent."""
LATER = ("depth_std", "shear_x_std_N", "shear_y_std_N")  # may be absent from tables written by others


def load_result(folder: Path) -> EvaluatedRecording:
    """What `manytouch process` wrote: contacts.csv, markers.parquet, frames.csv, summary.json.

    Raises:
        EvaluationError: a file is missing or is not what it should be.
    """
    summary = _summary(folder)
    return _load(folder, f"the result {folder}", method=str(summary.get("method") or "result"))


def load_truth(folder: Path) -> EvaluatedRecording:
    """What `manytouch simulate` wrote into truth/: contacts.csv and markers.parquet.

    Raises:
        EvaluationError: a file is missing or is not what it should be.
    """
    return _load(folder, f"the truth {folder}", method="")


def details(folder: Path) -> dict[str, Any]:
    """Parameters, versions, assumptions and sensor of summary.json, where there is one."""
    summary = _summary(folder)
    names = ("method", "parameters", "versions", "assumptions", "sensor", "input")
    return {name: summary[name] for name in names if name in summary}


def _load(folder: Path, what: str, *, method: str) -> EvaluatedRecording:
    if not folder.is_dir():
        raise EvaluationError(f"{what} is not a folder; give one with contacts.csv and markers.parquet")
    table = _markers(folder / "markers.parquet", what)
    unit = _unit(table.column_names, what)
    contacts, contact_unit = _contacts(folder / "contacts.csv", what)
    if contact_unit != unit:
        raise EvaluationError(
            f"{what} has contacts in {contact_unit} and markers in {unit}; write both files in one run"
        )
    column = {name: table[name].to_numpy() for name in table.column_names}
    frames = _frames(folder / "frames.csv")
    number = np.unique(np.concatenate([column["frame"].astype(np.int64), contacts.frame, frames["frame"]]))
    marker, which = np.unique(column["marker"].astype(np.int64), return_inverse=True)
    place_in = (np.searchsorted(number, column["frame"]), which)

    def dense(name: str) -> np.ndarray:
        values = np.full((len(number), len(marker)), np.nan)
        values[place_in] = column[name].astype(np.float64)
        return values

    seen = dense("seen") > 0
    centre_px = np.where(seen[..., None], np.stack([dense("x_px"), dense("y_px")], axis=-1), np.nan)
    place, place_unit = _places(dense("row"), dense("column"), centre_px)
    status = dict(zip(frames["frame"].tolist(), frames["status"].tolist(), strict=True))
    milliseconds = np.full(len(number), np.nan)
    milliseconds[np.searchsorted(number, frames["frame"])] = frames["milliseconds"]
    return EvaluatedRecording(
        name=display_name(folder),
        method=method,
        unit=unit,
        frame=read_only(number),
        status=tuple(str(status.get(index, "ok")) for index in number.tolist()),
        milliseconds=read_only(milliseconds),
        marker=read_only(marker),
        place=read_only(place),
        place_unit=place_unit,
        centre_px=read_only(centre_px),
        centre_std_px=read_only(np.full(centre_px.shape, np.nan)),
        depth_mm=read_only(dense(f"depth_{unit}")),
        depth_std_mm=read_only(dense(f"depth_std_{unit}")),
        contacts=contacts,
    )


def _markers(path: Path, what: str) -> pa.Table:
    _require(path, what)
    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise EvaluationError(
            f"{path} cannot be read as Parquet ({str(error).splitlines()[0]}); regenerate it"
        ) from error
    _check_columns(
        table.column_names, ("frame", "marker", "row", "column", "x_px", "y_px", "seen"), path, table.num_rows
    )
    unit = _unit(table.column_names, what)
    _check_columns(table.column_names, (f"depth_{unit}", f"depth_std_{unit}"), path, table.num_rows)
    return table


def _contacts(path: Path, what: str) -> tuple[ContactRows, LengthUnit]:
    header, lines = _csv(path, what)
    unit = _unit(header, what)
    needed = ("frame", "contact", "phase", *(f"{name}_{unit}" for name in LENGTHS), *FORCES)
    _check_columns(
        header, tuple(n for n in needed if n.removesuffix(f"_{unit}") not in LATER), path, len(lines)
    )
    regions = {name: column.format(unit=unit) for name, column in REGIONS.items()}
    wanted = (*needed, *regions.values())
    place = {name: index for index, name in enumerate(header)}
    touching = [line for line in lines if line[place["phase"]] != "end"]
    try:
        columns = {
            name: np.array(
                [float(line[place[name]] or "nan") if name in place else np.nan for line in touching]
            )
            for name in wanted
            if name != "phase"
        }
        rows = contact_rows(
            {
                "id": columns["contact"].astype(np.int64),
                "frame": columns["frame"].astype(np.int64),
                **{name: columns[f"{name}_{unit}"] for name in LENGTHS},
                **{name.removesuffix("_N"): columns[name] for name in FORCES},
                **{name: columns[column] for name, column in regions.items()},
            }
        )
    except (ValueError, IndexError) as error:
        raise EvaluationError(
            f"{path} contains a value that is not a number ({error}); regenerate it"
        ) from error
    return rows, unit


def _frames(path: Path) -> dict[str, np.ndarray]:
    """frames.csv, or no rows where there is none."""
    empty = {
        "frame": np.zeros(0, np.int64),
        "status": np.zeros(0, dtype=np.str_),
        "milliseconds": np.zeros(0),
    }
    if not path.is_file():
        return empty
    header, lines = _csv(path, "")
    _check_columns(header, ("frame", "status", "milliseconds"), path, len(lines))
    place = {name: index for index, name in enumerate(header)}
    try:
        return {
            "frame": np.array([int(line[place["frame"]]) for line in lines], dtype=np.int64),
            "status": np.array([line[place["status"]] for line in lines], dtype=np.str_),
            "milliseconds": np.array([float(line[place["milliseconds"]] or "nan") for line in lines]),
        }
    except (ValueError, IndexError) as error:
        raise EvaluationError(
            f"{path} contains a value that is not a number ({error}); regenerate it"
        ) from error


def _csv(path: Path, what: str) -> tuple[list[str], list[list[str]]]:
    _require(path, what)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise EvaluationError(f"{path} cannot be read as a table ({error}); regenerate it") from error
    if not lines:
        raise EvaluationError(f"{path} is empty, without even a header; regenerate it")
    return lines[0], lines[1:]


def _summary(folder: Path) -> dict[str, Any]:
    path = folder / "summary.json"
    if not path.is_file():
        return {}
    try:
        contents = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise EvaluationError(f"{path} cannot be read as JSON ({error}); process the input again") from error
    return contents if isinstance(contents, dict) else {}


def _require(path: Path, what: str) -> None:
    if not path.is_file():
        raise EvaluationError(
            f"{what} has no {path.name}; give a folder that manytouch process or manytouch simulate wrote"
        )


def _check_columns(found: Sequence[str], wanted: Sequence[str], path: Path, rows: int) -> None:
    missing = [name for name in wanted if name not in found]
    if missing:
        raise EvaluationError(
            f"{path} ({rows} rows) lacks the columns {', '.join(missing)}; "
            "write it with manytouch process or manytouch simulate"
        )


def _unit(columns: Sequence[str], what: str) -> LengthUnit:
    if "depth_mm" in columns:
        return "mm"
    if "depth_pitch" in columns:
        return "pitch"
    raise EvaluationError(f"{what} has neither a column depth_mm nor depth_pitch, so its unit is not known")


def _places(row: np.ndarray, column: np.ndarray, centre_px: np.ndarray) -> tuple[np.ndarray, str]:
    """Places of the markers at rest: columns and rows, or where they are first seen."""
    if row.size and np.isfinite(row).any(axis=0).all():
        return np.column_stack([np.nanmax(column, axis=0), np.nanmax(row, axis=0)]), "column"
    is_seen = np.isfinite(centre_px).all(axis=2)
    first = np.argmax(is_seen, axis=0)
    place = centre_px[first, np.arange(centre_px.shape[1])]
    return np.where(is_seen.any(axis=0)[:, None], place, np.nan), "px"
