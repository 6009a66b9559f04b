"""`manytouch run`: live processing of a source."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import method_options, options
from manytouch.source_names import require_existing

if TYPE_CHECKING:
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.viewing import ViewerAddress
    from manytouch.session import Playback, StopCondition


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
    host: options.Host = "127.0.0.1",
    port: options.Port = 0,
    token: options.ViewToken = None,
    max_clients: options.MaxClients = 16,
) -> int:
    """Process a source live and print the contacts as they start and end.

    Size, rate and exposure are requested from a camera, and the values that it
    reports are printed. If processing is too slow, frames of a camera are dropped
    and counted. Files and the simulated sensor run at their own rate, or at --fps,
    and every frame is processed; a simulated scene (sim:one) ends with its last
    frame, while manytouch demo stays open and can be pressed. Recordings are shown
    as they were stored; with any option about processing or files their frames are
    processed again. In the viewer, a video, images or a recording stay open with a
    timeline until Ctrl-C, unless --out or --record write files of it. Ctrl-C ends
    the run with complete files.

    A rig file (.toml) names several sensors, each of which runs in its own process.

    Example: manytouch run 0 --size 2560x1440 --fps 30 --exposure-ms 8
    """
    from manytouch.cli.terminal.outputs import check_outputs, check_urls

    check_urls("run", to)
    check_outputs(out, record)
    if source.lower().endswith(".toml") and "://" not in source and not source.startswith("sim:"):
        from manytouch.cli.terminal.rig_run import run_rig_file

        given = {"--sensor": sensor, "--method": method, "--pitch-mm": pitch_mm, "--hfov-deg": hfov_deg}
        given |= {"--roi": roi, "--fps": fps, "--size": size, "--token": token}
        given |= {"--exposure-ms": exposure_ms, "--gain": gain, "--focus": focus, "--no-mjpg": no_mjpg}
        given |= {"--white-balance-K": white_balance_K, "--host": host != "127.0.0.1"}
        given |= {"--max-clients": max_clients != 16}
        given |= {
            "options of a method": interpolation.parameters("run", method) | paper.parameters("run", method)
        }
        return run_rig_file(
            Path(source), given, out=out, record=record, to=to, is_viewing=not no_view, port=port
        )
    options.refuse_two_scales("run", sensor, pitch_mm, hfov_deg)
    parameters = interpolation.parameters("run", method) | paper.parameters("run", method)
    require_existing([source])
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.contact_log import ContactLog
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.cli.terminal.outputs import described_outputs, print_end_of_scene, print_outputs
    from manytouch.cli.terminal.viewing import ViewerAddress, is_playback, viewers
    from manytouch.session import Live, Playback, ResultFiles, prepare, result_name
    from manytouch.session import run as run_loop
    from manytouch.session.diagnosis.camera import describe_latency, describe_settings
    from manytouch.sources.cameras.capture import CameraRequest
    from manytouch.sources.files.frame_timeline import frame_timeline

    reporter = Reporter(bar=False)
    address = None if no_view else ViewerAddress(host=host, port=port, token=token, max_clients=max_clients)
    with StopOnSignal() as stop:
        if is_playback(source, record, out, method, sensor, pitch_mm, hfov_deg, roi, fps, parameters):
            playback = Playback(Path(source), stays=address is not None)
            return show_playback(playback, to, address, reporter, stop)
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
        if address is not None and out is None and record is None and frame_timeline(job.source) is not None:
            return show_playback(Playback(job, stays=True), to, address, reporter, stop)
        log = ContactLog(job.sensor, reporter.print, job.source.capabilities.truth)
        live = Live(job, record=record)
        print_end_of_scene(job.source, reporter.print)
        live.attach(described_outputs(to, live, reporter.print))
        for line in describe_settings(live.health().settings):
            reporter.print(line)
        if out is None:
            run_loop(live, [log, *viewers(live, address, reporter.print)], reporter, stop)
            reporter.print(describe_latency(live.health()))
            print_outputs(live.health(), reporter.print)
            return 0
        folder = out / result_name(source)
        with ResultFiles(folder, job, is_repeatable=False, warnings=lambda: live.warnings) as files:
            shown = viewers(live, address, reporter.print)
            files.is_complete = run_loop(live, [*files.sinks, log, *shown], reporter, stop)
            files.is_repeatable = live.is_repeatable
    reporter.print(describe_latency(live.health()))
    print_outputs(live.health(), reporter.print)
    reporter.finish(files.summary, folder, is_complete=files.is_complete)
    return 0


def show_playback(
    playback: "Playback",
    to: Sequence[str],
    address: "ViewerAddress | None",
    reporter: "Reporter",
    stop: "StopCondition",
) -> int:
    """Show a recording, a video or images with a timeline; with a viewer until Ctrl-C."""
    from manytouch.cli.terminal.contact_log import ContactLog
    from manytouch.cli.terminal.outputs import described_outputs, print_outputs
    from manytouch.cli.terminal.viewing import viewers
    from manytouch.session import run as run_loop

    playback.attach(described_outputs(to, playback, reporter.print))
    log = ContactLog(playback.sensor, reporter.print)
    shown = viewers(playback, address, reporter.print)
    if shown:
        reporter.print("it stays open with a timeline until Ctrl-C")
    run_loop(playback, [log, *shown], reporter, stop)
    print_outputs(playback.health(), reporter.print)
    return 0
