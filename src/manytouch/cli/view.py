"""`manytouch view`: playback of a recording, a video or images in the viewer."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options
from manytouch.source_names import require_existing


def view(
    recording: Annotated[
        Path,
        Parameter(
            metavar="FILE", help="Recording of manytouch run --record, a video, or a folder of images."
        ),
    ],
    /,
    *,
    sensor: options.SensorFile = None,
    method: options.MethodName = None,
    pitch_mm: options.PitchMm = None,
    hfov_deg: options.HfovDeg = None,
    roi: options.RoiPx = None,
    fps: options.Fps = None,
    host: options.Host = options.HOST,
    port: options.Port = 0,
    token: options.ViewToken = None,
    max_clients: options.MaxClients = options.MAX_CLIENTS,
) -> int:
    """Play back a recording, a video or images in the viewer, with a timeline, until Ctrl-C.

    With --method or another option about processing, the frames of a recording are
    processed again, and the viewer shows the recorded readings for comparison.

    Example: manytouch view press.mcap --method paper
    """
    options.refuse_two_scales("view", sensor, pitch_mm, hfov_deg)
    require_existing([recording])
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.cli.terminal.viewing import ViewerAddress, is_playback, viewers
    from manytouch.errors import MissingExtraError
    from manytouch.session import Playback, prepare, run

    reporter = Reporter(bar=False)
    with StopOnSignal(is_live=True) as stop:
        if not is_playback(str(recording), pitch_mm, hfov_deg, roi, fps):
            job = prepare(
                recording,
                sensor=sensor,
                method=method,
                pitch_mm=pitch_mm,
                hfov_deg=hfov_deg,
                roi_px=roi,
                fps=fps,
                observer=reporter,
            )
            playback = Playback(job, stays=True)
        else:
            playback = Playback(recording, method=method, sensor=sensor, stays=True)
        shown = viewers(
            playback,
            ViewerAddress(host=host, port=port, token=token, max_clients=max_clients),
            reporter.print,
        )
        if not shown:
            raise MissingExtraError("the viewer", "nicegui")
        reporter.print("it stays open with a timeline until Ctrl-C")
        run(playback, shown, reporter, stop)
    return 0
