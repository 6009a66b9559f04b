"""Times several methods in one run: round after round a turn each, so that all run under the same conditions.

A turn is a few frames one after the other, as on a sensor: 30 ms of them, at least one and at most 20. The
first frame of a turn, which finds the caches full of what the other methods left, is kept apart as well.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree
from sequences import Course, to_and_fro

from manytouch.values import Frame

TURN_MS = 30.0  # a slower method runs only in so many rounds that it takes this much of each on average
TURN_FRAMES = 20  # at most
WARM = 4
CHECKED_EVERY = 5
GATE_PITCHES = 0.1


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Footage:
    """The input of all methods.

    Attributes:
        course: the truth.
        frames: that can be run through forwards and backwards without a jump.
        jpeg: the same as a camera would send them.
    """

    course: Course
    frames: Sequence[Frame]
    jpeg: Sequence[bytes]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Answer:
    """Result of a method for a frame, to be compared with the truth.

    Attributes:
        centre_px: (n, 2) dots, or None when it gives none.
        marker: (n,) which marker each is, -1 where not known; None when it gives no identities.
    """

    centre_px: np.ndarray | None = None
    marker: np.ndarray | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Method:
    """Something to be timed.

    Attributes:
        name: short, for table and plot.
        does: what is in its time.
        prepare: takes the footage, gives the function that is timed; it is called with an index of
            `footage.frames`, each time a neighbour of the one before.
        most: runs at most.
    """

    name: str
    does: str
    prepare: Callable[[Footage], Callable[[int], Answer]]
    most: int = 10**9


@dataclass(slots=True, eq=False, kw_only=True)
class Timing:
    """What the rounds gave for a method.

    Attributes:
        spent_ms, cpu_ms: of each frame; the second does not count while other programs had the processor.
        first_ms: processor time of the first frame of each turn.
        found, wrong: shares of the true dots that were found, and of the identities that were not true.
        error_px: errors of centres, along each axis.
        every: it ran in every so many rounds.
        frames: in a turn.
    """

    spent_ms: list[float] = field(default_factory=list)
    cpu_ms: list[float] = field(default_factory=list)
    first_ms: list[float] = field(default_factory=list)
    found: list[float] = field(default_factory=list)
    wrong: list[float] = field(default_factory=list)
    error_px: list[np.ndarray] = field(default_factory=list)
    every: int = 1
    frames: int = 1

    @property
    def median_ms(self) -> float:
        return float(np.median(self.spent_ms))

    @property
    def median_cpu_ms(self) -> float:
        return float(np.median(self.cpu_ms))

    @property
    def median_first_ms(self) -> float:
        return float(np.median(self.first_ms))

    @property
    def least_cpu_ms(self) -> float:
        """What remains when nothing disturbs: other programs can only add, also by emptying the caches."""
        return min(self.cpu_ms)

    @property
    def p99_ms(self) -> float | None:
        """None with fewer than 100 runs."""
        return float(np.percentile(self.spent_ms, 99)) if len(self.spent_ms) >= 100 else None

    @property
    def p99_over_median(self) -> tuple[float, float] | None:
        """Of the time on the wall and of processor time; None with fewer than 100 runs."""
        if len(self.spent_ms) < 100:
            return None
        wall, cpu = (
            float(np.percentile(each, 99) / np.median(each)) for each in (self.spent_ms, self.cpu_ms)
        )
        return wall, cpu

    @property
    def rms_px(self) -> float | None:
        if not self.error_px:
            return None
        error = np.concatenate(self.error_px)
        return float(np.sqrt(np.mean(error**2))) if len(error) else None


def interleaved(methods: Sequence[Method], footage: Footage, rounds: int) -> dict[str, Timing]:
    """Time all methods, `rounds` rounds long; slow ones leave rounds out."""
    runs, timings, done = {}, {}, {}
    order = to_and_fro(len(footage.frames), TURN_FRAMES * rounds + 100)
    for method in methods:
        runs[method.name] = method.prepare(footage)
        timings[method.name] = Timing()
        # the methods that take seconds need no warming
        pilot_ms = np.inf
        for turn in range(WARM):
            spent_ms, _, _ = _timed(runs[method.name], int(order[turn]))
            pilot_ms = min(pilot_ms, spent_ms)
            done[method.name] = turn + 1
            if turn >= 1 and spent_ms > 500.0:
                break
        timings[method.name].every = max(1, int(pilot_ms / TURN_MS))
        timings[method.name].frames = int(np.clip(TURN_MS / pilot_ms, 1, TURN_FRAMES))
    for turn in range(rounds):
        first = turn % len(methods)
        for method in [*methods[first:], *methods[:first]]:
            timing = timings[method.name]
            if turn % timing.every or len(timing.spent_ms) >= method.most:
                continue
            begun = done[method.name]
            done[method.name] += timing.frames
            _take_turn(runs[method.name], timing, order[begun : begun + timing.frames], footage.course)
    return timings


def _take_turn(run: Callable[[int], Answer], timing: Timing, turn: Sequence[int], course: Course) -> None:
    """Time some frames one after the other; every fifth turn the last answer is compared with the truth."""
    for place, index in enumerate(turn):
        spent_ms, cpu_ms, answer = _timed(run, int(index))
        timing.spent_ms.append(spent_ms)
        timing.cpu_ms.append(cpu_ms)
        if place == 0:
            timing.first_ms.append(cpu_ms)
    if len(timing.first_ms) % CHECKED_EVERY == 1:
        _compare(timing, course, int(turn[-1]), answer)


def in_a_row(method: Method, footage: Footage, frames: int) -> Timing:
    """Time one method alone, frame after frame, as it runs on a sensor of its own."""
    run, timing = method.prepare(footage), Timing()
    for turn, index in enumerate(to_and_fro(len(footage.frames), frames + WARM)):
        spent_ms, cpu_ms, _ = _timed(run, int(index))
        if turn >= WARM:
            timing.spent_ms.append(spent_ms)
            timing.cpu_ms.append(cpu_ms)
    return timing


def _timed(run: Callable[[int], Answer], index: int) -> tuple[float, float, Answer]:
    begun_s, begun_cpu_s = time.perf_counter(), time.thread_time()
    answer = run(index)
    cpu_s, spent_s = time.thread_time() - begun_cpu_s, time.perf_counter() - begun_s
    return 1e3 * spent_s, 1e3 * cpu_s, answer


def _compare(timing: Timing, course: Course, index: int, answer: Answer) -> None:
    """Record which of the true dots were found, with which errors and identities."""
    if answer.centre_px is None:
        return
    visible = np.flatnonzero(course.is_visible[index])
    centre_px = np.asarray(answer.centre_px, dtype=np.float64).reshape(-1, 2)
    if len(centre_px) == 0:
        timing.found.append(0.0)
        return
    gate_px = GATE_PITCHES * course.pitch_px
    distance_px, dot = cKDTree(course.centre_px[index][visible]).query(centre_px)
    right = distance_px < gate_px
    timing.found.append(len(np.unique(dot[right])) / len(visible))
    timing.error_px.append((centre_px[right] - course.centre_px[index][visible[dot[right]]]).ravel())
    if answer.marker is not None:
        is_given = answer.marker >= 0
        true = np.where(right, visible[dot], -1)
        timing.wrong.append(
            float(np.mean(true[is_given] != answer.marker[is_given])) if is_given.any() else 0.0
        )
