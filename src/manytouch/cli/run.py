"""`manytouch run`: a source at its own pace, contacts as they come and go."""

import dataclasses
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from manytouch.cli import options

if TYPE_CHECKING:
    from manytouch.values import Frame

LONGEST_NAP_S = 0.05


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
    from manytouch.session import prepare, read_all, read_into, result_name

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
        job = dataclasses.replace(job, frames=paced(job.frames, stop))
        log = ContactLog(job.sensor, reporter.say, getattr(job.source, "truth", None))
        if out is None:
            read_all(job, [log], progress=reporter, stop=stop)
            return 0
        folder = out / result_name(source)
        summary = read_into(job, folder, sinks=[log], progress=reporter, stop=stop)
    reporter.finish(summary, folder)
    return 0


def paced(frames: Iterable["Frame"], stop: Callable[[], bool]) -> Iterator["Frame"]:
    """Hold each frame back until its time has come, counted from the first; not after `stop`."""
    begun_s: float | None = None
    for frame in frames:
        due_s = frame.timestamp_ns * 1e-9
        if begun_s is None:
            begun_s = time.monotonic() - due_s
        while (wait_s := begun_s + due_s - time.monotonic()) > 0 and not stop():
            time.sleep(min(wait_s, LONGEST_NAP_S))
        yield frame
