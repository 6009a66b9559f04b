"""Reading back what `manytouch process` wrote, for the tests."""

import csv
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq


def rows_of(path: Path) -> list[dict[str, str]]:
    """A CSV table as a list of rows; lines that start with # are remarks."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


@dataclass(frozen=True, kw_only=True)
class Tracks:
    """markers.parquet as arrays: frames x markers."""

    number: np.ndarray
    position_px: np.ndarray
    is_seen: np.ndarray
    row: np.ndarray
    column: np.ndarray

    @staticmethod
    def read(folder: Path) -> "Tracks":
        table = pq.read_table(folder / "markers.parquet").to_pydict()
        marker = np.array(table["marker"])
        number, place = np.unique(marker, return_inverse=True)
        frame = np.array(table["frame"])
        shape = (int(frame.max()) + 1, len(number))
        position_px = np.full((*shape, 2), np.nan)
        is_seen = np.zeros(shape, dtype=bool)
        is_seen[frame, place] = table["seen"]
        for axis, name in enumerate(("x_px", "y_px")):
            position_px[frame, place, axis] = np.array(table[name], dtype=float)
        position_px[~is_seen] = np.nan
        row, column = np.full(len(number), -1), np.full(len(number), -1)
        if table["row"][0] is not None:
            row[place], column[place] = table["row"], table["column"]
        return Tracks(number=number, position_px=position_px, is_seen=is_seen, row=row, column=column)

    def swapped(self, before: slice, after: slice, pitch_px: float) -> int:
        """Markers that do not come home: further than half a pitch from where they were, view motion off."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is not seen has no median
            there = np.nanmedian(self.position_px[before], axis=0)
            back = np.nanmedian(self.position_px[after], axis=0)
        moved = back - there
        moved = moved - np.nanmedian(moved, axis=0)
        return int((np.linalg.norm(moved, axis=1) > pitch_px / 2).sum())
