"""`manytouch calibrate`: camera, rest and sheet."""

import time
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from manytouch.cli.terminal import options
from manytouch.cli.terminal.failures import usage_error, usage_errors
from manytouch.sinks.files.atomic_output import check_file_writable, check_writable
from manytouch.source_names import require_existing, views_of

if TYPE_CHECKING:
    from manytouch.calibration.camera.board_views import ViewCollection
    from manytouch.values import Sensor

app = App(name="calibrate", help="Calibrate camera, rest and sheet.")

PROGRESS_EVERY_S = 2.0
CANDIDATE_FRAMES = 90
"""First frames of a recording, among which `calibrate rest` selects those at rest."""


@app.command
def camera(
    images: Annotated[
        list[str],
        Parameter(name="IMAGES", negative=(), help="Images, folders of images, a video, or a camera."),
    ],
    /,
    *,
    board: Annotated[
        str,
        Parameter(
            metavar="KIND:CxR",
            help="chessboard:9x6 (inner corners), charuco:8x6 (squares), circles:9x6 or "
            "circles-asymmetric:4x11. The markers of charuco are of DICT_4X4_250; others are named at the "
            "end, as in charuco:8x6:DICT_5X5_100.",
        ),
    ],
    square_mm: Annotated[
        float, Parameter(metavar="MM", help="Side of a square, or distance between neighbouring circles.")
    ],
    out: Annotated[Path, Parameter(metavar="FILE", help="Sensor file to write; it contains [camera] only.")],
    model: Annotated[Literal["pinhole", "fisheye"], Parameter(help="Lens model.")] = "pinhole",
    report: Annotated[
        Path | None,
        options.folder("Folder for coverage.png, calibration.json and camera_info.yaml (ROS)."),
    ] = None,
    name: Annotated[str, Parameter(help="Name of the camera.")] = "camera",
) -> int:
    """Calibrate a camera from views of a board, and report how accurate the result is.

    Sharp views that differ from each other are selected automatically. Images that
    are refused are listed with the reason, and missing views are reported during
    the search. Use 15 views or more: tilted in different directions, near and far,
    in the centre and in every corner.

    Example: manytouch calibrate camera views/*.jpg --board chessboard:9x6 --square-mm 25 --out camera.toml
    """
    from rich.console import Console

    from manytouch.calibration.camera.board import parse_board
    from manytouch.calibration.camera.calibrate import calibrate_camera
    from manytouch.calibration.camera.named_images import named_images
    from manytouch.calibration.camera.report import calibrated_camera, describe, write_report
    from manytouch.cli.terminal.console import Steps
    from manytouch.cli.terminal.interrupt import StopOnSignal

    console = Console(highlight=False, soft_wrap=True)
    with usage_errors("calibrate camera"):
        wanted = parse_board(board, square_mm)
    check_file_writable(out)
    if report is not None:
        check_writable(report)
    with StopOnSignal() as stop, Steps() as steps:
        look = _ViewProgress(steps.print, stop, is_live=any(not Path(text).exists() for text in images))
        views = steps.count("images", named_images(images), None)
        found = calibrate_camera(views, wanted, model=model, on_view=look)
    for line in describe(found):
        console.print(f"  {line}", markup=False)
    if report is not None:
        write_report(found, report, name)
        console.print(f"  report in {report}", markup=False)
    _save(calibrated_camera(found, name), out)
    console.print(f"  camera in {out}", markup=False)
    return 0


@app.command
def rest(
    source: Annotated[
        str,
        Parameter(
            name="SOURCE",
            negative=(),
            help="Recording or camera that shows the untouched sheet; of a recording, some still frames are "
            "enough.",
        ),
    ],
    /,
    *,
    sensor: Annotated[
        str | None,
        Parameter(
            metavar="FILE",
            help="Sensor file with [camera], required; [markers] and [sheet] are optional. calibrate "
            "camera makes "
            "it; of a sensor that you bought, its name, such as gelsight-mini.",
        ),
    ] = None,
    out: Annotated[Path, Parameter(metavar="FILE", help="Sensor file to write.")],
    pitch_mm: options.PitchMm = None,
    sheet_mm: Annotated[
        Any,
        Parameter(
            converter=options.pair("X,Y"),
            n_tokens=1,
            allow_leading_hyphen=True,
            metavar="X,Y",
            help="Size of the clamped outline, if neither the file nor the image gives it.",
        ),
    ] = None,
    thickness_mm: Annotated[
        Any,
        Parameter(
            metavar="MM",
            converter=options.positive("a thickness in mm"),
            n_tokens=1,
            help="Thickness of the sheet; without --sheet-mm the outline is measured in the image.",
        ),
    ] = None,
    roi: options.RoiPx = None,
) -> int:
    """Estimate the pose of the sheet, its layout and the noise from a few seconds at rest.

    Reports the residual from a flat lattice, missing markers, noise, the clamp
    line, and warnings such as a sheet that is not flat, markers that are cut off,
    or a wrong scale. A bonded pad is measured through its window: its pose with
    the tilt by the glue, and its outline where the image shows it.

    Example: manytouch calibrate rest rest.mp4 --sensor camera.toml --pitch-mm 4 --out sensor.toml
    """
    if sensor is None:
        raise usage_error(
            "calibrate rest",
            "specify --sensor FILE with [camera]: manytouch calibrate camera makes it from views of a "
            "board; of a sensor that you bought give its name, such as gelsight-mini",
        )
    if sheet_mm is not None and thickness_mm is None:
        raise usage_error("calibrate rest", "--sheet-mm requires --thickness-mm")
    check_file_writable(out)
    require_existing([source])
    from rich.console import Console

    from manytouch.calibration.sensor_at_rest import calibrate_sensor_at_rest, candidate_frames, stated_sheet
    from manytouch.cli.terminal.console import Steps
    from manytouch.sources import closing_source, open_source
    from manytouch.values.sensor_file.read import load_sensor

    console = Console(highlight=False, soft_wrap=True, markup=False)
    known = load_sensor(sensor)
    if known.camera.views and (
        pitch_mm is not None or roi is not None or (thickness_mm is not None) > (sheet_mm is not None)
    ):
        raise usage_error(
            "calibrate rest",
            "several views take pitch and outline from the sensor file: omit --pitch-mm and --roi, and give "
            "--thickness-mm only with --sheet-mm",
        )
    sheet = stated_sheet(known, sheet_mm, thickness_mm)
    with Steps() as steps, closing_source(open_source(source)) as frames:
        first = list(steps.count("frames", islice(frames, CANDIDATE_FRAMES), CANDIDATE_FRAMES))
        steps.step_reporter()("finding the markers, the frames at rest and the pose of the sheet")
        name = ", ".join(Path(part).name for part in views_of(source))
        candidates = candidate_frames(known, frames, first, pitch_mm=pitch_mm, sheet=sheet, roi_px=roi)
        lines, calibrated = calibrate_sensor_at_rest(
            known,
            candidates.frames,
            name,
            pitch_mm=pitch_mm,
            sheet=sheet,
            thickness_mm=thickness_mm,
            roi_px=roi,
            doubts=candidates.doubts,
        )
    for line in (*candidates.notes, *lines):
        console.print(f"  {line}")
    _save(calibrated, out)
    console.print(f"  sensor in {out}")
    return 0


@app.command
def sheet(
    presses: Annotated[
        str | None,
        Parameter(
            name="PRESSES",
            negative=(),
            help="CSV table of presses; or a recording or a camera, with prompts. Not with --plan.",
        ),
    ] = None,
    /,
    *,
    sensor: Annotated[str, Parameter(metavar="FILE", help="Sensor file with [markers] and [sheet].")],
    out: Annotated[Path | None, Parameter(metavar="FILE", help="Sensor file to write.")] = None,
    plan: Annotated[
        Path | None,
        options.folder(
            "Only write presses.csv for weights and probing.gcode for a 3-D printer to this folder."
        ),
    ] = None,
    fps: options.Fps = None,
) -> int:
    """Estimate properties of a sheet from presses at known places.

    Of a clamped sheet: pretension, bending factor, thickness, outline, stiffness.
    Of a bonded pad: stiffness, thickness and depth of the markers, from two or
    more presses with a force.

    The table has the columns input, time_s, x_mm, y_mm, radius_mm, normal_force_N.
    Each recording starts with the untouched sheet; time_s is the time at which a
    press is held (empty: the end of the recording); images without a rate count as
    30 frames per second unless --fps gives another. The stiffness requires at least
    one force in N. A weight on a tilted sensor has weight_N, tilt_x_deg and
    tilt_y_deg (of the axes below the horizontal) instead of normal_force_N.
    --plan writes such a table for weights of 50, 100 and 200 g. For a recording or
    a camera the presses are entered at prompts, and are saved as a table next to
    the new sensor file.

    Example: manytouch calibrate sheet presses.csv --sensor sensor.toml --out calibrated.toml
    Example: manytouch calibrate sheet presses.mp4 --sensor sensor.toml --out calibrated.toml
    """
    if plan is None and (presses is None or out is None):
        raise usage_error(
            "calibrate sheet",
            "specify a table of presses (or a recording or a camera) and --out FILE, or --plan DIR for a "
            "table to fill in",
        )
    if out is not None:
        check_file_writable(out)
    if plan is not None:
        check_writable(plan)
    require_existing([] if presses is None or plan is not None else [presses])
    from rich.console import Console

    from manytouch.calibration.sheet.calibrate import calibrate_sheet
    from manytouch.calibration.sheet.describe_calibration import describe, with_provenance
    from manytouch.calibration.sheet.pad import calibrate_pad
    from manytouch.calibration.sheet.press_plan import write_plan
    from manytouch.calibration.sheet.press_table import PressRow, measure_presses, read_press_table
    from manytouch.calibration.sheet.typed_presses import read_typed_presses
    from manytouch.cli.terminal.console import Steps
    from manytouch.values.sensor_file.read import load_sensor

    console = Console(highlight=False, soft_wrap=True, markup=False)
    known = load_sensor(sensor)
    if plan is not None:
        write_plan(known, plan)
        console.print(f"  plan in {plan}")
        return 0
    assert presses is not None
    assert out is not None
    if presses.lower().endswith(".csv"):
        table = Path(presses)
        rows: tuple[PressRow, ...] | None = read_press_table(table)
    else:
        table = out.with_name(f"{out.stem}-presses.csv")
        rows = read_typed_presses(
            known, presses, table, report=lambda text: console.print(f"  {text}"), fps=fps
        )
    if rows is None:
        return 0
    is_pad = known.sheet is not None and known.sheet.boundary == "bonded"
    with Steps() as steps:
        measured = measure_presses(known, steps.count("presses", rows, len(rows)), table.parent, fps)
        steps.step_reporter()("fitting the sheet")
        found = (calibrate_pad if is_pad else calibrate_sheet)(known, measured)
    for line in describe(found):
        console.print(f"  {line}")
    _save(with_provenance(known, found, table.name), out)
    console.print(f"  sensor in {out}")
    return 0


class _ViewProgress:
    """Prints which views are missing; ends the search of a camera when none is."""

    def __init__(self, report: Callable[[str], object], stop: Callable[[], bool], *, is_live: bool) -> None:
        self._report, self._stop, self._is_live = report, stop, is_live
        self._reported_s = time.monotonic()

    def __call__(self, collection: "ViewCollection", reason: str | None) -> bool:
        missing = collection.missing()
        if time.monotonic() - self._reported_s > PROGRESS_EVERY_S or (self._is_live and reason is None):
            self._reported_s = time.monotonic()
            last = "" if reason is None else f" (last image: {reason})"
            wanted = "; missing: " + "; ".join(missing) if missing else ""
            self._report(f"  {len(collection.views)} good views{last}{wanted}")
        return self._stop() or (self._is_live and not missing)


def _save(sensor: "Sensor", path: Path) -> None:
    """Write a sensor file, and its folder."""
    from manytouch.values.sensor_file.write import save_sensor

    path.parent.mkdir(parents=True, exist_ok=True)
    save_sensor(sensor, path)
