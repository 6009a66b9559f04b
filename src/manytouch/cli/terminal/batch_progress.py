"""Progress of a batch on the console: counts, rate, time left, and each failure as it comes."""

import time

from rich.console import Console

from manytouch.batch.completion import MISSING
from manytouch.batch.run_batch import BatchReport
from manytouch.batch.tasks import Outcome, TaskState
from manytouch.cli.terminal.console import PLAIN_EVERY_S, progress_bar
from manytouch.values.display.text import count_of


class BatchProgress:
    """Prints what happens in a batch; within its block a terminal shows a bar."""

    def __init__(self) -> None:
        self._console = Console(highlight=False, soft_wrap=True)
        self._bar = progress_bar(self._console)
        self._task = self._bar.add_task("recordings", total=None)
        self._begun_s = self._printed_s = time.monotonic()
        self._total = self._done = self._computed = self._failed = self._frames = 0

    def __enter__(self) -> "BatchProgress":
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def on_message(self, sentence: str) -> None:
        """Print a sentence."""
        self._console.print(sentence, markup=False)

    def on_begin(self, count: int) -> None:
        """Set the number of recordings."""
        self._total = count
        self._begun_s = self._printed_s = time.monotonic()
        self._bar.update(self._task, total=count)

    def on_outcome(self, outcome: Outcome) -> None:
        """Count a recording; print it unless nothing had to be done."""
        self._done += 1
        self._bar.advance(self._task)
        name = outcome.task.name
        if outcome.state is TaskState.COMPUTED:
            self._computed += 1
            self._frames += outcome.frames
            again = "" if outcome.reason == MISSING else f" (again: {outcome.reason})"
            self.on_message(f"{name}: {count_of(outcome.frames, 'frame')} in {outcome.seconds:.1f} s{again}")
        elif outcome.state is TaskState.FAILED:
            self._failed += 1
            self.on_message(f"{name}: failed: {' '.join(outcome.reason.split())}")
        if time.monotonic() - self._printed_s > PLAIN_EVERY_S:
            self._printed_s = time.monotonic()
            self.on_message(self._rate())

    def finish(self, report: BatchReport, out: str) -> None:
        """Print what was done."""
        words = [f"{count_of(report.computed, 'recording')} processed", f"{report.current} unchanged"]
        if report.failed:
            words.append(f"{len(report.failed)} failed (failures.csv)")
        elapsed_s = max(time.monotonic() - self._begun_s, 1e-9)
        self.on_message(f"{', '.join(words)}, in {_duration(elapsed_s)}")
        if report.is_stopped:
            self.on_message("stopped: the same command continues")
        self.on_message(f"results in {out}, {count_of(report.complete, 'complete recording')} in its tables")

    def _rate(self) -> str:
        """Counts, rates, and the time left if the rest takes as long."""
        elapsed_s = time.monotonic() - self._begun_s
        per_s = self._done / elapsed_s
        failed = f", {self._failed} failed" if self._failed else ""
        return (
            f"{self._done} of {self._total} recordings{failed}, {60 * per_s:.3g} per minute, "
            f"{self._frames / elapsed_s:.3g} frames per second, "
            f"{_duration((self._total - self._done) / per_s)} left"
        )


def _duration(seconds: float) -> str:
    """Hours, minutes and seconds, such as 1:02:03."""
    whole = round(seconds)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02d}:{whole % 60:02d}" if hours else f"{minutes}:{whole % 60:02d}"
