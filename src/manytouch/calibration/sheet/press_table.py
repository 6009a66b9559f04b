"""Presses at known places, from a table and the recordings that it lists."""

import csv
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manytouch.calibration.marker_tracks import MarkerTracks, track_markers
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.press_plan import COLUMNS, CONTACT_RADIUS_MM, GRAVITY_M_PER_S2
from manytouch.errors import OutputError, SensorError, SourceError
from manytouch.geometry.centre_noise import centre_noise_px
from manytouch.limits import LARGEST_NUMBER, MAX_PRESSES, MAX_TABLE_BYTES
from manytouch.sources import open_source
from manytouch.values import Frame, Sensor
from manytouch.values.arrays import Points2

TILTED = ("weight_N", "tilt_x_deg", "tilt_y_deg")
"""Columns of weights that stand on a tilted sensor, instead of `normal_force_N`."""
REQUIRED = ("input", "x_mm", "y_mm")
MAX_TILT_DEG = 60.0
UNTOUCHED_FRAMES = 10
HELD_S = 0.2
LEAST_NOISE_PX = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class PressRow:
    """A line of the table.

    Attributes:
        line: number, for messages.
        input: recording that starts untouched.
        time_s: when the press is held; None for the end of the recording.
        x_mm, y_mm: its centre on the undeformed sheet.
        radius_mm: of the contact area.
        force_N: normal force, the reading of a scale, or None.
        shear_N: force along x and y, of a weight on a tilted sensor; None if not known.
    """

    line: int
    input: str
    time_s: float | None
    x_mm: float
    y_mm: float
    radius_mm: float
    force_N: float | None
    shear_N: tuple[float, float] | None = None


def weight_components(weight_N: float, tilt_x_deg: float, tilt_y_deg: float) -> tuple[float, float, float]:
    """Forces of a weight along x, along y, and on the sensor, N.

    Args:
        weight_N: its mass times gravity.
        tilt_x_deg, tilt_y_deg: angles of the sheet's x axis and y axis below the horizontal, as a level
            along them shows.
    """
    down_x, down_y = math.sin(math.radians(tilt_x_deg)), math.sin(math.radians(tilt_y_deg))
    return weight_N * down_x, weight_N * down_y, weight_N * math.sqrt(1.0 - down_x**2 - down_y**2)


def read_press_table(path: Path) -> tuple[PressRow, ...]:
    """Read a CSV table with the columns `COLUMNS` and `TILTED`; only those in `REQUIRED` must have values.

    Raises:
        SourceError: the file cannot be read, or a column is missing or unknown.
        SensorError: a value is not valid.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_TABLE_BYTES + 1)
        text = content.decode("utf-8-sig")
    except OSError as error:
        raise SourceError(
            f"the table of presses {path} cannot be read: {error.strerror}; give the path of a table with a "
            "line for each press"
        ) from None
    except ValueError:
        raise SourceError(
            f"the table of presses {path} cannot be read as text: save it as CSV in UTF-8"
        ) from None
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if len(content) > MAX_TABLE_BYTES or len(lines) > MAX_PRESSES + 1:
        raise SourceError(
            f"the table {path} is too large: at most {MAX_PRESSES} presses in {MAX_TABLE_BYTES // 10**6} MB "
            "are read"
        )
    try:
        return _rows(path, csv.DictReader(lines, strict=True))
    except csv.Error as error:
        raise SourceError(f"the table {path} is not valid CSV: {error}") from None


def _rows(path: Path, table: "csv.DictReader[str]") -> tuple[PressRow, ...]:
    missing = [name for name in REQUIRED if name not in (table.fieldnames or ())]
    unknown = [name for name in table.fieldnames or () if name not in COLUMNS + TILTED]
    if missing or unknown:
        raise SourceError(
            f"the table {path} must have the columns {', '.join(COLUMNS)} ({', '.join(REQUIRED)} are "
            f"required), and may have {', '.join(TILTED)}"
            + (f"; missing: {', '.join(missing)}" if missing else "")
            + (f"; unknown: {', '.join(unknown)[:200]}" if unknown else "")
        )
    return tuple(_row(path, number, row) for number, row in enumerate(table, 1))


def write_press_table(rows: Sequence[PressRow], path: Path) -> None:
    """Write a table that `read_press_table` can read.

    Raises:
        OutputError: the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with temporary.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(COLUMNS + TILTED if any(row.shear_N is not None for row in rows) else COLUMNS)
            for row in rows:
                numbers = (row.time_s, row.x_mm, row.y_mm, row.radius_mm, *_given_forces(row))
                writer.writerow([row.input, *("" if value is None else f"{value:.6g}" for value in numbers)])
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"cannot write the table of presses {path}: {error.strerror}") from None


def _given_forces(row: PressRow) -> tuple[float | None, ...]:
    """Values of `normal_force_N`, of a weight also of `TILTED`: the inverse of `weight_components`."""
    if row.force_N is None or row.shear_N is None:
        return (row.force_N,)
    weight_N = math.hypot(*row.shear_N, row.force_N)
    return (None, weight_N, *(math.degrees(math.asin(along_N / weight_N)) for along_N in row.shear_N))


def require_rest_calibration(sensor: Sensor) -> None:
    """Check that a sensor is one device, whose layout and pose are those of its markers.

    Raises:
        SensorError: it is nominal.
    """
    if sensor.is_nominal:
        raise SensorError(
            f"the sensor {sensor.name!r} describes a kind of sensor, and not the rows, columns and pose of "
            "this one: run manytouch calibrate rest RECORDING --sensor FILE --out my-gel.toml first, and "
            "give --sensor my-gel.toml"
        )


def measure_presses(
    sensor: Sensor, rows: Iterable[PressRow], folder: Path, fps: float | None = None
) -> tuple[KnownPress, ...]:
    """Measure the marker displacements of each press.

    Args:
        sensor: with its layout; each recording has its own reference, its first untouched frames.
        rows: from `read_press_table`.
        folder: inputs are relative to it.
        fps: rate of the recordings in frames per second instead of their own; images without a rate have 30.

    Raises:
        SensorError: the sensor is nominal.
        SourceError: a recording cannot be opened, or a time lies outside it.
        LayoutError: its markers were not found.
    """
    require_rest_calibration(sensor)
    found: dict[str, PressRecording] = {}
    presses = []
    for row in rows:
        if row.input not in found:
            text = row.input
            if not (text.startswith("sim:") or Path(text).is_absolute()):
                text = str(folder / text)
            found[row.input] = track_presses(sensor, list(open_source(text, fps=fps)))
        presses.append(known_press(found[row.input], row))
    return tuple(presses)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PressRecording:
    """The markers of a recording of presses.

    Attributes:
        tracks: in all frames.
        rest_px: (m, 2) at rest.
        noise_px: standard deviation of a displacement.
    """

    tracks: MarkerTracks
    rest_px: Points2
    noise_px: float


def track_presses(sensor: Sensor, frames: Sequence[Frame]) -> PressRecording:
    """Track the markers of a recording whose first `UNTOUCHED_FRAMES` frames are untouched.

    Raises:
        LayoutError: the markers were not found.
    """
    tracks = track_markers(register_rest(sensor, frames[:UNTOUCHED_FRAMES]), frames)
    first = np.arange(len(tracks.timestamp_ns)) < UNTOUCHED_FRAMES
    noise = centre_noise_px(tracks.position_px[first])
    noise_px = float(np.median(noise[np.isfinite(noise)])) if np.isfinite(noise).any() else 0.0
    return PressRecording(
        tracks=tracks,
        rest_px=tracks.median_px(first),
        noise_px=float(np.hypot(noise_px, tracks.compression_std_px)),
    )


def known_press(recording: PressRecording, row: PressRow) -> KnownPress:
    """A press of a recording, by the median over `HELD_S`.

    Raises:
        SourceError: its time lies outside the recording.
    """
    tracks = recording.tracks
    time_s = tracks.timestamp_ns * 1e-9
    end_s = float(time_s[-1])
    at_s = end_s - HELD_S / 2 if row.time_s is None else row.time_s
    if not time_s[0] <= at_s <= end_s:
        raise SourceError(
            f"press {row.line} is listed at {at_s:g} s, but {row.input} lasts from "
            f"{time_s[0]:.1f} to {end_s:.1f} s: correct time_s, or give the rate of the recording with --fps"
        )
    near = np.abs(time_s - at_s) <= HELD_S / 2
    near[np.argmin(np.abs(time_s - at_s))] = True
    moved = tracks.median_px(near) - recording.rest_px
    is_seen = np.isfinite(moved[:, 0])
    return KnownPress(
        name=f"press {row.line} ({row.input})",
        place_mm=np.array([row.x_mm, row.y_mm]),
        radius_mm=row.radius_mm,
        displacement_px=np.where(is_seen[:, None], moved, 0.0),
        is_seen=is_seen,
        noise_px=max(recording.noise_px, LEAST_NOISE_PX),
        force_N=row.force_N,
        shear_N=None if row.shear_N is None else np.array(row.shear_N),
    )


def _row(path: Path, number: int, row: dict[str, str | None]) -> PressRow:
    wrong = list(_errors_in(row))
    if wrong:
        raise SensorError(f"press {number} of {path}: {'; '.join(wrong)}")
    radius, force = _number(row, "radius_mm"), _number(row, "normal_force_N")
    x, y = _number(row, "x_mm"), _number(row, "y_mm")
    assert x is not None and y is not None  # noqa: PT018 - checked above
    weight, shear = _number(row, "weight_N"), None
    if weight is not None:
        tilts = (_number(row, name) or 0.0 for name in TILTED[1:])
        shear_x, shear_y, force = weight_components(weight, *tilts)
        shear = (shear_x, shear_y)
    return PressRow(
        line=number,
        input=(row["input"] or "").strip(),
        time_s=_number(row, "time_s"),
        x_mm=x,
        y_mm=y,
        radius_mm=CONTACT_RADIUS_MM if radius is None else radius,
        force_N=force,
        shear_N=shear,
    )


def _errors_in(row: dict[str, str | None]) -> Iterator[str]:
    if not (row.get("input") or "").strip():
        yield "input is empty, expected a recording"
    if None in row:
        yield "it has more values than there are columns"
    known = {}
    for name in COLUMNS[1:] + TILTED:
        try:
            value = known[name] = _number(row, name)
        except ValueError:
            yield f"{name} = {str(row[name])[:40]!r} is not a number"
            continue
        if value is not None and not abs(value) <= LARGEST_NUMBER:
            yield f"{name} = {value:g}, expected a number of at most {LARGEST_NUMBER:g}"
        if value is None and name in REQUIRED:
            yield f"{name} is empty"
        if value is not None and name in ("radius_mm", "normal_force_N", "weight_N") and value <= 0:
            yield f"{name} = {value:g}, expected a positive number"
        if value is not None and name in TILTED[1:] and not abs(value) <= MAX_TILT_DEG:
            yield f"{name} = {value:g}, expected at most {MAX_TILT_DEG:g} degrees"
    if known.get("weight_N") is not None and known.get("normal_force_N") is not None:
        yield "both weight_N and normal_force_N are given: leave one of them empty"
    tilts = [known.get(name) for name in TILTED[1:]]
    if known.get("weight_N") is None and any(tilts):
        yield f"a tilt needs weight_N, the mass in kg times {GRAVITY_M_PER_S2:g}"
    if sum(math.sin(math.radians(tilt or 0.0)) ** 2 for tilt in tilts) >= 1.0:
        yield "tilt_x_deg and tilt_y_deg together are steeper than upright"


def _number(row: dict[str, str | None], name: str) -> float | None:
    text = (row.get(name) or "").strip()
    return float(text) if text else None
