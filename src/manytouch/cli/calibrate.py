"""`manytouch calibrate`: the camera from views of a board, the sheet at rest, and the sheet under presses."""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from manytouch.cli.terminal import options
from manytouch.cli.terminal.failures import wrong_words

if TYPE_CHECKING:
    from manytouch.calibration.camera.board_views import ViewCollection
    from manytouch.calibration.sheet.calibrate import SheetCalibration
    from manytouch.values import Frame

app = App(name="calibrate", help="From pictures to a sensor that is known: camera, rest, sheet.")

VIDEO_STEP_S = 0.2
SAY_EVERY_S = 2.0
REST_FRAMES = 90


@app.command
def camera(
    images: Annotated[
        list[str],
        Parameter(name="IMAGES", negative=(), help="Pictures, folders of pictures, a video, or a camera."),
    ],
    /,
    *,
    board: Annotated[
        str,
        Parameter(
            metavar="KIND:CxR",
            help="chessboard:9x6 (inner corners), charuco:8x6 (squares), circles:9x6 or "
            "circles-asymmetric:4x11.",
        ),
    ],
    square_mm: Annotated[
        float, Parameter(metavar="MM", help="Side of a square, or distance of neighbouring circles.")
    ],
    out: Annotated[Path, Parameter(metavar="FILE", help="The sensor file to write; it holds [camera] only.")],
    model: Annotated[Literal["pinhole", "fisheye"], Parameter(help="Kind of lens.")] = "pinhole",
    report: Annotated[
        Path | None,
        options.folder("Also write coverage.png, calibration.json and camera_info.yaml (ROS) here."),
    ] = None,
    name: Annotated[str, Parameter(help="What the camera is called.")] = "camera",
) -> int:
    """Calibrate a camera from views of a board, and say how well it is known.

    Sharp views that differ are chosen by themselves; each picture that is refused
    is named with the reason, and what is missing is said while looking. Take 15 or
    more: tilted in different directions, near and far, in the middle and in every
    corner.

    Example: manytouch calibrate camera views/*.jpg --board chessboard:9x6 --square-mm 25 --out camera.toml
    """
    from rich.console import Console

    from manytouch.calibration.camera.board import parse_board
    from manytouch.calibration.camera.calibrate import calibrate_camera
    from manytouch.calibration.camera.report import describe, write_report
    from manytouch.cli.terminal.interrupt import Stop
    from manytouch.values import Sensor
    from manytouch.values.sensor_file import save_sensor

    console = Console(highlight=False, soft_wrap=True)
    wanted = parse_board(board, square_mm)
    with Stop() as stop:
        look = _Looking(console.print, stop, is_live=any(not Path(text).exists() for text in images))
        found = calibrate_camera(_pictures(images), wanted, model=model, on_view=look)
    for line in describe(found):
        console.print(f"  {line}", markup=False)
    if report is not None:
        write_report(found, report, name)
        console.print(f"  report in {report}", markup=False)
    provenance = {
        "camera": f"calibrated from {len(found.views)} views of a {wanted}, square {square_mm:g} mm",
        "camera_rms_px": round(found.intrinsics.rms_px, 4),
        **{f"camera_std_{key}": value for key, value in found.intrinsics.std.items()},
        "new_camera_matrix": found.intrinsics.new_matrix.tolist(),
    }
    save_sensor(Sensor(name=name, camera=found.intrinsics.camera, provenance=provenance), out)
    console.print(f"  camera in {out}", markup=False)
    return 0


@app.command
def rest(
    source: Annotated[str, Parameter(name="SOURCE", negative=(), help="Recording of the untouched sheet.")],
    /,
    *,
    sensor: Annotated[
        str, Parameter(metavar="FILE", help="Sensor file: a camera, with or without [markers] and [sheet].")
    ],
    out: Annotated[Path, Parameter(metavar="FILE", help="The sensor file to write.")],
    pitch_mm: options.PitchMm = None,
    sheet_mm: Annotated[
        Any,
        Parameter(
            converter=options.pair("X,Y"),
            n_tokens=1,
            metavar="X,Y",
            help="Clamped outline, if the file has none and the picture does not show it.",
        ),
    ] = None,
    thickness_mm: Annotated[
        float | None,
        Parameter(metavar="MM", help="Of the sheet; without --sheet-mm its outline is looked for."),
    ] = None,
    roi: options.RoiPx = None,
) -> int:
    """Find the pose of the sheet, its markers and their noise from a few untouched seconds.

    Says how far the markers are from a flat lattice, which are missing, how much
    they jitter, where the sheet is seen to end, and warnings: a sheet that is
    not flat, markers cut off, a wrong scale.

    Example: manytouch calibrate rest rest.mp4 --sensor camera.toml --pitch-mm 4 --out sensor.toml
    """
    from itertools import islice

    import numpy as np
    from rich.console import Console

    from manytouch.calibration.rest.pose import calibrate_rest
    from manytouch.calibration.sheet.clamp_line import describe
    from manytouch.sources import open_source
    from manytouch.values import Sheet
    from manytouch.values.sensor_file import load_sensor, save_sensor

    console = Console(highlight=False, soft_wrap=True, markup=False)
    if sheet_mm is not None and thickness_mm is None:
        raise wrong_words("calibrate rest", "--sheet-mm needs --thickness-mm too")
    sheet = None
    if sheet_mm is not None and thickness_mm is not None:
        sheet = Sheet(size_mm=np.array(sheet_mm), thickness_mm=float(thickness_mm))
    frames = list(islice(iter(open_source(source)), REST_FRAMES))
    found = calibrate_rest(
        load_sensor(sensor), frames, pitch_mm=pitch_mm, sheet=sheet, thickness_mm=thickness_mm, roi_px=roi
    )
    layout, camera = found.sensor.layout, found.sensor.camera
    assert layout is not None
    shape = "a table" if layout.shape is None else f"{layout.shape[0]} x {layout.shape[1]}"
    turn, shift = np.rad2deg(camera.rotation_vector), camera.translation_mm
    std_turn, std_shift = np.rad2deg(found.pose_std[:3]), found.pose_std[3:]
    for line in (
        f"{shape} markers, {int(layout.is_missing.sum())} missing, seen in {found.frames} frames",
        f"the sheet is {shift[2]:.2f} ± {std_shift[2]:.2f} mm away, off the axis by {shift[0]:.2f} and "
        f"{shift[1]:.2f} mm",
        f"turned by {turn[0]:.3f}, {turn[1]:.3f}, {turn[2]:.3f} ± {std_turn.max():.3f} degrees about x, y, z",
        f"markers {found.rms_px:.3f} px (RMS) from a flat lattice, noise {found.noise_px:.3f} px, contrast "
        f"{found.contrast:.0f} grey levels",
        describe(found.clamp, found.sensor.sheet),
        *(f"odd: {sentence}" for sentence in found.warnings),
    ):
        console.print(f"  {line}")
    provenance = {
        **found.sensor.provenance,
        "rest": f"calibrated from {found.frames} frames of {Path(source).name}",
        "rest_rms_px": round(found.rms_px, 4),
        "rest_odd": list(found.warnings),
    }
    save_sensor(replace(found.sensor, provenance=provenance), out)
    console.print(f"  sensor in {out}")
    return 0


@app.command
def sheet(
    presses: Annotated[
        str | None,
        Parameter(
            name="PRESSES",
            negative=(),
            help="CSV table; or a recording or camera, and you are asked for each press; absent with --plan.",
        ),
    ] = None,
    /,
    *,
    sensor: Annotated[str, Parameter(metavar="FILE", help="Sensor file with [markers] and [sheet].")],
    out: Annotated[Path | None, Parameter(metavar="FILE", help="The sensor file to write.")] = None,
    plan: Annotated[
        Path | None,
        options.folder("Instead, write presses.csv for weights and probing.gcode for a printer here."),
    ] = None,
) -> int:
    """Find pretension, bending factor, thickness and stiffness from presses at known places.

    The table has the columns input, time_s, x_mm, y_mm, radius_mm, normal_force_N.
    Each recording begins untouched; time_s says when a press is held (empty: at
    the end). At least one force in N is needed for stiffness. --plan writes such a
    table for weights of 50, 100 and 200 g. Without a table you are asked for the
    presses of a recording, or to press before a camera; what you type is kept as a
    table beside the new sensor file.

    Example: manytouch calibrate sheet presses.csv --sensor sensor.toml --out calibrated.toml
    Example: manytouch calibrate sheet presses.mp4 --sensor sensor.toml --out calibrated.toml
    """
    from rich.console import Console

    from manytouch.calibration.sheet.calibrate import calibrate_sheet
    from manytouch.calibration.sheet.press_table import PressRow, measure_presses, read_press_table
    from manytouch.calibration.sheet.protocol import probing_gcode, weight_table
    from manytouch.calibration.sheet.typed_presses import read_typed_presses
    from manytouch.values.sensor_file import load_sensor, save_sensor

    if plan is None and (presses is None or out is None):
        raise wrong_words(
            "calibrate sheet",
            "give a table of presses (or a recording or camera, to be asked for them) and --out FILE, or "
            "--plan DIR to get a table to fill in",
        )
    console = Console(highlight=False, soft_wrap=True, markup=False)
    known = load_sensor(sensor)
    if plan is not None:
        plan.mkdir(parents=True, exist_ok=True)
        (plan / "presses.csv").write_text(weight_table(known), encoding="utf-8")
        (plan / "probing.gcode").write_text(probing_gcode(known), encoding="utf-8")
        console.print(f"  plan in {plan}")
        return 0
    assert presses is not None
    assert out is not None
    if presses.lower().endswith(".csv"):
        table = Path(presses)
        rows: tuple[PressRow, ...] | None = read_press_table(table)
    else:
        table = out.with_name(f"{out.stem}-presses.csv")
        rows = read_typed_presses(known, presses, table, report=lambda text: console.print(f"  {text}"))
    if rows is None:
        return 0
    found = calibrate_sheet(known, measure_presses(known, rows, table.parent))
    for line in _sheet_in_words(found):
        console.print(f"  {line}")
    provenance = {
        **known.provenance,
        "sheet": f"calibrated from {len(found.residual_px)} presses in {table.name}",
        **{f"sheet_std_{name}": value for name, value in found.std.items()},
    }
    save_sensor(replace(known, sheet=found.sheet, provenance=provenance), out)
    console.print(f"  sensor in {out}")
    return 0


def _sheet_in_words(found: "SheetCalibration") -> Iterator[str]:
    """Values with their deviations, residuals, undetermined parameters and warnings."""
    told, std = found.sheet, found.std
    yield f"thickness {told.thickness_mm:.3f} ± {std['thickness_mm']:.3f} mm"
    yield f"bending factor {told.bending_factor:.3f} ± {std['bending_factor']:.3f}"
    if told.pretension_N_per_mm is not None:
        yield f"pretension {told.pretension_N_per_mm:.4f} ± {std['pretension_N_per_mm']:.4f} N/mm"
    if "young_MPa" in std:
        yield f"stiffness E {told.young_MPa:.3f} ± {std['young_MPa']:.3f} MPa"
    yield f"left over {found.residual_px.max():.3f} px at most (RMS of a press)"
    off = [100 * value for value in found.left_out.tolist() if math.isfinite(value)]
    if off:
        yield (
            f"forces told from the other presses alone are {sum(off) / len(off):+.1f} % off on average, "
            f"at most {max(map(abs, off)):.1f} %"
        )
    yield from found.undetermined
    yield from (f"odd: {sentence}" for sentence in found.warnings)


def _pictures(texts: list[str]) -> Iterator[tuple[str, "Frame"]]:
    """The pictures of some inputs with names; of a video or camera five per second.

    A file that cannot be decoded counts as one bad picture when there are others.
    """
    from manytouch.errors import SourceError
    from manytouch.sources import open_source
    from manytouch.values import Frame

    for text in texts:
        try:
            source = open_source(text)
        except SourceError:
            if len(texts) == 1 or not Path(text).is_file():
                raise
            yield Path(text).name, Frame(index=0, timestamp_ns=0, camera=text, image=None)
            continue
        if source.capabilities.is_images:
            for path, frame in zip(source.capabilities.files, source, strict=True):
                yield path.name, frame
            continue
        next_ns = None
        for frame in source:
            if next_ns is None or frame.timestamp_ns >= next_ns:
                next_ns = frame.timestamp_ns + int(VIDEO_STEP_S * 1e9)
                yield f"frame {frame.index}", frame


class _Looking:
    """Says while pictures come what is still missing; it has seen enough of a camera once nothing is."""

    def __init__(self, say: Callable[[str], object], stop: Callable[[], bool], *, is_live: bool) -> None:
        self._say, self._stop, self._is_live = say, stop, is_live
        self._said_s = time.monotonic()

    def __call__(self, collection: "ViewCollection", reason: str | None) -> bool:
        missing = collection.missing()
        if time.monotonic() - self._said_s > SAY_EVERY_S or (self._is_live and reason is None):
            self._said_s = time.monotonic()
            last = "" if reason is None else f" (this one {reason})"
            wanted = "; missing: " + "; ".join(missing) if missing else ""
            self._say(f"  {len(collection.views)} good views{last}{wanted}")
        return self._stop() or (self._is_live and not missing)
