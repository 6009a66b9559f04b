"""The pipeline: order, memory, and the second search when tracking is lost."""

from dataclasses import dataclass, field

import numpy as np

from manytouch.pipeline import Detector, Estimator, Pipeline, Sink, Tracker
from manytouch.values import Contacts, Detections, Frame, Sensor, Status, Surface, TrackedGrid
from straight import straight_camera

NOWHERE = np.zeros((2, 2))
SENSOR = Sensor(
    name="two markers",
    camera=straight_camera(8, 6, focal_px=10.0, distance_mm=10.0),
)


def frame(index: int) -> Frame:
    return Frame(index=index, timestamp_ns=index, camera="test", image=np.zeros((6, 8), np.uint8))


@dataclass
class Dots:
    """A detector that notes its calls, and finds as many dots as its calls so far."""

    calls: list[tuple[int, bool]] = field(default_factory=list)

    def start(self, sensor: Sensor) -> int:
        return 0

    def step(self, state: int, frame: Frame, expected_px: object) -> tuple[int, Detections]:
        self.calls.append((frame.index, expected_px is not None))
        return state + 1, Detections(
            centre_px=np.full((1, 2), float(expected_px is None)),
            covariance_px2=np.zeros((1, 2, 2)),
            area_px2=np.ones(1),
            contrast=np.ones(1),
            status=Status.DARK if frame.index == 2 else Status.OK,
        )


@dataclass
class Follows:
    """A tracker that is lost on frame 1 unless the whole picture was searched."""

    def start(self, sensor: Sensor) -> tuple[int, bool]:
        return 0, False

    def step(self, state: tuple[int, bool], detections: Detections) -> tuple[tuple[int, bool], TrackedGrid]:
        lost = state[0] == 1 and detections.centre_px[0, 0] == 0
        grid = TrackedGrid(
            position_px=NOWHERE,
            covariance_px2=np.zeros((2, 2, 2)),
            is_seen=np.zeros(2, bool),
            frames_unseen=np.full(2, state[0]),
            status=Status.FEW_MARKERS if state[0] == 3 else Status.OK,
        )
        return (state[0] + 1, lost), grid

    def expected_px(self, state: tuple[int, bool]) -> np.ndarray | None:
        return None if state[0] == 0 else NOWHERE

    def needs_full_search(self, state: tuple[int, bool]) -> bool:
        return state[1]

    def resume(self, started: tuple[int, bool], before: tuple[int, bool]) -> tuple[int, bool]:
        return before


@dataclass
class Flat:
    def start(self, sensor: Sensor) -> int:
        return 0

    def step(self, state: int, grid: TrackedGrid) -> tuple[int, Surface, Contacts]:
        nothing = np.zeros((2, 3))
        surface = Surface(
            position_mm=nothing,
            displacement_mm=nothing,
            covariance_mm2=np.zeros((2, 3, 3)),
            status=Status.NOT_CONVERGED,
        )
        return state + 1, surface, Contacts()


def readings() -> tuple[Dots, list]:
    looks = Dots()
    pipeline = Pipeline(detect=looks, track=Follows(), estimate=Flat())
    return looks, list(pipeline.run([frame(index) for index in range(4)], SENSOR))


def test_every_frame_gives_one_reading_in_order() -> None:
    _, made = readings()
    assert [reading.frame.index for reading in made] == [0, 1, 2, 3]
    assert all(reading.milliseconds > 0 for reading in made)


def test_an_estimator_knows_the_time_of_a_frame() -> None:
    _, made = readings()
    assert [reading.grid.timestamp_ns for reading in made] == [0, 1, 2, 3]


def test_the_dots_of_a_reading_are_read_only() -> None:
    _, made = readings()
    found = made[0].detections
    arrays = (found.centre_px, found.covariance_px2, found.area_px2, found.contrast)
    assert not any(array.flags.writeable for array in arrays)


def test_a_lost_frame_is_searched_again_from_the_memory_before_it() -> None:
    looks, made = readings()
    assert looks.calls == [(0, False), (1, True), (1, False), (2, True), (3, True)]
    assert [int(reading.grid.frames_unseen[0]) for reading in made] == [0, 1, 2, 3]


def test_the_status_is_that_of_the_first_stage_with_one() -> None:
    _, made = readings()
    assert [reading.status for reading in made] == ["not_converged", "not_converged", "dark", "few_markers"]


def test_the_protocols_distinguish_stages() -> None:
    assert isinstance(Dots(), Detector)
    assert isinstance(Follows(), Tracker)
    assert isinstance(Flat(), Estimator)
    assert not isinstance(Flat(), Tracker)
    assert not isinstance(Flat(), Sink)
