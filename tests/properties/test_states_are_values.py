"""A stage is a function of its state and its input: what else was computed in between changes nothing."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import clips
from layouts import lattice_layout
from manytouch.pipeline import Pipeline
from manytouch.session.methods import METHODS, pipeline_for
from manytouch.values import Frame, Sensor, Sheet
from same_bits import assert_same_bits
from straight import straight_camera

PX_PER_MM = 8.0
PRESSES_PX = {
    "pressed": (0.0, 0.0, 4.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.1),
    "released": (0.0, 9.0, 9.0, 9.0, 9.0, 3.0, 0.0, 0.0, 0.0),
}
SEED = {"pressed": 0, "released": 1000}


def sensor_of(*, is_known: bool) -> Sensor:
    return Sensor(
        name="clip",
        camera=straight_camera(
            clips.WIDTH_PX, clips.HEIGHT_PX, focal_px=100.0 * PX_PER_MM, distance_mm=100.0
        ),
        layout=lattice_layout(
            clips.ROWS,
            clips.COLUMNS,
            np.array(clips.PITCH_PX) / PX_PER_MM,
            radius_mm=7.0 / PX_PER_MM,
            polarity="dark",
        ),
        sheet=Sheet(size_mm=np.array([44.0, 34.0]), thickness_mm=3.0, young_MPa=2.0, poisson=0.45)
        if is_known
        else None,
    )


def frames_of(course: str) -> Iterator[Frame]:
    for index, press_px in enumerate(PRESSES_PX[course]):
        yield Frame(
            index=index,
            timestamp_ns=index * 40_000_000,
            camera="test",
            image=clips.picture(press_px, seed=SEED[course] + index),
        )


class Course:
    """One recording, processed from given states frame by frame."""

    def __init__(self, pipeline: Pipeline, states: tuple[Any, Any, Any], course: str) -> None:
        self.pipeline = pipeline
        self.detecting, self.tracking, self.estimating = states
        self.frames = frames_of(course)
        self.results: list[Any] = []

    def step(self) -> None:
        stages, frame = self.pipeline, next(self.frames)
        expected_px = stages.track.expected_px(self.tracking)
        self.detecting, detections = stages.detect.step(self.detecting, frame, expected_px)
        self.tracking, grid = stages.track.step(self.tracking, detections)
        self.estimating, surface, contacts = stages.estimate.step(self.estimating, grid)
        self.results.append((detections, grid, surface, contacts))


@pytest.mark.usefixtures("each_is_computed_again")
@pytest.mark.parametrize(("method", "is_known"), [*((name, True) for name in METHODS), ("mechanics", False)])
def test_interleaved_states_give_the_same_bits_as_separate_ones(method: str, is_known: bool) -> None:
    pipeline, sensor = pipeline_for(method), sensor_of(is_known=is_known)

    def start() -> tuple[Any, Any, Any]:
        return tuple(stage.start(sensor) for stage in (pipeline.detect, pipeline.track, pipeline.estimate))

    separate = [Course(pipeline, start(), name) for name in PRESSES_PX]
    for course in separate:
        for _ in PRESSES_PX["pressed"]:
            course.step()
    shared = start()
    interleaved = [Course(pipeline, shared, name) for name in PRESSES_PX]
    for _ in PRESSES_PX["pressed"]:
        for course in interleaved:
            course.step()
    for one, other in zip(separate, interleaved, strict=True):
        assert_same_bits(one.results, other.results)
    # The recordings differ, and at least one has a contact.
    assert {len(results[3].touching) for course in separate for results in course.results} >= {0, 1}
