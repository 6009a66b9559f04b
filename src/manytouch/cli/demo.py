"""`manytouch demo`: the main job on the simulated sensor."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from manytouch.cli import options

DEFAULT_SECONDS = 10.0


def demo(
    *,
    seconds: Annotated[
        Any,
        Parameter(
            converter=options.positive("a number of seconds"),
            n_tokens=1,
            help="Sensor time to run. [default: 10]",
            show_default=False,
        ),
    ] = DEFAULT_SECONDS,
    no_view: Annotated[
        bool,
        Parameter(
            negative=(),
            show_default=False,
            help="Without viewer; this release has none, so it changes nothing.",
        ),
    ] = False,
    out: Annotated[Path, options.folder("Folder for tables and pictures.")] = Path("out/demo"),
) -> int:
    """Press a simulated sensor with several fingers; print the contacts and draw the deepest moment.

    The true contact stands beside each estimate. Tables as from manytouch process,
    an annotated video and a picture are in the output folder at the end.

    Example: manytouch demo --seconds 5
    """
    from manytouch.cli.console import Reporter
    from manytouch.cli.contact_log import ContactLog
    from manytouch.cli.stopping import Stop
    from manytouch.errors import MissingExtraError
    from manytouch.session import prepare, read_into
    from manytouch.sinks.picture import BusiestMoment
    from manytouch.sources.simulated import simulated_source

    reporter = Reporter(bar=False)
    reporter.say("the simulated sensor, pressed by several fingers at once", heading=True)
    with Stop() as stop:
        source = simulated_source().lasting(seconds)
        job = prepare(source, progress=reporter)
        log = ContactLog(job.sensor, reporter.say, source.truth)
        moment = BusiestMoment(job.sensor)
        summary = read_into(job, out, annotate=True, sinks=[log, moment], progress=reporter, stop=stop)
    reporter.finish(summary, out)
    try:
        picture = moment.draw(out / "picture.png")
    except MissingExtraError as error:
        reporter.say(f"no picture: {error}")
    else:
        reporter.say(f"picture of the moment with most contacts in {picture}")
    return 0
