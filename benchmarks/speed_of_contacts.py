"""Time of inversion and contacts against the number of contacts, for `speed.py`.

The positions of the dots are true ones with noise, so that only the estimation is timed: processor time of
each frame in one thread, first frames of contacts included.
"""

import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from manytouch.session import pipeline_for
from manytouch.session.warm_up import warm_up_for
from manytouch.sources.pressed.pressed_source import PressedSource
from manytouch.sources.simulated import simulated_source
from manytouch.values import Press, Release, Sensor, TrackedGrid

NOISE_PX = 0.03
WIDTH_PX = 2560
SCENES = ("fingers", "one")
PLACES_MM = ((-42, -24), (42, 24), (-42, 24), (42, -24), (-14, 24), (14, -24), (14, 24), (-14, -24))
"""Of up to eight fingers on the demo sheet."""
DEPTH_MM = 3.0
FRAMES_DOWN, FRAMES_UP = 12, 4


def with_noise(grid: TrackedGrid, random: np.random.Generator) -> TrackedGrid:
    """The same markers, with errors of their centres."""
    moved = grid.position_px + random.normal(0.0, NOISE_PX, grid.position_px.shape)
    return replace(
        grid,
        position_px=moved,
        covariance_px2=np.tile(np.eye(2) * NOISE_PX**2, (len(moved), 1, 1)),
    )


def scene_grids(scene: str) -> tuple[Sensor, Iterator[tuple[TrackedGrid, int]]]:
    """The sensor of a built-in scene, its true markers, and how many contacts there are."""
    source = simulated_source(scene, width_px=WIDTH_PX)
    truths = (source.truth(index) for index in range(source.frame_count))
    return source.sensor, ((each.grid, len(each.contacts.touching)) for each in truths)


def pressed_grids(most: int = len(PLACES_MM)) -> tuple[Sensor, Iterator[tuple[TrackedGrid, int]]]:
    """The demo sheet under 1, 2, ... fingers."""
    source = PressedSource(width_px=WIDTH_PX)

    def grids() -> Iterator[tuple[TrackedGrid, int]]:
        frames = iter(source)
        for fingers in range(1, most + 1):
            for finger, (x_mm, y_mm) in enumerate(PLACES_MM[:fingers]):
                source.press(Press(finger=finger, x_mm=x_mm, y_mm=y_mm, depth_mm=DEPTH_MM))
            for _ in range(FRAMES_DOWN):
                truth = source.truth(next(frames).index)
                if truth is not None:
                    yield truth.grid, len(truth.contacts.touching)
            for finger in range(fingers):
                source.press(Release(finger=finger))
            for _ in range(FRAMES_UP):
                next(frames)

    return source.sensor, grids()


def times_ms(
    sensor: Sensor, grids: Iterable[tuple[TrackedGrid, int]], method: str = "mechanics"
) -> dict[int, list[float]]:
    """Processor time of each frame by the true number of contacts; functions are compiled before."""
    warm_up_for(method, sensor)
    estimate = pipeline_for(method).estimate
    state, random = estimate.start(sensor), np.random.default_rng(0)
    found: dict[int, list[float]] = defaultdict(list)
    for number, (grid, contacts) in enumerate(grids):
        noisy = with_noise(grid, random)
        begun_s = time.thread_time()
        state, _, _ = estimate.step(state, noisy)
        if number >= 2:  # the first ones load machine code
            found[contacts].append(1e3 * (time.thread_time() - begun_s))
    return dict(found)


def merged(*parts: dict[int, list[float]]) -> dict[int, list[float]]:
    """Times of several runs, by the number of contacts."""
    whole: dict[int, list[float]] = defaultdict(list)
    for part in parts:
        for contacts, spent_ms in part.items():
            whole[contacts] += spent_ms
    return dict(sorted(whole.items()))


def table(times: dict[int, list[float]]) -> str:
    """Percentiles by the number of contacts."""
    lines = ["inversion and contacts by the number of contacts, ms of processor time"]
    for contacts, spent_ms in times.items():
        p50, p90, p99 = np.percentile(spent_ms, [50, 90, 99])
        lines.append(
            f"{contacts:3} contacts  p50 {p50:6.2f}  p90 {p90:6.2f}  p99 {p99:6.2f}  {len(spent_ms)} frames"
        )
    return "\n".join(lines)


def plot(times: dict[int, list[float]], path: Path) -> None:
    """p50 and p99 against the number of contacts."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    for percent in (50, 99):
        axes.plot(
            list(times), [np.percentile(each, percent) for each in times.values()], "o-", label=f"p{percent}"
        )
    axes.set(xlabel="contacts", ylabel="inversion and contacts, ms", ylim=(0, None))
    axes.legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)
