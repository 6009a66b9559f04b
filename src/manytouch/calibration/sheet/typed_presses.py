"""Presses that a person types in: one line each, kept in a table at once."""

import os
from collections.abc import Callable
from pathlib import Path

from manytouch.calibration.sheet.calibrate import LEAST_PRESSES
from manytouch.calibration.sheet.camera_presses import Ask, PressedLive, Say
from manytouch.calibration.sheet.press_parser import EXAMPLE, PressContext, parse_press
from manytouch.calibration.sheet.press_table import PressRow, read_press_table, write_press_table
from manytouch.calibration.sheet.protocol import TIP_RADIUS_MM, TOUCHED_RADIUS_MM
from manytouch.errors import ManytouchError, OutputError, SensorError
from manytouch.sources import Source, open_source
from manytouch.sources.source import Device
from manytouch.values import Sensor, Sheet


def typed_presses(
    sensor: Sensor, source: str, table: Path, *, say: Say, ask: Ask = input
) -> tuple[PressRow, ...] | None:
    """Ask for presses until `done`, and keep them in a table.

    A table that is there already is gone on with. A camera is watched while it is pressed, and what it
    showed is kept in a folder beside the table.

    Args:
        sensor: with layout and sheet.
        source: recording that shows the presses, or camera.
        table: CSV to write after every line.
        say: prints a sentence.
        ask: prints a prompt and gives the line that was typed; raises EOFError at the end.

    Returns:
        The presses; None where the person stopped with Ctrl-C.

    Raises:
        SourceError: the source cannot be opened or read.
        SensorError: the sensor has no sheet.
        OutputError: the table cannot be written.
    """
    if sensor.sheet is None or sensor.layout is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no [sheet] or no [markers]: write size_mm and thickness_mm of "
            "the sheet into its file first"
        )
    rows = list(read_press_table(table)) if table.is_file() else []
    if rows:
        say(f"{_count(rows)} in {table} already; undo takes the last one back")
    opened = open_source(source)
    try:
        if isinstance(opened, Device):
            look = PressedLive(sensor, opened, table, say=say, ask=ask)
            asked = PressContext(input=look.folder.name, begin_s=None, end_s=None, sheet=sensor.sheet)
            say(f"type one press per line: x,y in mm, force or mass, such as {EXAMPLE}")
        else:
            look, asked = None, _recorded(opened, source, table, sensor.sheet, say)
        _ask_for_rows(rows, asked, table, look=look, say=say, ask=ask)
    except KeyboardInterrupt:
        say(f"stopped; {_count(rows)} kept in {table}, and the same command goes on there")
        return None
    finally:
        if isinstance(opened, Device):
            opened.close()
    return read_press_table(table) if rows else ()


def _recorded(opened: Source, source: str, table: Path, sheet: Sheet, say: Say) -> PressContext:
    """A recording, how long it lasts, and how to name its presses."""
    times = [frame.timestamp_ns * 1e-9 for frame in opened]
    if not times:
        raise SensorError(f"{source} has no frames: give a recording of the presses, or a camera")
    name = source if source.startswith("sim:") else os.path.relpath(source, table.parent)
    say(f"{source} lasts from {times[0]:.1f} to {times[-1]:.1f} s; it must begin untouched")
    say(f"type one press per line: x,y in mm, force or mass, when it was held, such as {EXAMPLE} 3.4 s")
    return PressContext(input=name, begin_s=times[0], end_s=times[-1], sheet=sheet)


def _ask_for_rows(
    rows: list[PressRow],
    asked: PressContext,
    table: Path,
    *,
    look: Callable[[PressRow], PressRow] | None,
    say: Say,
    ask: Ask,
) -> None:
    """Lines until `done`; each good one is in the table before the next is asked for."""
    say(
        f"what touches has a radius of {TOUCHED_RADIUS_MM:g} mm, as under a ball of {2 * TIP_RADIUS_MM:g} "
        "mm, unless you add another, such as radius 5 mm; undo takes the last press back, done ends"
    )
    while True:
        try:
            text = ask(f"press {len(rows) + 1}: ").strip()
            if text.lower() in ("done", "end", "quit"):
                if len(rows) >= LEAST_PRESSES:
                    return
                say(f"{_count(rows)} too few, at least {LEAST_PRESSES} are needed; Ctrl-C stops")
                continue
            if text.lower() == "undo":
                say(_undone(rows, table))
                continue
            row = parse_press(text, len(rows) + 1, asked)
            if look is not None:
                row = look(row)
        except EOFError:
            say("")
            return
        except OutputError:
            raise
        except ManytouchError as error:
            say(f"not taken: {error}")
            continue
        rows.append(row)
        write_press_table(rows, table)
        say(_taken(row))


def _taken(row: PressRow) -> str:
    """A press as it was understood."""
    force = "force not read" if row.force_N is None else f"{row.force_N:.3g} N"
    return f"    {force} at {row.x_mm:g}, {row.y_mm:g} mm, radius {row.radius_mm:g} mm, at {row.time_s:.2f} s"


def _count(rows: list[PressRow]) -> str:
    return "1 press is" if len(rows) == 1 else f"{len(rows)} presses are"


def _undone(rows: list[PressRow], table: Path) -> str:
    if not rows:
        return "there is nothing to take back"
    row = rows.pop()
    write_press_table(rows, table)
    return f"took back the press at {row.x_mm:g}, {row.y_mm:g} mm"
