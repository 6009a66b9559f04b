"""`manytouch demo`: the main job on the simulated sensor."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from manytouch.cli.terminal import options

if TYPE_CHECKING:
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.viewing import ViewerAddress
    from manytouch.session import ResultFiles
    from manytouch.sinks.pictures.surface_picture import BusiestFrame

DEFAULT_SECONDS = 10.0
MAX_TABLE_SECONDS = 300.0
"""Sensor time in the tables of a demo that lasts until Ctrl-C; about 90 MB."""


def demo(
    *,
    seconds: Annotated[
        Any,
        Parameter(
            converter=options.positive("a number of seconds"),
            n_tokens=1,
            help="Sensor time to simulate. [default: until Ctrl-C; 10 without viewer and --to]",
            show_default=False,
        ),
    ] = None,
    scene: Annotated[
        str,
        Parameter(help="Built-in scene, such as skin (two cameras on one sheet), or a scene file."),
    ] = "",
    to: options.OutputUrls = (),
    no_view: options.NoView = False,
    out: Annotated[Path, options.folder("Folder for tables and images.")] = Path("out/demo"),
    host: options.Host = options.HOST,
    port: options.Port = 0,
    token: options.ViewToken = None,
    max_clients: options.MaxClients = options.MAX_CLIENTS,
) -> int:
    """Press a simulated sensor with several fingers, and estimate the contacts from its images.

    The viewer shows surface, contacts and ground truth in the browser until
    Ctrl-C; the mouse presses the sheet. With --no-view or --seconds the demo ends
    by itself; with --to it sends readings to other programs until Ctrl-C, also
    without the viewer. Writes the tables of manytouch process and an image of the
    surface; until Ctrl-C, the tables contain the first five minutes.

    Example: manytouch demo --seconds 5
    """
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.outputs import check_urls
    from manytouch.sinks.files.atomic_output import check_writable

    options.refuse_unused_viewer("demo", no_view, host=host, port=port, token=token, max_clients=max_clients)
    check_urls("demo", to)
    check_writable(out)
    reporter = Reporter(bar=False)
    what = f"scene {scene}" if scene else "pressed by several fingers at once"
    reporter.print(f"simulated sensor, {what}", heading=True)
    if not no_view and find_spec("nicegui") is None:
        reporter.print("no viewer: it requires the package nicegui: run pip install manytouch")
        no_view = True
    if no_view and not to:
        _process(scene, seconds or DEFAULT_SECONDS, out, reporter)
    else:
        from manytouch.cli.terminal.viewing import ViewerAddress

        address = ViewerAddress(host=host, port=port, token=token, max_clients=max_clients)
        _serve(scene, seconds, out, reporter, address=None if no_view else address, to=to)
    return 0


def _process(scene: str, seconds: float, out: Path, reporter: "Reporter") -> None:
    """Process some seconds as fast as possible."""
    from manytouch.cli.terminal.contact_log import ContactLog
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.session import ResultFiles, prepare, run
    from manytouch.sinks.pictures.surface_picture import BusiestFrame
    from manytouch.sources.simulated import simulated_source

    with StopOnSignal() as stop:
        source = simulated_source(scene).lasting(seconds)
        job = prepare(source, observer=reporter)
        log = ContactLog(job.sensor, reporter.print, source.truth)
        busiest = BusiestFrame(job.sensor)
        with ResultFiles(out, job, annotate=True) as files:
            files.is_complete = run(job, [*files.sinks, log, busiest], reporter, stop)
            is_drawn = _draw(busiest, files, reporter)
    _finish(files, out, is_drawn, reporter)


def _serve(
    scene: str,
    seconds: float | None,
    out: Path,
    reporter: "Reporter",
    *,
    address: "ViewerAddress | None",
    to: Sequence[str],
) -> None:
    """Run at the rate of the sensor; the tables contain the first seconds only, as disks are finite."""
    from manytouch.cli.terminal.contact_log import ContactLog
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.cli.terminal.outputs import described_outputs, print_outputs
    from manytouch.cli.terminal.viewing import viewers
    from manytouch.session import Live, ResultFiles, prepare, run
    from manytouch.sinks.first_seconds import FirstSeconds
    from manytouch.sinks.pictures.surface_picture import BusiestFrame
    from manytouch.sources.pressed.pressed_process import PressedProcess

    with StopOnSignal(is_live=True) as stop:
        source = PressedProcess(scene, seconds=seconds)
        job = prepare(source, method="mechanics", observer=reporter)
        live = Live(job, recordings=out)
        live.attach(described_outputs(to, live, reporter.print))
        log = ContactLog(job.sensor, reporter.print, source.truth)
        busiest = BusiestFrame(job.sensor)
        with ResultFiles(out, job, is_repeatable=False, warnings=lambda: live.warnings) as files:
            limited = [FirstSeconds(sink, seconds or MAX_TABLE_SECONDS) for sink in (*files.sinks, busiest)]
            shown = viewers(live, address, reporter.print)
            files.is_complete = run(live, [log, *limited, *shown], reporter, stop)
            files.is_repeatable = live.is_repeatable
            is_drawn = _draw(busiest, files, reporter)
    print_outputs(live.health(), reporter.print)
    _finish(files, out, is_drawn, reporter)
    if live.health().frames > files.summary.frames:
        reporter.print(
            f"the tables contain the first {MAX_TABLE_SECONDS:g} s; manytouch run --record saves all frames"
        )


def _draw(busiest: "BusiestFrame", files: "ResultFiles", reporter: "Reporter") -> bool:
    """Draw the frame with the most contacts, if the packages for it are installed."""
    from manytouch.errors import MissingExtraError

    try:
        return busiest.draw(files.folder.partial_path / "picture.png") is not None
    except MissingExtraError as error:
        reporter.print(f"no image of the surface: {error}")
        return False


def _finish(files: "ResultFiles", out: Path, is_drawn: bool, reporter: "Reporter") -> None:
    reporter.finish(files.summary, out, is_complete=files.is_complete)
    if is_drawn:
        reporter.print(f"image of the frame with the most contacts in {out / 'picture.png'}")
