"""A source that repeats pictures drawn in advance, as a camera or as a file."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sources import Capabilities
from manytouch.sources.simulated import simulated_source
from manytouch.values import Frame, Sensor


def rendered(scene: str = "fingers", width_px: int = 854, frames: int = 90) -> tuple[np.ndarray, ...]:
    """Pictures of the simulated sensor (480p by default), there and back, so that repeating shows no jump."""
    source = simulated_source(scene, width_px=width_px)
    there = tuple(source.simulator.frame(index).image for index in range(0, 2 * frames, 2))
    return (*there, *there[-2:0:-1])


@dataclass
class LoopSource:
    """Pictures over and over.

    Attributes:
        pictures: to repeat.
        is_live: at `fps` of the clock, as a camera, else as fast as they are taken.
        limit: number of frames; None without end.
        sensor: that they show.
    """

    pictures: tuple[np.ndarray, ...]
    is_live: bool = True
    fps: float | None = 60.0
    limit: int | None = None
    sensor: Sensor = field(default_factory=lambda: demo_sensor(854))
    name: str = "loop"

    @property
    def frame_count(self) -> int | None:
        return self.limit

    @property
    def width_px(self) -> int:
        return int(self.pictures[0].shape[1])

    @property
    def height_px(self) -> int:
        return int(self.pictures[0].shape[0])

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(sensor=self.sensor)

    def __iter__(self) -> Iterator[Frame]:
        period_s = 1.0 / (self.fps or 30.0)
        begin_s, index = time.monotonic(), -1
        for number in count():
            if self.is_live:
                index = max(index + 1, int((time.monotonic() - begin_s) / period_s))
                time.sleep(max(0.0, begin_s + index * period_s - time.monotonic()))
            else:
                index = number
            if self.limit is not None and index >= self.limit:
                return
            yield Frame(
                index=index,
                timestamp_ns=round(index * period_s * 1e9),
                camera=self.name,
                image=self.pictures[index % len(self.pictures)],
                arrived_ns=time.monotonic_ns() if self.is_live else None,
            )
