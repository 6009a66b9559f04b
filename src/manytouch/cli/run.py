"""`manytouch run`: a source at its own pace, contacts as they come and go."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli import options


def run(
    source: Annotated[str, Parameter(help="Video, image, folder of images, or sim:.")],
    /,
    *,
    sensor: options.SensorFile = None,
    out: Annotated[
        Path | None,
        options.folder("Also write the tables, into a folder in this one."),
    ] = None,
    method: options.MethodName = None,
    pitch_mm: options.PitchMm = None,
    hfov_deg: options.HfovDeg = None,
    roi: options.RoiPx = None,
    fps: options.Fps = None,
    no_view: Annotated[
        bool,
        Parameter(
            negative=(),
            show_default=False,
            help="Without viewer; this release has none, so it changes nothing.",
        ),
    ] = False,
) -> int:
    """Read a source at its own pace and print contacts as they come and go.

    Files and the simulated sensor in this release, paced at their own rate or at
    --fps; every frame is read, so a slow machine falls behind instead of dropping
    any. Ctrl-C ends it, with complete files.

    Example: manytouch run press.mp4 --out results
    """
    from manytouch.cli.console import Reporter
    from manytouch.cli.contact_log import ContactLog
    from manytouch.cli.stopping import Stop
    from manytouch.session import Live, files_in, prepare, result_name

    reporter = Reporter(bar=False)
    with Stop() as stop:
        job = prepare(
            source,
            sensor=sensor,
            method=method,
            pitch_mm=pitch_mm,
            hfov_deg=hfov_deg,
            roi_px=roi,
            fps=fps,
            progress=reporter,
        )
        log = ContactLog(job.sensor, reporter.say, getattr(job.source, "truth", None))
        live = Live(job)
        if out is None:
            live.run([log], progress=reporter, stop=stop)
            return 0
        folder = out / result_name(source)
        files, summary = files_in(folder, job)
        live.run([*files, log, summary], progress=reporter, stop=stop)
    reporter.finish(summary, folder)
    return 0
