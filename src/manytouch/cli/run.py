"""`manytouch run`: live processing of a source."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import method_options, options
from manytouch.source_names import require_existing, unused_rate


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
        options.folder("Also write the tables, to a folder in this one."),
    ] = None,
    record: options.RecordFile = None,
    to: options.OutputUrls = (),
    method: options.MethodName = None,
    pitch_mm: options.PitchMm = None,
    hfov_deg: options.HfovDeg = None,
    roi: options.RoiPx = None,
    fps: options.Fps = None,
    interpolation: method_options.WithInterpolation = method_options.InterpolationOptions(),  # noqa: B008 - immutable
    paper: method_options.Paper = method_options.PaperOptions(),  # noqa: B008 - immutable
    size: options.Size = None,
    exposure_ms: options.ExposureMs = None,
    gain: options.Gain = None,
    focus: options.Focus = None,
    white_balance_K: options.WhiteBalanceK = None,
    no_mjpg: options.NoMjpg = False,
    no_view: options.NoView = False,
    host: options.Host = options.HOST,
    port: options.Port = 0,
    token: options.ViewToken = None,
    max_clients: options.MaxClients = options.MAX_CLIENTS,
) -> int:
    """Process a source live and print the contacts as they start and end.

    Size, rate and exposure are requested from a camera, and the values that it
    reports are printed. If processing is too slow, frames of a camera are dropped
    and counted. Files and the simulated sensor run at their own rate, or at --fps,
    and every frame is processed; a simulated scene (sim:one) ends with its last
    frame, while manytouch demo stays open and can be pressed. Recordings are shown
    as they were stored; with any option about processing or files their frames are
    processed again. In the viewer, a video, images or a recording stay open with a
    timeline until Ctrl-C; with --out or --record it appears once the file has ended
    and what they write is complete. Ctrl-C ends the run with complete files.

    A rig file (.toml) names several sensors, each of which runs in its own process.

    Example: manytouch run 0 --size 2560x1440 --fps 30 --exposure-ms 8
    """
    from manytouch.cli.terminal.outputs import check_outputs, check_urls

    check_urls("run", to)
    check_outputs(out, record)
    options.refuse_unused_viewer("run", no_view, host=host, port=port, token=token, max_clients=max_clients)
    camera_options = {
        "--size": size,
        "--exposure-ms": exposure_ms,
        "--gain": gain,
        "--focus": focus,
        "--white-balance-K": white_balance_K,
        "--no-mjpg": no_mjpg,
    }
    if source.lower().endswith(".toml") and "://" not in source and not source.startswith("sim:"):
        from manytouch.cli.terminal.rig_run import run_rig_file

        given = {
            "--sensor": sensor,
            "--method": method,
            "--pitch-mm": pitch_mm,
            "--hfov-deg": hfov_deg,
            "--roi": roi,
            "--fps": fps,
            **camera_options,
            "--token": token,
            "--host": host != options.HOST,
            "--max-clients": max_clients != options.MAX_CLIENTS,
            "options of a method": interpolation.parameters("run", method) | paper.parameters("run", method),
        }
        return run_rig_file(
            Path(source), given, out=out, record=record, to=to, is_viewing=not no_view, port=port
        )
    options.refuse_two_scales("run", sensor, pitch_mm, hfov_deg)
    options.refuse_camera_options("run", source, camera_options)
    parameters = interpolation.parameters("run", method) | paper.parameters("run", method)
    require_existing([source])
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.cli.terminal.live_run import Outputs, run_live, show_playback
    from manytouch.cli.terminal.viewing import ViewerAddress, is_playback
    from manytouch.session import Live, Playback, prepare, result_name
    from manytouch.sources.cameras.capture import CameraRequest

    reporter = Reporter(bar=False)
    if warning := unused_rate(source, fps):
        reporter.print(f"  warning: {warning}")
    address = None if no_view else ViewerAddress(host=host, port=port, token=token, max_clients=max_clients)
    outputs = Outputs(to=to, address=address, reporter=reporter)
    with StopOnSignal(is_live=True) as stop:
        if is_playback(source, record, out, method, sensor, pitch_mm, hfov_deg, roi, fps, parameters):
            playback = Playback(Path(source), stays=address is not None)
            return show_playback(playback, outputs, stop)
        with stop.at_once():  # a camera that gives no frame is waited for
            job = prepare(
                source,
                sensor=sensor,
                method=method,
                pitch_mm=pitch_mm,
                hfov_deg=hfov_deg,
                roi_px=roi,
                fps=fps,
                parameters=parameters,
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
        if out is None and record is None and outputs.shows_timeline_of(job.source):
            return show_playback(Playback(job, stays=True), outputs, stop)
        folder = None if out is None else out / result_name(source)
        return run_live(Live(job, record=record), folder, outputs, stop)
