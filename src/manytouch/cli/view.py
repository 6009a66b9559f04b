"""`manytouch view`: playback of a recording in the viewer."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options


def view(
    recording: Annotated[Path, Parameter(metavar="FILE.mcap", help="Recording of manytouch run --record.")],
    /,
    *,
    sensor: options.SensorFile = None,
    method: options.MethodName = None,
    host: options.Host = "127.0.0.1",
    port: options.Port = 0,
    token: options.ViewToken = None,
    max_clients: options.MaxClients = 16,
) -> int:
    """Play back a recording in the viewer, with a timeline, until Ctrl-C.

    With --method or --sensor its frames are processed again, and the viewer shows
    the recorded readings for comparison.

    Example: manytouch view press.mcap --method paper
    """
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.cli.terminal.viewing import ViewerAddress, viewers
    from manytouch.errors import MissingExtraError
    from manytouch.session import Playback, run

    reporter = Reporter(bar=False)
    with StopOnSignal() as stop:
        playback = Playback(recording, method=method, sensor=sensor, stays=True)
        shown = viewers(
            playback,
            ViewerAddress(host=host, port=port, token=token, max_clients=max_clients),
            reporter.print,
        )
        if not shown:
            raise MissingExtraError("the viewer", "nicegui")
        run(playback, shown, reporter, stop)
    return 0
