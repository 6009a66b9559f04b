"""Time of a frame from decoded image to contacts, stage by stage, with its 99th percentile.

    OMP_NUM_THREADS=1 python benchmarks/bench_frame.py [--method mechanics] [--frames 1000]

2560 x 1440 px, 600 dots, the built-in scene `fingers` (a 3-D solid), forwards and backwards so that
the sheet never jumps. First in one thread; then detection and tracking in one, estimation in another, as fast
as they go: time per frame is then that from one reading to the next. The first line is the load of
the machine: on a busy one, times are upper bounds.
"""

import argparse
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import cycle, islice
from typing import Any

import numpy as np

from manytouch.session.background_iterator import BackgroundIterator
from manytouch.session.methods import pipeline_for
from manytouch.simulation.scene.file import BUILT_IN, load_scene
from manytouch.simulation.solve_scene import simulator, solve_scene, states_folder
from manytouch.values import Frame, Sensor

WARM_FRAMES = 20
NANOSECONDS = 1_000_000_000


class Timed:
    """A stage whose steps are timed: wall time, and processor time of its thread."""

    def __init__(self, stage: Any) -> None:
        self._stage = stage
        self.wall_ms: list[float] = []
        self.own_ms: list[float] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stage, name)

    def step(self, *arguments: Any) -> Any:
        wall_s, own_s = time.perf_counter(), time.thread_time()
        found = self._stage.step(*arguments)
        self.wall_ms.append(1e3 * (time.perf_counter() - wall_s))
        self.own_ms.append(1e3 * (time.thread_time() - own_s))
        return found


def footage(pictures: int, fps: float) -> tuple[Sensor, tuple[Frame, ...]]:
    """The sensor and frames of some seconds of fingers."""
    scene = replace(load_scene(BUILT_IN / "fingers.toml", width_px=2560), fps=fps)
    camera = simulator(scene, tuple(solve_scene(scene, states_folder())))
    return camera.sensor, tuple(camera.frame(index) for index in range(pictures))


def endless(frames: tuple[Frame, ...], fps: float) -> Iterator[Frame]:
    """The frames forwards and backwards, without end; indices and times continue."""
    order = [*frames, *frames[-2:0:-1]]
    for index, frame in enumerate(cycle(order)):
        yield replace(frame, index=index, timestamp_ns=round(index * NANOSECONDS / fps))


def row(name: str, wall_ms: list[float], own_ms: list[float] | None = None) -> str:
    p50, p90, p99 = np.percentile(wall_ms, [50, 90, 99])
    words = f"{name:34} p50 {p50:6.2f}  p90 {p90:6.2f}  p99 {p99:6.2f}  p99/p50 {p99 / p50:4.1f}"
    if own_ms is None:
        return words
    p50, p90, p99 = np.percentile(own_ms, [50, 90, 99])
    return f"{words}   processor p50 {p50:6.2f}  p90 {p90:6.2f}  p99 {p99:6.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--method", default="mechanics")
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--pictures", type=int, default=180, help="different ones")
    parser.add_argument("--fps", type=float, default=30.0)
    arguments = parser.parse_args()
    sensor, frames = footage(arguments.pictures, arguments.fps)
    pipeline = pipeline_for(arguments.method)
    stages = {name: Timed(getattr(pipeline, name)) for name in ("detect", "track", "estimate")}
    timed = replace(pipeline, **stages)
    count = WARM_FRAMES + arguments.frames
    print(f"load of the machine {os.getloadavg()[0]:.1f}; {arguments.method}, {arguments.frames} frames, ms")
    whole_ms, touching = [], 0
    for reading in timed.run(islice(endless(frames, arguments.fps), count), sensor):
        whole_ms.append(reading.milliseconds)
        touching += len(reading.contacts.touching)
    for name, stage in stages.items():
        print(row(name, stage.wall_ms[-arguments.frames :], stage.own_ms[-arguments.frames :]))
    print(row("picture to contacts, one thread", whole_ms[WARM_FRAMES:]))
    at_s = []
    tracked = pipeline.track_frames(islice(endless(frames, arguments.fps), count), sensor)
    with BackgroundIterator(tracked, ahead=1) as stream:
        for _ in pipeline.estimate_readings(stream, sensor):
            at_s.append(time.perf_counter())
    print(row("per frame, two threads", (1e3 * np.diff(at_s))[WARM_FRAMES:].tolist()))
    print(f"{touching / count:.1f} contacts per frame")


if __name__ == "__main__":
    main()
