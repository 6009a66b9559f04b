"""Progress and results on the console: a bar on a terminal, plain lines elsewhere."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from manytouch.sinks.files.sensor_description import describe_sensor
from manytouch.sinks.files.summary import Summary
from manytouch.values import Reading, Sensor

PLAIN_EVERY_S = 5.0
Step = TypeVar("Step")


class Reporter:
    """Prints messages, progress and results of one run; within its block a terminal shows a bar."""

    def __init__(self, *, bar: bool = True) -> None:
        self.console = Console(highlight=False, soft_wrap=True)
        self._shows_progress = bar
        self._bar = progress_bar(self.console)
        self._task: TaskID | None = None
        self._total: int | None = None
        self._count = 0
        self._printed_s = time.monotonic()

    def __enter__(self) -> "Reporter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def print(self, sentence: str, *, heading: bool = False) -> None:
        """Print a line; a heading starts a new input."""
        self.console.print(sentence if heading else f"  {sentence}", markup=False)

    def on_message(self, sentence: str) -> None:
        """Print a message of the run."""
        self.print(sentence)

    def on_begin(self, sensor: Sensor, frame_count: int | None) -> None:
        """Print the sensor and the assumptions."""
        self.print(f"found {describe_sensor(sensor)}")
        for assumption in sensor.assumptions:
            self.print(f"assumed: {assumption}")
        self._total = frame_count
        self._printed_s = time.monotonic()
        if self._shows_progress and self.console.is_terminal:
            self._bar.start()
            self._task = self._bar.add_task("frames", total=self._total)

    def on_reading(self, reading: Reading) -> None:
        """Update the progress."""
        self._count += 1
        if self._task is not None:
            self._bar.advance(self._task)
        elif self._shows_progress and time.monotonic() - self._printed_s > PLAIN_EVERY_S:
            self._printed_s = time.monotonic()
            of = "" if self._total is None else f" of {self._total}"
            self.print(f"{self._count}{of} frames")

    def finish(self, summary: Summary, folder: Path, *, is_complete: bool) -> None:
        """Print the results and their folder."""
        for sentence in describe_results(summary):
            self.print(sentence)
        if not is_complete:
            self.print("ended early: the results contain the frames up to here")
        self.print(f"results in {folder}")


def progress_bar(console: Console) -> Progress:
    """A progress bar that disappears at the end, and is disabled if the console is not a terminal."""
    return Progress(
        TextColumn("  {task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


class Steps:
    """Progress of work in steps: a bar on a terminal, a line every few seconds elsewhere.

    Attributes:
        bar: the progress bar, disabled if the console is not a terminal.
    """

    def __init__(self, console: Console | None = None) -> None:
        """Prepare the bar.

        Args:
            console: where to print; the standard output by default.
        """
        self._console = console or Console(highlight=False, soft_wrap=True)
        self.bar = progress_bar(self._console)

    def __enter__(self) -> "Steps":
        self.bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.bar.stop()

    def print(self, sentence: str) -> None:
        """Print a line."""
        self._console.print(sentence, markup=False)

    def follow(self, total: int | None = None) -> Callable[[str], None]:
        """A function that shows a message as the present step: in the bar on a terminal, as a line elsewhere.

        Args:
            total: number of messages, if known.
        """
        task = self.bar.add_task("", total=total)

        def show(sentence: str) -> None:
            if self._console.is_terminal:
                done = self.bar.tasks[self.bar.task_ids.index(task)].completed
                self.bar.update(task, description=sentence, completed=done + 1)
            else:
                self.print(f"  {sentence}")

        return show

    def count(self, noun: str, steps: Iterable[Step], total: int | None) -> Iterator[Step]:
        """Iterate over the steps and show how many are done, of a total that may not be known."""
        task, printed_s = self.bar.add_task(noun, total=total), time.monotonic()
        for number, step in enumerate(steps, start=1):
            self.bar.advance(task)
            if not self._console.is_terminal and time.monotonic() - printed_s > PLAIN_EVERY_S:
                printed_s = time.monotonic()
                self.print(f"  {number} {noun}" if total is None else f"  {number} of {total} {noun}")
            yield step
        self.bar.remove_task(task)


LEAST_VALID = 0.5
"""Share of frames with the status `ok` below which a recording without contacts is not called untouched."""


def describe_results(summary: Summary) -> Sequence[str]:
    """Lines about frames, contacts and noise, and the warnings."""
    counts, noise = summary.counts, summary.noise_px
    sentences = [f"{_many(counts['frames'], 'frame')}, {counts['status'].get('ok', 0)} of them ok"]
    if len(counts["methods"]) > 1:
        per_method = (f"{frames} by {method}" for method, frames in counts["methods"].items())
        sentences[0] += f": {', '.join(per_method)}"
    if counts["contacts"]:
        sentences.append(
            f"{_many(counts['contacts'], 'contact')}, at most {counts['contacts_at_once']} at once, "
            f"in {_many(counts['frames_with_contact'], 'frame')}"
        )
    elif counts["status"].get("ok", 0) < LEAST_VALID * counts["frames"]:
        sentences.append("contacts are not valid: too few frames could be evaluated")
    else:
        sentences.append("no contact in any frame")
    if (forces := summary.forces.sentence()) is not None:
        sentences.append(forces)
    if noise["median"] is None:
        sentences.append("noise per marker unknown: too few frames without contact")
    else:
        sentences.append(
            f"noise per marker at rest {noise['median']:.3f} px (median), {noise['worst']:.3f} px (worst)"
        )
    return [*sentences, *(f"warning: {sentence}" for sentence in summary.warnings())]


def _many(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
