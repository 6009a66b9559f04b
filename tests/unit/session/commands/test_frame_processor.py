"""Frames of a timeline in any order, from kept states."""

import numpy as np

from manytouch.pipeline import Pipeline
from manytouch.session.commands.continuation import Setup
from manytouch.session.commands.frame_processor import KEPT_STATES, FrameProcessor
from manytouch.values import Contacts, Detections, Frame, Sensor, Surface, TrackedGrid
from manytouch.values.arrays import Points2
from straight import straight_camera

SENSOR = Sensor(name="bench", camera=straight_camera(64, 48, focal_px=50.0, distance_mm=50.0))
DOTS = Detections(
    centre_px=np.zeros((0, 2)),
    covariance_px2=np.zeros((0, 2, 2)),
    area_px2=np.zeros(0),
    contrast=np.zeros(0),
)
GRID = TrackedGrid(
    position_px=np.zeros((0, 2)),
    covariance_px2=np.zeros((0, 2, 2)),
    is_seen=np.zeros(0, dtype=np.bool_),
    frames_unseen=np.zeros(0, dtype=np.int64),
)
SURFACE = Surface(
    position_mm=np.zeros((0, 3)), displacement_mm=np.zeros((0, 3)), covariance_mm2=np.zeros((0, 3, 3))
)


class CountingDetector:
    """Its state is the number of frames that it has had."""

    def start(self, sensor: Sensor) -> int:
        return 0

    def step(self, state: int, frame: Frame, expected_px: Points2 | None) -> tuple[int, Detections]:
        assert state == frame.index
        return state + 1, DOTS


class CountingTracker:
    """Its state is the number of frames that it has had."""

    def start(self, sensor: Sensor) -> int:
        return 0

    def step(self, state: int, detections: Detections) -> tuple[int, TrackedGrid]:
        return state + 1, GRID

    def expected_px(self, state: int) -> Points2 | None:
        return None

    def needs_full_search(self, state: int) -> bool:
        return False

    def resume(self, started: int, before: int) -> int:
        return before


class CountingEstimator:
    """Its state is the number of frames that it has had; `last` is that before the last frame."""

    last = -1

    def start(self, sensor: Sensor) -> int:
        return 0

    def step(self, state: int, grid: TrackedGrid) -> tuple[int, Surface, Contacts]:
        self.last = state
        return state + 1, SURFACE, Contacts()


def test_kept_states_are_few_and_any_frame_is_reached_from_them() -> None:
    estimate = CountingEstimator()
    pipeline = Pipeline(detect=CountingDetector(), track=CountingTracker(), estimate=estimate)
    setup = Setup(pipeline=pipeline, sensor=SENSOR, method="counting", version=0)
    processor = FrameProcessor()
    steps = 0
    for place in (0, 2000, 5, 1999, 0, 3000, 700):
        for each in range(processor.begin(setup, place, continues=False), place + 1):
            processor.step(Frame(index=each, timestamp_ns=0, camera="", image=None))
            steps += 1
        assert estimate.last == place
    assert len(processor.kept_places) <= KEPT_STATES
    assert steps < 3000 + 7 * 200
