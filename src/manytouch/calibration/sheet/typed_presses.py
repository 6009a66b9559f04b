"""Entry of presses on a terminal: one line per press, saved in a table at once."""

import os
from collections.abc import Callable
from pathlib import Path

from manytouch.calibration.sheet.calibrate import LEAST_PRESSES
from manytouch.calibration.sheet.camera_presses import CameraPresses, Print, Prompt
from manytouch.calibration.sheet.pad import LEAST_FORCES
from manytouch.calibration.sheet.press_parser import EXAMPLE, PressContext, parse_press
from manytouch.calibration.sheet.press_plan import CONTACT_RADIUS_MM, TIP_RADIUS_MM
from manytouch.calibration.sheet.press_table import (
    PressRow,
    read_press_table,
    require_rest_calibration,
    write_press_table,
)
from manytouch.errors import ManytouchError, OutputError, SensorError, SourceError
from manytouch.sources import Source, open_source
from manytouch.sources.source import ASSUMED_FPS, close
from manytouch.values import Sensor, Sheet


def read_typed_presses(
    sensor: Sensor,
    source: str,
    table: Path,
    *,
    report: Print,
    prompt: Prompt = input,
    fps: float | None = None,
) -> tuple[PressRow, ...] | None:
    """Prompt for presses until `done`, and save them in a table.

    An existing table is continued. A camera measures each press, and its images are saved in a folder next
    to the table. `done` is accepted once the calibration of this sheet has enough presses.

    Args:
        sensor: with layout and sheet.
        source: recording of the presses, or a camera.
        table: CSV file, written after every line.
        report: prints a sentence.
        prompt: prints a prompt and returns the typed line; raises EOFError at the end of the input.
        fps: rate of the recording in frames per second instead of its own.

    Returns:
        The presses; None if Ctrl-C was pressed.

    Raises:
        SourceError: the source cannot be opened or read, or has no frames.
        SensorError: the sensor has no sheet, or the input ended after too few presses.
        OutputError: the table cannot be written.
    """
    if sensor.sheet is None or sensor.layout is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no [sheet] or no [markers]: add size_mm and thickness_mm of the "
            "sheet to its file first"
        )
    require_rest_calibration(sensor)
    rows = list(read_press_table(table)) if table.is_file() else []
    if rows:
        report(f"{_count(rows)} already in {table}; undo removes the last one")
    opened = open_source(source, fps=fps)
    try:
        if opened.capabilities.device is not None:
            if fps is not None:
                raise SourceError(
                    f"a frame rate of {fps:g} was given with the camera {source!r}, which has its own: "
                    "leave out --fps"
                )
            measure = CameraPresses(sensor, opened, table, report=report, prompt=prompt)
            context = PressContext(input=measure.folder.name, begin_s=None, end_s=None, sheet=sensor.sheet)
            report(f"type one press per line: x,y in mm, force or mass, such as {EXAMPLE}")
        else:
            measure, context = None, _describe_recording(opened, source, table, sensor.sheet, report)
        _read_rows(rows, context, table, measure=measure, report=report, prompt=prompt)
    except KeyboardInterrupt:
        report(f"stopped; {_count(rows)} saved in {table}; run the same command again to continue")
        return None
    finally:
        close(opened)
    return read_press_table(table) if rows else ()


def _describe_recording(
    opened: Source, source: str, table: Path, sheet: Sheet, report: Print
) -> PressContext:
    """Print the duration of a recording, and return what is common to its presses."""
    times = [frame.timestamp_ns * 1e-9 for frame in opened]
    if not times:
        raise SourceError(f"{source} has no frames: give a recording of the presses, or a camera")
    if opened.fps is None:
        report(
            f"the images state no rate: {ASSUMED_FPS:g} frames per second are assumed; --fps gives another"
        )
    name = source if source.startswith("sim:") else os.path.relpath(source, table.parent)
    report(f"{source} covers {times[0]:.1f} to {times[-1]:.1f} s; nothing may touch the sheet at its start")
    report(f"type one press per line: x,y in mm, force or mass, time, such as {EXAMPLE} 3.4 s")
    return PressContext(input=name, begin_s=times[0], end_s=times[-1], sheet=sheet)


def _read_rows(
    rows: list[PressRow],
    context: PressContext,
    table: Path,
    *,
    measure: Callable[[PressRow], PressRow] | None,
    report: Print,
    prompt: Prompt,
) -> None:
    """Read lines until `done` or the end of the input; each valid press is saved before the next prompt."""
    report(
        f"the contact radius is {CONTACT_RADIUS_MM:g} mm, as under a ball of {2 * TIP_RADIUS_MM:g} mm, "
        "unless you add another one, such as radius 5 mm; undo removes the last press, done ends the input"
    )
    while True:
        try:
            text = prompt(f"press {len(rows) + 1}: ").strip()
            if text.lower() in ("done", "end", "quit"):
                missing = _too_few(rows, context.sheet)
                if missing is None:
                    return
                report(f"{missing}; Ctrl-C stops")
                continue
            if text.lower() == "undo":
                report(_undo(rows, table))
                continue
            row = parse_press(text, len(rows) + 1, context)
            if measure is not None:
                row = measure(row)
        except EOFError:
            report("")
            missing = _too_few(rows, context.sheet)
            if missing is not None:
                raise SensorError(
                    f"{missing}; {_count(rows)} saved in {table}: run the same command again to add more"
                ) from None
            return
        except OutputError:
            raise
        except ManytouchError as error:
            report(f"refused: {error}")
            continue
        rows.append(row)
        write_press_table(rows, table)
        report(_describe(row))


def _too_few(rows: list[PressRow], sheet: Sheet) -> str | None:
    """Why the presses do not suffice to calibrate a sheet; None if they do."""
    if sheet.boundary == "bonded":
        count, least, kind = sum(row.force_N is not None for row in rows), LEAST_FORCES, " with a force"
    else:
        count, least, kind = len(rows), LEAST_PRESSES, ""
    if count >= least:
        return None
    subject = f"1 press{kind} is" if count == 1 else f"{count} presses{kind} are"
    return f"{subject} too few, at least {least} are needed"


def _describe(row: PressRow) -> str:
    """A press as it was parsed."""
    force = "force unknown" if row.force_N is None else f"{row.force_N:.3g} N"
    return f"    {force} at {row.x_mm:g}, {row.y_mm:g} mm, radius {row.radius_mm:g} mm, at {row.time_s:.2f} s"


def _count(rows: list[PressRow]) -> str:
    return "1 press is" if len(rows) == 1 else f"{len(rows)} presses are"


def _undo(rows: list[PressRow], table: Path) -> str:
    if not rows:
        return "there is no press to remove"
    row = rows.pop()
    write_press_table(rows, table)
    return f"removed the press at {row.x_mm:g}, {row.y_mm:g} mm"
