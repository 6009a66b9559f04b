"""`manytouch process`: every frame of recordings into tables."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options


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
        options.folder("Folder for the results; each input gets a folder in it."),
    ],
    sensor: options.SensorFile = None,
    method: options.MethodName = None,
    surface: Annotated[bool, options.switch("Also write the depth map, surface.zarr.")] = False,
    annotate: Annotated[
        bool,
        options.switch("Also draw markers and contacts into the pictures."),
    ] = False,
    picture: options.PictureFrames = None,
    pitch_mm: options.PitchMm = None,
    hfov_deg: options.HfovDeg = None,
    roi: options.RoiPx = None,
    fps: options.Fps = None,
) -> int:
    """Read every frame of videos or pictures of a dotted sheet; write contacts, markers and a summary.

    Markers, their polarity and their arrangement are found in the first frames,
    so the sheet should be untouched there. Nothing needs to be set.

    Example: manytouch process press.mp4 --out results --annotate

    It leaves results/press/ with contacts.csv, markers.parquet, frames.csv and
    summary.json; with --annotate annotated.mp4, with --surface surface.zarr, with
    --picture 60 picture-000060.png.
    """
    options.refuse_two_scales("process", sensor, pitch_mm, hfov_deg)
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.failures import report
    from manytouch.cli.terminal.interrupt import Stop
    from manytouch.session import prepare, process_job
    from manytouch.sinks.pictures.surface_picture import SelectedFrames

    failed = 0
    with Stop() as stop:
        for text, name in zip(inputs, folder_names(inputs), strict=True):
            if stop():
                break
            reporter = Reporter()
            try:
                with reporter:
                    reporter.say(text, heading=True)
                    refuse_endless(text)
                    job = prepare(
                        text,
                        sensor=sensor,
                        method=method,
                        pitch_mm=pitch_mm,
                        hfov_deg=hfov_deg,
                        roi_px=roi,
                        fps=fps,
                        observer=reporter,
                    )
                    if stop():
                        break
                    folder = out / name
                    moments = SelectedFrames(folder, job.sensor, picture) if picture else None
                    summary = process_job(
                        job,
                        folder,
                        surface=surface,
                        annotate=annotate,
                        sinks=[] if moments is None else [moments],
                        observer=reporter,
                        stop=stop,
                    )
                reporter.finish(summary, out / name)
                for frame in [] if moments is None else moments.missing:
                    reporter.say(
                        f"no picture of frame {frame}: none was read that has this number and an image"
                    )
            except Exception as error:  # noqa: BLE001 - the other inputs are not to suffer from it
                report(error)
                failed += 1
    return 1 if failed else 0


def refuse_endless(text: str) -> None:
    """Cameras and streams have no end.

    Raises:
        SourceError: it is one.
    """
    from manytouch.errors import SourceError
    from manytouch.sources.cameras.camera import without_password
    from manytouch.sources.opening import is_camera

    if is_camera(text):
        raise SourceError(
            f"{without_password(text)!r} is a camera or a stream, which has no end: use manytouch run, and "
            "record it with --record to process it later"
        )


def folder_names(inputs: list[str]) -> list[str]:
    """One folder name per input: its stem, or stem-2, stem-3 where it is taken (a, b, a: a, b, a-2)."""
    from manytouch.session import result_name

    taken: set[str] = set()
    names = []
    for text in inputs:
        stem = result_name(text)
        name, number = stem, 1
        while name.casefold() in taken:
            number += 1
            name = f"{stem}-{number}"
        taken.add(name.casefold())
        names.append(name)
    return names
