"""The memory in use does not grow with the number of frames."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path

import numpy as np
import pytest

from manytouch.session import pipeline_for
from manytouch.sources.simulated import simulated_source
from manytouch.values import Frame

STATUS = Path("/proc/self/statm")
PAGE_MB = 4096 / 2**20
PICTURES = range(0, 90, 3)  # of a scene that is in contact from the middle on
EVERY = 10  # frames between two measurements


def repeated(pictures: list[Frame], count: int) -> Iterator[Frame]:
    """Forwards and backwards, again and again, each time as new arrays, as a camera gives them."""
    for index, frame in enumerate(islice(cycle([*pictures, *pictures[-2:0:-1]]), count)):
        assert frame.image is not None
        yield replace(frame, index=index, timestamp_ns=index * 33_333_333, image=frame.image.copy())


def resident_mb() -> float:
    return int(STATUS.read_text(encoding="ascii").split()[1]) * PAGE_MB


@pytest.mark.skipif(not STATUS.exists(), reason="the system does not report the memory of a process")
@pytest.mark.parametrize(
    ("width_px", "seconds", "fps", "most_mb"),
    [
        pytest.param(640, 5.0, 30.0, 5.0, id="seconds"),
        pytest.param(2560, 600.0, 30.0, 16.0, id="ten minutes of 1440p", marks=pytest.mark.slow),
    ],
)
def test_memory_stays_flat(width_px: int, seconds: float, fps: float, most_mb: float) -> None:
    simulator = simulated_source(fps=fps, width_px=width_px).simulator
    pictures = [simulator.frame(index) for index in PICTURES]
    count = round(seconds * fps)
    held_mb = [
        resident_mb()
        for index, _ in enumerate(pipeline_for("perimeter").run(repeated(pictures, count), simulator.sensor))
        if index % EVERY == 0
    ]
    quarter = len(held_mb) // 4
    # what is compiled or kept from the first touch on is there after a quarter of the time
    assert np.max(held_mb[-quarter:]) - np.max(held_mb[quarter : 2 * quarter]) < most_mb
