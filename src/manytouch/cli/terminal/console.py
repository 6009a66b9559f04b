"""Console output of commands: `Reporter` for a run over frames, `Steps` for other long work; sentences on
results.

Progress is a bar on a terminal, and plain lines elsewhere."""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from manytouch.sinks.files.sensor_description import describe_sensor, describe_view
from manytouch.sinks.files.summary import Summary
from manytouch.sinks.files.tables import ContactList, time_s
from manytouch.values import LengthUnit, Reading, Sensor
from manytouch.values.display.text import count_of, with_std

PLAIN_EVERY_S = 5.0
MOST_CONTACTS = 10
"""Contacts that are listed at the end of a run."""
LEAST_VALID = 0.5
"""Below this share of `ok` frames, a recording without contacts is called not valid, not untouched."""
Item = TypeVar("Item")


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
        if (view := describe_view(sensor)) is not None:
            self.print(view)
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

    def finish(
        self, summary: Summary, folder: Path, *, is_complete: bool, contacts: ContactList | None = None
    ) -> None:
        """Print the results, the first contacts and the folder."""
        for sentence in describe_results(summary):
            self.print(sentence)
        for sentence in [] if contacts is None else describe_contacts(contacts, summary.length_unit):
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

    def step_reporter(self, total: int | None = None) -> Callable[[str], None]:
        """A callback: each sentence passed to it is shown as the present step.

        Args:
            total: number of steps, if known.
        """
        task = self.bar.add_task("", total=total)

        def show(sentence: str) -> None:
            if self._console.is_terminal:
                done = self.bar.tasks[self.bar.task_ids.index(task)].completed
                self.bar.update(task, description=sentence, completed=done + 1)
            else:
                self.print(f"  {sentence}")

        return show

    def count(self, noun: str, steps: Iterable[Item], total: int | None) -> Iterator[Item]:
        """Iterate over the steps and show how many are done, of a total that may not be known."""
        task, printed_s = self.bar.add_task(noun, total=total), time.monotonic()
        for number, step in enumerate(steps, start=1):
            self.bar.advance(task)
            if not self._console.is_terminal and time.monotonic() - printed_s > PLAIN_EVERY_S:
                printed_s = time.monotonic()
                self.print(f"  {number} {noun}" if total is None else f"  {number} of {total} {noun}")
            yield step
        self.bar.remove_task(task)


def describe_results(summary: Summary) -> Sequence[str]:
    """Lines about frames, contacts and noise, and the warnings."""
    counts, noise = summary.counts, summary.noise_px
    sentences = [f"{count_of(counts['frames'], 'frame')}, {counts['status'].get('ok', 0)} of them ok"]
    if len(counts["methods"]) > 1:
        per_method = (f"{frames} by {method}" for method, frames in counts["methods"].items())
        sentences[0] += f": {', '.join(per_method)}"
    if counts["contacts"]:
        sentences.append(
            f"{count_of(counts['contacts'], 'contact')}, at most {counts['contacts_at_once']} at once, "
            f"in {count_of(counts['frames_with_contact'], 'frame')}"
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


def describe_contacts(contacts: ContactList, unit: LengthUnit) -> Sequence[str]:
    """A line for each of the first contacts, with its values at the peak."""
    found = sorted(contacts.contacts.items())
    lines = []
    for number, each in found[:MOST_CONTACTS]:
        x, y = each.at_peak.centre_mm
        parts = [
            f"contact {number}: {time_s(each.first[1]):.2f} to {time_s(each.last[1]):.2f} s",
            f"at ({x + 0.0:.2f}, {y + 0.0:.2f}) {unit}",
        ]
        if math.isfinite(each.deepest.depth_mm):
            parts.append(f"depth {with_std(each.deepest.depth_mm, each.deepest.std('depth'))} {unit}")
        force_N = each.at_peak.normal_force_N
        if math.isfinite(force_N):
            parts.append(f"force {with_std(force_N, each.at_peak.std('normal_force'))} N")
        lines.append(", ".join(parts))
    if len(found) > MOST_CONTACTS:
        lines.append(f"and {len(found) - MOST_CONTACTS} more in contact_list.csv")
    return lines
