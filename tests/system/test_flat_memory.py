"""A sensor that is watched for long needs no more memory than one that is watched for a moment."""

from pathlib import Path

import numpy as np
import pytest

from manytouch.session import pipeline_for
from manytouch.simulation.scene import SCENES
from manytouch.simulation.sensor import demo_sensor
from manytouch.simulation.simulator import Simulator

STATUS = Path("/proc/self/statm")
PAGE_MB = 4096 / 2**20
EVERY = 10  # frames between two looks at the memory


def resident_mb() -> float:
    return int(STATUS.read_text(encoding="ascii").split()[1]) * PAGE_MB


@pytest.mark.skipif(not STATUS.exists(), reason="the system does not tell how much memory a process holds")
@pytest.mark.parametrize(
    ("width_px", "seconds", "fps", "most_mb"),
    [
        pytest.param(640, 5.0, 30.0, 5.0, id="seconds"),
        pytest.param(2560, 600.0, 30.0, 16.0, id="ten minutes of 1440p", marks=pytest.mark.slow),
    ],
)
def test_memory_stays_flat(width_px: int, seconds: float, fps: float, most_mb: float) -> None:
    scene = SCENES["fingers"](0).lasting(seconds)
    simulator = Simulator(sensor=demo_sensor(width_px), scene=scene, fps=fps)
    frames = (simulator.frame(index) for index in range(simulator.frame_count))
    held_mb = [
        resident_mb()
        for index, _ in enumerate(pipeline_for("perimeter").run(frames, simulator.sensor))
        if index % EVERY == 0
    ]
    quarter = len(held_mb) // 4
    # what is compiled or kept from the first touch on is there after a quarter of the time
    assert np.max(held_mb[-quarter:]) - np.max(held_mb[quarter : 2 * quarter]) < most_mb
