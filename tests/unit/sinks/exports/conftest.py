"""A recording of a few readings that are known."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from manytouch.session import pipeline_for
from manytouch.sinks.recorder import Recorder
from manytouch.values import Contact, OutlineRing, Phase

FRAMES = 5


@pytest.fixture
def pressed_contact(contact_of) -> Callable[[int], Contact]:
    """The contact of a frame: deeper and stronger from frame to frame."""

    def make(index: int) -> Contact:
        corners_mm = np.array([[1.0, -2.0], [4.0, -2.0], [4.0, 0.0]])
        return contact_of(
            3,
            Phase.START if index == 0 else Phase.MOVE,
            force_N=np.array([0.125, 0.25, -1.0 - index]),
            torque_Nmm=5.0,
            area_mm2=12.0,
            depth_mm=0.5 + index,
            outline=(OutlineRing(point_mm=corners_mm),),
        )

    return make


@pytest.fixture
def record(sensor, reading_of, pressed_contact) -> Callable[[Path], Path]:
    def make(path: Path) -> Path:
        recorder = Recorder(path, source={"name": "bench"})
        recorder.describe(sensor, pipeline_for("perimeter"), "perimeter")
        for index in range(FRAMES):
            reading = reading_of(index, (pressed_contact(index),), depth_mm=0.5 + index)
            recorder.take(reading.frame)
            recorder.write(reading)
        recorder.close()
        return path

    return make
