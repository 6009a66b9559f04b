"""`manytouch demo`: the main job on the simulated sensor."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from manytouch.cli.terminal import options

if TYPE_CHECKING:
    from manytouch.cli.terminal.console import Reporter
    from manytouch.cli.terminal.viewing import ViewerAddress
    from manytouch.pipeline import Sink
    from manytouch.sinks.pictures.surface_picture import BusiestFrame
    from manytouch.values import Reading

DEFAULT_SECONDS = 10.0
KEPT_SECONDS = 300.0  # in tables of some 90 MB, where nothing says when it ends


def demo(
    *,
    seconds: Annotated[
        Any,
        Parameter(
            converter=options.positive("a number of seconds"),
            n_tokens=1,
            help="Sensor time to run. [default: until Ctrl-C; 10 without viewer]",
            show_default=False,
        ),
    ] = None,
    no_view: options.NoView = False,
    out: Annotated[Path, options.folder("Folder for tables and pictures.")] = Path("out/demo"),
    host: options.Host = "127.0.0.1",
    port: options.Port = 0,
    token: options.ViewToken = None,
) -> int:
    """Press a simulated sensor with several fingers, and watch what is read from its pictures.

    The viewer shows surface and contacts in the browser, the truth beside them,
    and the mouse presses the sheet, until Ctrl-C; with --no-view or --seconds it
    ends by itself. Tables as from manytouch process (of five minutes at most,
    where there is no end) and a picture are left in the output folder.

    Example: manytouch demo --seconds 5
    """
    from manytouch.cli.terminal.console import Reporter

    reporter = Reporter(bar=False)
    reporter.say("the simulated sensor, pressed by several fingers at once", heading=True)
    if not no_view and find_spec("nicegui") is None:
        reporter.say("no viewer: it needs the package nicegui: pip install 'manytouch[view]'")
        no_view = True
    if no_view:
        _read(seconds or DEFAULT_SECONDS, out, reporter)
    else:
        from manytouch.cli.terminal.viewing import ViewerAddress

        _watch(seconds, out, ViewerAddress(host=host, port=port, token=token), reporter)
    return 0


def _read(seconds: float, out: Path, reporter: "Reporter") -> None:
    """Read every frame of some seconds, as quickly as it goes."""
    from manytouch.cli.terminal.contact_log import ContactLog
    from manytouch.cli.terminal.interrupt import Stop
    from manytouch.session import prepare, process_job
    from manytouch.sinks.pictures.surface_picture import BusiestFrame
    from manytouch.sources.simulated import simulated_source

    with Stop() as stop:
        source = simulated_source().lasting(seconds)
        job = prepare(source, observer=reporter)
        log = ContactLog(job.sensor, reporter.say, source.truth)
        moment = BusiestFrame(job.sensor)
        summary = process_job(job, out, annotate=True, sinks=[log, moment], observer=reporter, stop=stop)
    reporter.finish(summary, out)
    _draw(moment, out, reporter)


def _watch(seconds: float | None, out: Path, place: "ViewerAddress", reporter: "Reporter") -> None:
    """Serve the viewer; without an end the tables hold the beginning, so that no disk fills unseen."""
    from manytouch.cli.terminal.contact_log import ContactLog
    from manytouch.cli.terminal.interrupt import Stop
    from manytouch.cli.terminal.viewing import viewers
    from manytouch.session import Live, prepare, result_sinks, run
    from manytouch.sinks.pictures.surface_picture import BusiestFrame
    from manytouch.sources.pressed import PressedSource

    with Stop() as stop:
        source = PressedSource(seconds=seconds)
        job = prepare(source, method="mechanics", observer=reporter)
        live = Live(job, recordings=out)
        log = ContactLog(job.sensor, reporter.say, source.truth)
        moment = BusiestFrame(job.sensor)
        files, summary = result_sinks(out, job)
        last_ns = round((seconds or KEPT_SECONDS) * 1e9)
        kept = [_Beginning(sink, last_ns) for sink in (*files, moment, summary)]
        run(live, [log, *kept, *viewers(live, place, reporter.say)], reporter, stop)
    reporter.finish(summary, out)
    if live.health().frames > summary.counts["frames"]:
        reporter.say(f"they hold the first {KEPT_SECONDS:g} s; --record of manytouch run keeps all of it")
    _draw(moment, out, reporter)


def _draw(moment: "BusiestFrame", out: Path, reporter: "Reporter") -> None:
    """Draw the moment with most contacts, where the extra is there for it."""
    from manytouch.errors import MissingExtraError

    try:
        picture = moment.draw(out / "picture.png")
    except MissingExtraError as error:
        reporter.say(f"no picture: {error}")
    else:
        if picture is not None:
            reporter.say(f"picture of the moment with most contacts in {picture}")


class _Beginning:
    """Passes on the readings up to a time; a sink."""

    def __init__(self, sink: "Sink", last_ns: int) -> None:
        self._sink, self._last_ns = sink, last_ns

    def write(self, reading: "Reading") -> None:
        if reading.frame.timestamp_ns <= self._last_ns:
            self._sink.write(reading)

    def close(self) -> None:
        self._sink.close()
