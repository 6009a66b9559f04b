"""`manytouch process`: tables of all frames of recordings."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import method_options, options
from manytouch.cli.terminal.failures import report
from manytouch.errors import SourceError, without_password
from manytouch.sinks.files.atomic_output import check_writable
from manytouch.source_names import require_existing


def process(
    inputs: Annotated[
        list[str],
        Parameter(
            name="INPUT", negative=(), help="Video, image, folder of images, .mcap recording, or sim:."
        ),
    ],
    /,
    *,
    out: Annotated[
        Path,
        options.folder("Folder for the results, with one folder per input."),
    ],
    sensor: options.SensorFile = None,
    method: options.MethodName = None,
    surface: options.WithSurface = False,
    annotate: options.Annotate = False,
    picture: options.PictureFrames = None,
    pitch_mm: options.PitchMm = None,
    hfov_deg: options.HfovDeg = None,
    roi: options.RoiPx = None,
    fps: options.Fps = None,
    interpolation: method_options.WithInterpolation = method_options.InterpolationOptions(),  # noqa: B008 - immutable
    paper: method_options.Paper = method_options.PaperOptions(),  # noqa: B008 - immutable
) -> int:
    """Process every frame of recordings of a dotted sheet; write contacts, markers and a summary.

    Polarity, size and layout of the markers are found automatically, and their rest
    positions where the sheet is still. No option is required.

    Example: manytouch process press.mp4 --out results --annotate

    This writes results/press/ with contacts.csv, contact_list.csv, frames.csv,
    markers.parquet and summary.json; with --annotate annotated.mp4, with
    --surface surface.zarr, with --picture 60 picture-000060.png. In the
    repository, docs/columns.md explains every column.
    """
    options.refuse_two_scales("process", sensor, pitch_mm, hfov_deg)
    parameters = interpolation.parameters("process", method) | paper.parameters("process", method)
    check_writable(out)
    missing = missing_inputs(inputs)
    if len(missing) == len(inputs):
        return 1
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.session import prepare, process_job
    from manytouch.session.results import require_finite, result_names

    failed = len(missing)
    with StopOnSignal() as stop:
        for text, name in zip(inputs, result_names(inputs), strict=True):
            if stop():
                break
            if text in missing:
                continue
            reporter = Reporter()
            try:
                with reporter:
                    reporter.print(without_password(text), heading=True)
                    require_finite(text)
                    job = prepare(
                        text,
                        sensor=sensor,
                        method=method,
                        pitch_mm=pitch_mm,
                        hfov_deg=hfov_deg,
                        roi_px=roi,
                        fps=fps,
                        parameters=parameters,
                        whole_recording=True,
                        observer=reporter,
                    )
                    if stop():
                        reporter.print(f"stopped before the first frame: nothing was written to {out / name}")
                        break
                    files = process_job(
                        job,
                        out / name,
                        surface=surface,
                        annotate=annotate,
                        pictures=picture or (),
                        observer=reporter,
                        stop=stop,
                    )
                reporter.finish(
                    files.summary,
                    out / name,
                    is_complete=files.is_complete,
                    contacts=files.contact_list,
                )
                for frame in [] if files.pictures is None else files.pictures.missing:
                    print(
                        f"warning: no image of frame {frame}: the input has no decoded frame of this number",
                        file=sys.stderr,
                    )
            except Exception as error:  # noqa: BLE001 - the other inputs are processed all the same
                shown = without_password(text)
                report(error, "" if len(inputs) == 1 or shown in str(error) else f"{shown}: ")
                failed += 1
    return 1 if failed else 0


def missing_inputs(inputs: Sequence[str]) -> list[str]:
    """The inputs that do not exist, each of which is reported."""
    missing = []
    for text in inputs:
        try:
            require_existing([text])
        except SourceError as error:
            report(error)
            missing.append(text)
    return missing
