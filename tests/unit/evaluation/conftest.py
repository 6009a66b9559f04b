"""Small records whose right figures are known by hand."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from manytouch.evaluation.evaluated_recordings.evaluated_recording import (
    REGION_COLUMNS,
    ContactRows,
    EvaluatedRecording,
    contact_rows,
)

ROWS, COLUMNS, PITCH_PX, PITCH_MM = 3, 5, 40.0, 4.0


def rows(contacts: Sequence[tuple[float, ...]], **more: Any) -> ContactRows:
    """Contacts as (frame, id, x, y, depth, normal force, shear x, shear y), later ones NaN."""
    names = ("frame", "id", "x", "y", "depth", "normal_force", "shear_x", "shear_y")
    table = np.full((len(contacts), len(names)), np.nan)
    for index, contact in enumerate(contacts):
        table[index, : len(contact)] = contact
    columns = {name: table[:, index] for index, name in enumerate(names)}
    columns["frame"], columns["id"] = columns["frame"].astype(np.int64), columns["id"].astype(np.int64)
    for name in ("x_std", "y_std", "depth_std", "force_std", "shear_x_std", "shear_y_std"):
        columns[name] = np.full(len(contacts), more.get(name, np.nan))
    for name in REGION_COLUMNS:
        if name in more:
            columns[name] = np.full(len(contacts), more[name])
    return contact_rows(columns)


def record(frames: int = 4, contacts: Sequence[tuple[float, ...]] = (), **changed: Any) -> EvaluatedRecording:
    """A sheet of 3 x 5 markers, flat and still; `changed` replaces attributes."""
    row, column = (index.ravel() for index in np.indices((ROWS, COLUMNS)))
    place = np.column_stack([column - (COLUMNS - 1) / 2, row - (ROWS - 1) / 2]).astype(np.float64)
    centre_px = np.tile(100.0 + PITCH_PX * np.column_stack([column, row]), (frames, 1, 1))
    flat = EvaluatedRecording(
        name="press",
        method="",
        unit="mm",
        frame=np.arange(frames),
        status=("ok",) * frames,
        milliseconds=np.full(frames, np.nan),
        marker=np.arange(ROWS * COLUMNS),
        place=PITCH_MM * place,
        place_unit="mm",
        centre_px=centre_px,
        centre_std_px=np.full(centre_px.shape, np.nan),
        depth_mm=np.zeros((frames, ROWS * COLUMNS)),
        depth_std_mm=np.full((frames, ROWS * COLUMNS), np.nan),
        contacts=rows(contacts),
    )
    return replace(flat, **changed)


@pytest.fixture(scope="session")
def contact_table() -> Callable[..., ContactRows]:
    return rows


@pytest.fixture(scope="session")
def sheet() -> Callable[..., EvaluatedRecording]:
    return record
