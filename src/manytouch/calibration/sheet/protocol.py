"""What to press, where and how hard, to calibrate a sheet: with plain weights, or with a 3-D printer."""

import csv
import io

import numpy as np

from manytouch.errors import SensorError
from manytouch.values import Sensor
from manytouch.values.arrays import Points2

WEIGHTS_G = (50, 100, 200)
GRAVITY_M_PER_S2 = 9.81
RIM_SHARE = 0.25
SAFE_MM = 15.0
FEED_MM_PER_MIN = 600
DWELL_MS = 2000
DEPTHS_MM = (1.0, 2.5)
TIP_RADIUS_MM = 8.0
"""Of the round tip that presses: a flat foot rests on its edge wherever the sheet slopes (decision 21)."""
TOUCHED_RADIUS_MM = 2.0
"""About what touches under such a tip."""


def places_mm(sensor: Sensor) -> Points2:
    """(5, 2) the middle and the middles of the four quarters, away from the clamp.

    Raises:
        SensorError: the sheet's size is not known.
    """
    if sensor.sheet is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no [sheet]: write its size_mm and thickness_mm into the file "
            "first"
        )
    x, y = RIM_SHARE * np.asarray(sensor.sheet.size_mm)
    return np.round(np.array([[0.0, 0.0], [-x, -y], [x, -y], [-x, y], [x, y]]), 1)


def weight_table(sensor: Sensor) -> str:
    """A table of presses for weights of 50, 100 and 200 g on a round tip, to be filled with times."""
    table = io.StringIO()
    table.write(
        f"# Glue a ball of {2 * TIP_RADIUS_MM:g} mm under a cup, 50 g together; only the ball shall touch.\n"
        "# Stand it at each place for a second, 50, 100 or 200 g in all, without pressing; note when.\n"
        "# All in one recording that begins with two untouched seconds.\n"
    )
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["input", "time_s", "x_mm", "y_mm", "radius_mm", "normal_force_N"])
    for number, (x, y) in enumerate(places_mm(sensor).tolist()):
        grams = WEIGHTS_G if number == 0 else (WEIGHTS_G[1 + number % 2],)
        for mass in grams:
            newtons = mass * 1e-3 * GRAVITY_M_PER_S2
            writer.writerow(["presses.mp4", "", x, y, TOUCHED_RADIUS_MM, f"{newtons:.3f}"])
    return table.getvalue()


def probing_gcode(sensor: Sensor) -> str:
    """G-code that presses a round tip in the printer's head onto the sheet, at each place to each depth.

    The sensor lies on the bed, touched side up, x along the printer's; y then is along the printer's too,
    since both frames are right-handed with z up. The middle of the sheet is under the head and the tip
    just touches it when the script starts: that place becomes 0, 0, 0.
    """
    lines = [
        f"; presses for manytouch, with a round tip of radius {TIP_RADIUS_MM:g} mm that alone may touch",
        "; start with it just touching the middle of the sheet",
        "; times are counted from the first G4: two untouched seconds",
        "G21 ; mm",
        "G90 ; absolute",
        "G92 X0 Y0 Z0 ; here is the middle of the sheet, not yet pressed",
        f"G1 Z{SAFE_MM:g} F{FEED_MM_PER_MIN}",
        "G4 P2000",
    ]
    for x, y in places_mm(sensor).tolist():
        lines.append(f"G1 X{x:g} Y{y:g} F{FEED_MM_PER_MIN}")
        for depth in DEPTHS_MM:
            lines += [
                f"G1 Z{-depth:g} F{FEED_MM_PER_MIN}",
                f"G4 P{DWELL_MS} ; held {depth:g} mm at {x:g}, {y:g} mm",
            ]
        lines.append(f"G1 Z{SAFE_MM:g} F{FEED_MM_PER_MIN}")
    return "\n".join([*lines, "M400", ""])
