"""Press plans for calibrating a sheet with weights or a 3-D printer.

Design and press tables share the tip, the places, the depths and the weights.
"""

import csv
import io
import math
from pathlib import Path

import numpy as np

from manytouch.errors import SensorError
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.values import Sensor
from manytouch.values.arrays import Points2

WEIGHTS_G = (50, 100, 200)
COLUMNS = ("input", "time_s", "x_mm", "y_mm", "radius_mm", "normal_force_N")
"""Columns of a table of presses."""
GRAVITY_M_PER_S2 = 9.81
"""For all masses in the calibration, as the documentation states it; g at sea level is within 0.3 % of it."""
PLACE_SHARE = 0.25
"""Offset of the four outer places from the centre, as a share of the sheet's size along x and y."""
TRAVEL_HEIGHT_MM = 15.0
"""Height of the printer's tip above the unpressed sheet on its way from one place to the next."""
FEED_MM_PER_MIN = 600
REST_MS = 2000
"""How long the sheet stays untouched at the beginning."""
DWELL_MS = 2000
"""How long the printer's tip stays at each depth."""
DEPTHS_MM = (1.0, 2.5)
"""Depths to which a printer presses a clamped sheet, at each place; less on a pad (`press_depths_mm`). The
prototypes of `design` are calibrated with these presses too: each depth costs a solution per place."""
BONDED_SHARE = 0.25
"""Deepest press of a bonded pad as a share of its thickness.

Its back cannot move, so that deeper presses may tear the gel or detach it from the window."""
TIP_RADIUS_MM = 8.0
"""Radius of the round tip: a flat foot presses with its edge wherever the sheet slopes (ADR 0021)."""
CONTACT_RADIUS_MM = 2.0
"""Approximate radius of the contact area under that tip; also the default of presses that state none."""


def places_mm(sensor: Sensor) -> Points2:
    """(5, 2) the centre of the sheet and the centres of its four quarters, mm.

    Raises:
        SensorError: the sheet's size is not known.
    """
    if sensor.sheet is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no [sheet]: write its size_mm and thickness_mm into the file "
            "first"
        )
    x, y = PLACE_SHARE * np.asarray(sensor.sheet.size_mm)
    return np.round(np.array([[0.0, 0.0], [-x, -y], [x, -y], [-x, y], [x, y]]), 1)


def press_depths_mm(sensor: Sensor) -> tuple[float, ...]:
    """Depths to which a printer presses, mm; of a bonded pad at most a quarter of its thickness."""
    sheet = sensor.sheet
    if sheet is None or sheet.boundary != "bonded":
        return DEPTHS_MM
    limit_mm = BONDED_SHARE * sheet.thickness_mm
    scale = min(1.0, limit_mm / max(DEPTHS_MM))
    return tuple(math.floor(100.0 * scale * depth + 1e-9) / 100.0 for depth in DEPTHS_MM)


def write_plan(sensor: Sensor, folder: Path) -> None:
    """Write presses.csv for weights and probing.gcode for a 3-D printer.

    Raises:
        SensorError: the sheet's size is not known.
        OutputError: the folder cannot be written.
    """
    texts = {"presses.csv": weight_table(sensor), "probing.gcode": probing_gcode(sensor)}
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")


def weight_table(sensor: Sensor) -> str:
    """A table of presses for weights of 50, 100 and 200 g on a round tip; the times are to be filled in."""
    table = io.StringIO()
    table.write(
        f"# Glue a ball of {2 * TIP_RADIUS_MM:g} mm under a cup, 50 g in total; only the ball may touch "
        f"the sheet.\n"
        "# Place it at x_mm, y_mm for a second, without pressing; note the time in time_s. "
        f"normal_force_N is the weight of {', '.join(f'{mass:g}' for mass in WEIGHTS_G)} g in total.\n"
        "# Make one recording of all presses; nothing may touch the sheet in its first two seconds.\n"
    )
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(COLUMNS)
    for number, (x, y) in enumerate(places_mm(sensor).tolist()):
        # the heaviest two in turn at the outer places
        grams = WEIGHTS_G if number == 0 else (WEIGHTS_G[1 + number % 2],)
        for mass in grams:
            newtons = mass * 1e-3 * GRAVITY_M_PER_S2
            writer.writerow(["presses.mp4", "", x, y, CONTACT_RADIUS_MM, f"{newtons:.3f}"])
    return table.getvalue()


def probing_gcode(sensor: Sensor) -> str:
    """G-code that presses a round tip in the printer's head onto the sheet, at each place to each depth.

    The sensor lies on the bed, touched face up, with its x axis along that of the printer; both frames are
    right-handed with z up, so the y axes are parallel too. When the script starts, the tip just touches the
    centre of the sheet; that position becomes 0, 0, 0.
    """
    depths_mm = press_depths_mm(sensor)
    lines = [
        f"; presses for manytouch, with a round tip of radius {TIP_RADIUS_MM:g} mm; only the tip may touch",
        "; start with the tip just touching the centre of the sheet",
        f"; deepest press {max(depths_mm):g} mm{_limit_comment(sensor)}",
        f"; nothing may touch the sheet during the first G4, {1e-3 * REST_MS:g} s; "
        "note when each press is held",
        "G21 ; mm",
        "G90 ; absolute",
        "G92 X0 Y0 Z0 ; centre of the sheet, not yet pressed",
        f"G1 Z{TRAVEL_HEIGHT_MM:g} F{FEED_MM_PER_MIN}",
        f"G4 P{REST_MS}",
    ]
    for x, y in places_mm(sensor).tolist():
        lines.append(f"G1 X{x:g} Y{y:g} F{FEED_MM_PER_MIN}")
        for depth in depths_mm:
            lines += [
                f"G1 Z{-depth:g} F{FEED_MM_PER_MIN}",
                f"G4 P{DWELL_MS} ; held {depth:g} mm at {x:g}, {y:g} mm",
            ]
        lines.append(f"G1 Z{TRAVEL_HEIGHT_MM:g} F{FEED_MM_PER_MIN}")
    return "\n".join([*lines, "M400", ""])


def _limit_comment(sensor: Sensor) -> str:
    if press_depths_mm(sensor) == DEPTHS_MM or sensor.sheet is None:
        return ""
    return f": a quarter of the pad's thickness of {sensor.sheet.thickness_mm:g} mm"
