"""A live session, or the playback of a file, with printed contacts, outputs, a viewer and files."""

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from manytouch.cli.terminal.console import Reporter
from manytouch.cli.terminal.contact_log import ContactLog
from manytouch.cli.terminal.handover import KeptOpen, OnlyMessages, PresentControls
from manytouch.cli.terminal.outputs import described_outputs, print_end_of_scene, print_outputs
from manytouch.cli.terminal.viewing import ViewerAddress, viewers
from manytouch.pipeline import Sink
from manytouch.session import Live, Playback, ResultFiles, StopCondition, run
from manytouch.session.diagnosis.camera import describe_latency, describe_settings
from manytouch.sources import Source
from manytouch.sources.files.frame_timeline import frame_timeline


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """Where contacts go in addition to files.

    Attributes:
        to: addresses of other programs.
        address: of the viewer; None: there is none.
        reporter: prints.
    """

    to: Sequence[str]
    address: ViewerAddress | None
    reporter: Reporter

    def shows_timeline_of(self, source: Source) -> bool:
        """Whether the viewer shows a source with a timeline, until Ctrl-C."""
        return self.address is not None and frame_timeline(source) is not None


def show_playback(playback: Playback, outputs: Outputs, stop: StopCondition) -> int:
    """Show a recording, a video or images with a timeline; with a viewer until Ctrl-C."""
    reporter = outputs.reporter
    playback.attach(described_outputs(outputs.to, playback, reporter.print))
    log = ContactLog(playback.sensor, reporter.print)
    shown = viewers(playback, outputs.address, reporter.print)
    if shown:
        _print_stay(reporter)
    run(playback, [log, *shown], reporter, stop)
    print_outputs(playback.health(), reporter.print)
    return 0


def run_live(live: Live, folder: Path | None, outputs: Outputs, stop: StopCondition) -> int:
    """Run a session until its source ends; a file then stays open in the viewer, with a timeline.

    What is written is complete before that.

    Args:
        live: the session.
        folder: for the tables; None: there are none.
        outputs: they and the viewer get what is played back later too.
        stop: ends the session, or the playback.
    """
    reporter, job = outputs.reporter, live.job
    controls = PresentControls(live)
    log = ContactLog(job.sensor, reporter.print, job.source.capabilities.truth)
    print_end_of_scene(job.source, reporter.print)
    with ExitStack() as closing:
        processes = described_outputs(outputs.to, controls, reporter.print)
        kept = [KeptOpen(each) for each in _closed_at_end(closing, processes)]
        live.attach(kept)
        for line in describe_settings(live.health().settings):
            reporter.print(line)
        files = None
        with ExitStack() as writing:
            if folder is not None:
                files = ResultFiles(folder, job, is_repeatable=False, warnings=lambda: live.warnings)
                writing.enter_context(files)
            pages = _closed_at_end(closing, viewers(controls, outputs.address, reporter.print))
            shown: list[Sink] = [log, *(KeptOpen(each) for each in pages)]
            is_complete = run(live, [*(files.sinks if files else ()), *shown], reporter, stop)
            if files is not None:
                files.is_complete, files.is_repeatable = is_complete, live.is_repeatable
        reporter.print(describe_latency(live.health()))
        if live.recorder.lost is not None:
            print(f"manytouch: {live.recorder.lost}", file=sys.stderr)
        if files is not None:
            reporter.finish(files.summary, files.folder.path, is_complete=is_complete)
        if is_complete and pages and outputs.shows_timeline_of(job.source):
            playback = Playback(live.job, stays=True, shown=live.meter)
            playback.attach(kept)
            controls.session = playback
            _print_stay(reporter)
            run(playback, shown, OnlyMessages(reporter), stop)
    print_outputs(controls.health(), reporter.print)
    return 0


def _closed_at_end(closing: ExitStack, sinks: Sequence[Sink]) -> Sequence[Sink]:
    for sink in sinks:
        closing.callback(sink.close)
    return sinks


def _print_stay(reporter: Reporter) -> None:
    reporter.print("it stays open with a timeline until Ctrl-C")
