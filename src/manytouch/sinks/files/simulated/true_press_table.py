"""Known presses of a simulated sensor, as a table that `calibrate sheet` reads."""

import csv
import math
from pathlib import Path

import numpy as np

from manytouch.simulation.scene.motion import HeldPress
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.values import Reading

IMAGES_PER_S = 30.0
NAME, INPUT = "presses.csv", "../frames"
COLUMNS = ("input", "time_s", "x_mm", "y_mm", "radius_mm", "normal_force_N")
"""The columns of `calibration.sheet.press_plan`, which this layer may not import."""


class TruePressTable:
    """A line per press: the place of the body, the radius of its contact area, and the force on it.

    Times are those of the images as a folder of images is read, at 30 frames per second.
    """

    def __init__(self, folder: Path, presses: tuple[HeldPress, ...]) -> None:
        self._path, self._presses = folder / NAME, list(presses)
        self._rows: list[list[object]] = []

    def write(self, reading: Reading) -> None:
        """Add the presses that are held at the time of a reading with the true contacts."""
        now_s = reading.frame.timestamp_ns * 1e-9
        while self._presses and self._presses[0].time_s <= now_s:
            press = self._presses.pop(0)
            place_mm = np.array([press.x_mm, press.y_mm])
            near = min(
                reading.contacts.touching,
                key=lambda one: float(np.linalg.norm(one.centre_mm - place_mm)),
                default=None,
            )
            if near is None:
                continue
            radius_mm = math.sqrt(near.area_mm2 / math.pi)
            time_s = reading.frame.index / IMAGES_PER_S
            values = (time_s, press.x_mm, press.y_mm, radius_mm, -float(near.force_N[2]))
            self._rows.append([INPUT, *(f"{value:.4g}" for value in values)])

    def close(self) -> None:
        """Write the table, if there are presses."""
        if not self._rows:
            return
        with output_errors(self._path), self._path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(COLUMNS)
            writer.writerows(self._rows)
