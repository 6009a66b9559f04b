"""`manytouch run`: a source at its own pace, contacts as they come and go."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options


def run(
    source: Annotated[
        str,
        Parameter(help=options.SOURCE_WORDS),
    ],
    /,
    *,
    sensor: options.SensorFile = None,
    out: Annotated[
        Path | None,
        options.folder("Also write the tables, into a folder in this one."),
    ] = None,
    record: options.RecordFile = None,
    method: options.MethodName = None,
    pitch_mm: options.PitchMm = None,
    hfov_deg: options.HfovDeg = None,
    roi: options.RoiPx = None,
    fps: options.Fps = None,
    size: options.Size = None,
    exposure_ms: options.ExposureMs = None,
    gain: options.Gain = None,
    focus: options.Focus = None,
    white_balance_K: options.WhiteBalanceK = None,
    no_mjpg: options.NoMjpg = False,
    no_view: options.NoView = False,
    host: options.Host = "127.0.0.1",
    port: options.Port = 0,
    token: options.ViewToken = None,
) -> int:
    """Read a source at its own pace and print contacts as they come and go.

    A camera is asked for size, rate and light, and what it says is printed. When
    reading is too slow whole frames of a camera are dropped, and counted; files and
    the simulated sensor keep their own pace, or --fps, and every frame is read.
    A recording gives its stored readings; with any option about reading or files
    its frames are read anew. Ctrl-C ends it, with complete files.

    Example: manytouch run 0 --size 2560x1440 --fps 30 --exposure-ms 8
    """
    options.refuse_two_scales("run", sensor, pitch_mm, hfov_deg)
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.contact_log import ContactLog
    from manytouch.cli.terminal.interrupt import Stop
    from manytouch.cli.terminal.viewing import ViewerAddress, viewers
    from manytouch.session import Live, Playback, prepare, result_name, result_sinks
    from manytouch.session import run as run_loop
    from manytouch.session.diagnosis.camera import describe_latency, describe_settings
    from manytouch.sources.cameras.capture import CameraRequest

    reporter = Reporter(bar=False)
    place = None if no_view else ViewerAddress(host=host, port=port, token=token)
    with Stop() as stop:
        if is_stored(source, record, out, method, sensor, pitch_mm, hfov_deg, roi, fps):
            playback = Playback(Path(source))
            log = ContactLog(playback.sensor, reporter.say)
            run_loop(playback, [log, *viewers(playback, place, reporter.say)], reporter, stop)
            return 0
        job = prepare(
            source,
            sensor=sensor,
            method=method,
            pitch_mm=pitch_mm,
            hfov_deg=hfov_deg,
            roi_px=roi,
            fps=fps,
            camera=CameraRequest(
                size_px=size,
                is_mjpg=not no_mjpg,
                exposure_ms=exposure_ms,
                gain=gain,
                focus=focus,
                white_balance_K=white_balance_K,
            ),
            observer=reporter,
        )
        log = ContactLog(job.sensor, reporter.say, job.source.capabilities.truth)
        live = Live(job, record=record)
        for line in describe_settings(live.health().settings):
            reporter.say(line)
        if out is None:
            run_loop(live, [log, *viewers(live, place, reporter.say)], reporter, stop)
            reporter.say(describe_latency(live.health()))
            return 0
        folder = out / result_name(source)
        files, summary = result_sinks(folder, job)
        shown = viewers(live, place, reporter.say)
        run_loop(live, [*files, log, *shown, summary], reporter, stop)
    reporter.say(describe_latency(live.health()))
    reporter.finish(summary, folder)
    return 0


def is_stored(source: str, *asked: object) -> bool:
    """Is it a recording of which nothing is asked but what it holds?"""
    return source.lower().endswith(".mcap") and not any(asked)
