"""What a run says while it goes on: a bar on a terminal, plain lines elsewhere."""

import time
from collections.abc import Iterable, Iterator, Sequence
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
    """Follows one run on the console; within its block a terminal shows a bar."""

    def __init__(self, *, bar: bool = True) -> None:
        self.console = Console(highlight=False, soft_wrap=True)
        self._is_followed = bar
        self._bar = progress_bar(self.console)
        self._task: TaskID | None = None
        self._total: int | None = None
        self._read = 0
        self._said_s = time.monotonic()

    def __enter__(self) -> "Reporter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def say(self, sentence: str, *, heading: bool = False) -> None:
        """Print a line; a heading starts a new input."""
        self.console.print(sentence if heading else f"  {sentence}", markup=False)

    def on_message(self, sentence: str) -> None:
        """Print it."""
        self.say(sentence)

    def on_begin(self, sensor: Sensor, frame_count: int | None) -> None:
        """Say what was found and what had to be assumed."""
        self.say(f"found {describe_sensor(sensor)}")
        for assumption in sensor.assumptions:
            self.say(f"assumed: {assumption}")
        self._total = frame_count
        self._said_s = time.monotonic()
        if self._is_followed and self.console.is_terminal:
            self._bar.start()
            self._task = self._bar.add_task("reading", total=self._total)

    def on_reading(self, reading: Reading) -> None:
        """Count a frame."""
        self._read += 1
        if self._task is not None:
            self._bar.advance(self._task)
        elif self._is_followed and time.monotonic() - self._said_s > PLAIN_EVERY_S:
            self._said_s = time.monotonic()
            of = "" if self._total is None else f" of {self._total}"
            self.say(f"{self._read}{of} frames")

    def finish(self, summary: Summary, folder: Path) -> None:
        """Say what came out and where it lies."""
        for sentence in results_in_words(summary):
            self.say(sentence)
        self.say(f"results in {folder}")


def progress_bar(console: Console) -> Progress:
    """A bar that goes when it is done, and is not there at all where nobody could see it move."""
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
    """Progress of work in steps: a bar on a terminal, a line every few seconds elsewhere."""

    def __init__(self) -> None:
        self._console = Console(highlight=False, soft_wrap=True)
        self._bar = progress_bar(self._console)

    def __enter__(self) -> "Steps":
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def print(self, sentence: str) -> None:
        """Print a line."""
        self._console.print(sentence, markup=False)

    def count(self, noun: str, steps: Iterable[Step], total: int) -> Iterator[Step]:
        """Iterate over the steps and show how many are done."""
        task, printed_s = self._bar.add_task(noun, total=total), time.monotonic()
        for number, step in enumerate(steps, start=1):
            self._bar.advance(task)
            if not self._console.is_terminal and time.monotonic() - printed_s > PLAIN_EVERY_S:
                printed_s = time.monotonic()
                self.print(f"  {number} of {total} {noun}")
            yield step
        self._bar.remove_task(task)


def results_in_words(summary: Summary) -> Sequence[str]:
    """Lines about frames, contacts and noise, and the warnings."""
    counts, noise = summary.counts, summary.noise_px
    sentences = [f"{_many(counts['frames'], 'frame')}, {counts['status'].get('ok', 0)} of them ok"]
    if counts["contacts"]:
        sentences.append(
            f"{_many(counts['contacts'], 'contact')}, at most {counts['contacts_at_once']} at once, "
            f"in {_many(counts['frames_with_contact'], 'frame')}"
        )
    else:
        sentences.append("no contact in any frame")
    if noise["median"] is None:
        sentences.append("noise per marker unknown: too few frames without contact")
    else:
        sentences.append(
            f"noise per marker at rest {noise['median']:.3f} px (median), {noise['worst']:.3f} px (worst)"
        )
    return [*sentences, *(f"warning: {sentence}" for sentence in summary.warnings())]


def _many(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
