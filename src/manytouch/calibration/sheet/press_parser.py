"""A press in a person's words: "18,-12 50 g 3.4 s radius 2 mm"."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from manytouch.calibration.sheet.press_table import PressRow
from manytouch.calibration.sheet.protocol import GRAVITY_M_PER_S2, TOUCHED_RADIUS_MM
from manytouch.errors import SensorError
from manytouch.values import Sheet

NEWTONS = {"N": 1.0, "mN": 1e-3, "kg": GRAVITY_M_PER_S2, "g": 1e-3 * GRAVITY_M_PER_S2}
UNITS = "N, mN, g or kg for the force, s for the time, mm for the radius"
EXAMPLE = "18,-12 50 g"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_PLACE = re.compile(rf"\s*({_NUMBER})\s*(?:mm)?\s*[,;\s]\s*({_NUMBER})\s*(?:mm\b)?(?![\w.])")
_AMOUNT = re.compile(rf"({_NUMBER})(?:\s*-\s*({_NUMBER}))?\s*(mN|N|kg|g|mm|s)?(?![\w.])")
_FILLERS = re.compile(r"\b(?:at|with|for|radius|held|from|to)\b|[,;=()]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a press may say.

    Attributes:
        input: the recording that shows it.
        begin_s, end_s: of the recording; None of a camera, which looks when it is told to.
        sheet: that is pressed.
    """

    input: str
    begin_s: float | None
    end_s: float | None
    sheet: Sheet


def press_in_words(text: str, line: int, asked: Asked) -> PressRow:
    """The press that a line names: place x,y, force or mass, time or span, radius, each with its unit.

    Args:
        text: place first; the rest in any order. Force and radius may be left out, of a camera the time must.
        line: number of the press.
        asked: the recording and the sheet.

    Raises:
        SensorError: what is wrong with the line, all of it.
    """
    place = _PLACE.match(text)
    if place is None:
        raise SensorError(f"begin with the place x,y in mm from the middle of the sheet, such as {EXAMPLE}")
    x_mm, y_mm = float(place[1]), float(place[2])
    rest = _FILLERS.sub(" ", text[place.end() :])
    said: dict[str, list[tuple[float, float]]] = {"force": [], "time": [], "radius": []}
    wrong = list(_outside(x_mm, y_mm, asked.sheet))
    for found in _AMOUNT.finditer(rest):
        low, unit = float(found[1]), found[3]
        high = float(found[2]) if found[2] else low
        if unit is None:
            wrong.append(f"{found[0].strip()} has no unit: {UNITS}")
        elif unit == "s":
            said["time"].append((low, high))
        elif unit == "mm":
            said["radius"].append((low, high))
        else:
            said["force"].append((low * NEWTONS[unit], high * NEWTONS[unit]))
    left = _AMOUNT.sub(" ", rest).split()
    if left:
        wrong.append(f"{' '.join(left)!r} is not understood: write a press as {_example(asked)}")
    wrong += [
        f"{len(values)} {name}s are given, one is enough" for name, values in said.items() if len(values) > 1
    ]
    wrong += _impossible(said, asked)
    if wrong:
        raise SensorError("; ".join(wrong))
    force, time, radius = (values[0] if values else None for values in said.values())
    return PressRow(
        line=line,
        input=asked.input,
        time_s=None if time is None else 0.5 * (time[0] + time[1]),
        x_mm=x_mm,
        y_mm=y_mm,
        radius_mm=TOUCHED_RADIUS_MM if radius is None else radius[0],
        force_N=None if force is None else force[0],
    )


def _example(asked: Asked) -> str:
    return EXAMPLE if asked.end_s is None else f"{EXAMPLE} 3.4 s"


def _outside(x_mm: float, y_mm: float, sheet: Sheet) -> Iterator[str]:
    for name, value, side in (("x", x_mm, sheet.size_mm[0]), ("y", y_mm, sheet.size_mm[1])):
        if abs(value) >= side / 2:
            yield (
                f"{name} = {value:g} mm lies outside the sheet, which reaches from {-side / 2:g} to "
                f"{side / 2:g} mm"
            )


def _impossible(said: dict[str, list[tuple[float, float]]], asked: Asked) -> Iterator[str]:
    for name in ("force", "radius"):
        if any(low <= 0.0 for low, _ in said[name]):
            yield f"a {name} is more than 0"
        elif any(low != high for low, high in said[name]):
            yield f"a {name} is one number, not a span"
    if asked.begin_s is None or asked.end_s is None:
        if said["time"]:
            yield "a time is not needed: the camera looks when you press Enter"
        return
    if not said["time"]:
        yield f"when was it held? add the time in {asked.input}, such as 3.4 s or 3.2-3.8 s"
    for low, high in said["time"]:
        if high < low:
            yield f"a span of time begins before it ends: write {high:g}-{low:g} s"
        elif low < asked.begin_s or high > asked.end_s:
            span = f"{low:g} s lies" if low == high else f"{low:g}-{high:g} s reaches"
            lasts = f"from {asked.begin_s:.1f} to {asked.end_s:.1f} s"
            yield f"{span} outside {asked.input}, which lasts {lasts}"
