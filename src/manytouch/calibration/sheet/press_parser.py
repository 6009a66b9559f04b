"""Parser for a press typed by a user: "18,-12 50 g 3.4 s radius 2 mm"."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from manytouch.calibration.sheet.press_plan import CONTACT_RADIUS_MM, GRAVITY_M_PER_S2
from manytouch.calibration.sheet.press_table import PressRow
from manytouch.errors import SensorError
from manytouch.limits import LARGEST_NUMBER
from manytouch.values import Sheet

NEWTONS = {"N": 1.0, "mN": 1e-3, "kg": GRAVITY_M_PER_S2, "g": 1e-3 * GRAVITY_M_PER_S2}
UNITS = "N, mN, g or kg for the force, s for the time, mm for the radius"
EXAMPLE = "18,-12 50 g"
MAX_CHARACTERS = 200
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_PLACE = re.compile(rf"\s*({_NUMBER})\s*(?:mm)?\s*[,;\s]\s*({_NUMBER})\s*(?:mm\b)?(?![\w.])")
_AMOUNT = re.compile(rf"({_NUMBER})(?:\s*-\s*({_NUMBER}))?\s*(mN|N|kg|g|mm|s)?(?![\w.])")
_FILLERS = re.compile(r"\b(?:at|with|for|radius|held|from|to)\b|[,;=()]")


@dataclass(frozen=True, slots=True, kw_only=True)
class PressContext:
    """The recording and sheet that a typed press refers to.

    Attributes:
        input: the recording that contains the press.
        begin_s, end_s: of the recording; None for a camera, which captures on request.
        sheet: the pressed sheet.
    """

    input: str
    begin_s: float | None
    end_s: float | None
    sheet: Sheet


def parse_press(text: str, line: int, context: PressContext) -> PressRow:
    """Parse a line: place x,y, force or mass, time or time span, radius, each with its unit.

    Args:
        text: place first, the rest in any order. Force and radius are optional; a camera takes no time.
        line: number of the press.
        context: the recording and the sheet.

    Raises:
        SensorError: all errors of the line.
    """
    if len(text) > MAX_CHARACTERS:
        raise SensorError(f"a press has at most {MAX_CHARACTERS} characters, such as {EXAMPLE}")
    place = _PLACE.match(text)
    if place is None:
        raise SensorError(f"start with the place x,y in mm from the centre of the sheet, such as {EXAMPLE}")
    x_mm, y_mm = float(place[1]), float(place[2])
    rest = _FILLERS.sub(" ", text[place.end() :])
    values_of: dict[str, list[tuple[float, float]]] = {"force": [], "time": [], "radius": []}
    wrong = list(_place_errors(x_mm, y_mm, context.sheet))
    for found in _AMOUNT.finditer(rest):
        low, unit = float(found[1]), found[3]
        high = float(found[2]) if found[2] else low
        if unit is None:
            wrong.append(f"{found[0].strip()} has no unit: {UNITS}")
        elif unit == "s":
            values_of["time"].append((low, high))
        elif unit == "mm":
            values_of["radius"].append((low, high))
        else:
            values_of["force"].append((low * NEWTONS[unit], high * NEWTONS[unit]))
    left = _AMOUNT.sub(" ", rest).split()
    if left:
        wrong.append(f"{' '.join(left)!r} is not understood: enter a press as {_example(context)}")
    wrong += [
        f"{len(values)} {name}s are given, one is enough"
        for name, values in values_of.items()
        if len(values) > 1
    ]
    wrong += _value_errors(values_of, context)
    if wrong:
        raise SensorError("; ".join(wrong))
    force, time, radius = (values[0] if values else None for values in values_of.values())
    return PressRow(
        line=line,
        input=context.input,
        time_s=None if time is None else 0.5 * (time[0] + time[1]),
        x_mm=x_mm,
        y_mm=y_mm,
        radius_mm=CONTACT_RADIUS_MM if radius is None else radius[0],
        force_N=None if force is None else force[0],
    )


def _example(context: PressContext) -> str:
    return EXAMPLE if context.end_s is None else f"{EXAMPLE} 3.4 s"


def _place_errors(x_mm: float, y_mm: float, sheet: Sheet) -> Iterator[str]:
    for name, value, side in (("x", x_mm, sheet.size_mm[0]), ("y", y_mm, sheet.size_mm[1])):
        if abs(value) >= side / 2:
            yield (
                f"{name} = {value:g} mm lies outside the sheet, which extends from {-side / 2:g} to "
                f"{side / 2:g} mm"
            )


def _value_errors(values_of: dict[str, list[tuple[float, float]]], context: PressContext) -> Iterator[str]:
    for name in ("force", "radius"):
        if any(not 0.0 < low <= LARGEST_NUMBER for low, _ in values_of[name]):
            yield f"a {name} must be positive, and at most {LARGEST_NUMBER:g}"
        elif any(low != high for low, high in values_of[name]):
            yield f"a {name} must be one number, not a range"
    if context.begin_s is None or context.end_s is None:
        if values_of["time"]:
            yield "no time is needed: the image is captured when you press Enter"
        return
    if not values_of["time"]:
        yield f"the time is missing: add the time in {context.input}, such as 3.4 s or 3.2-3.8 s"
    for low, high in values_of["time"]:
        if high < low:
            yield f"a time span must start before it ends: enter {high:g}-{low:g} s"
        elif low < context.begin_s or high > context.end_s:
            span = f"{low:g} s lies" if low == high else f"{low:g}-{high:g} s reaches"
            lasts = f"from {context.begin_s:.1f} to {context.end_s:.1f} s"
            yield f"{span} outside {context.input}, which lasts {lasts}"
