"""Whether the image shows only a part of the sheet, as presses show of an assumed one."""

from itertools import compress

import numpy as np

from manytouch.values import Reading, Sensor
from manytouch.values.sensor_file.assumed_sheet import are_open

SIDES = ("left", "right", "upper", "lower")
"""Of the dots in the image: those with the lower and higher x, and with the lower and higher y."""


class PartOfSheet:
    """Notes the sides at which an assumed sheet goes on beyond the dots."""

    def __init__(self, sensor: Sensor) -> None:
        self._layout = None if sensor.sheet is None or not sensor.sheet.is_assumed else sensor.layout
        self._are_open = np.zeros((2, 2), dtype=np.bool_)

    def add(self, reading: Reading) -> None:
        """Add a frame."""
        spline = reading.surface.spline
        if self._layout is not None and spline is not None:
            self._are_open |= are_open(self._layout, spline.size_mm, spline.centre_mm)

    def warnings(self) -> list[str]:
        """A warning that names these sides."""
        sides = list(compress(SIDES, self._are_open.ravel()))
        if not sides:
            return []
        *others, last = sides
        named = f"{', '.join(others)} and {last} sides" if others else f"{last} side"
        return [
            f"the sheet goes on beyond the {named} of the dots, as presses show: contacts beyond them are "
            "not shown, and near them positions and depths are less certain. Show the whole sheet, or give "
            "--sensor with a file that states it"
        ]
