"""A job reads and tracks files in a thread of its own, ahead of the estimation."""

import threading
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from drawn_source import DrawnSource
from manytouch.errors import SensorError
from manytouch.session import prepare
from manytouch.values import Reading
from waiting import wait_until

THREAD = "manytouch-track"
FILES = (Path(__file__),)


def readings_of(source: DrawnSource) -> Generator[Reading, None, None]:
    return cast(Any, prepare(source, pitch_mm=4.0, method="perimeter").readings())


def is_tracking() -> bool:
    return any(each.name == THREAD for each in threading.enumerate())


def test_frames_of_a_recording_are_tracked_while_one_is_estimated() -> None:
    source = DrawnSource(frames=40, files=FILES)
    readings = readings_of(source)
    for index in range(20):
        assert next(readings).frame.index == index
    wait_until(lambda: source.taken[-1] > 22)
    assert is_tracking()
    readings.close()
    assert source.taken[-1] < 30
    assert not is_tracking()


def test_a_recording_has_the_readings_of_its_pipeline_in_order() -> None:
    job = prepare(DrawnSource(frames=40, files=FILES), pitch_mm=4.0, method="perimeter")
    readings = list(job.readings())
    alone = list(job.pipeline.run(DrawnSource(frames=40), job.sensor))
    assert [each.frame.index for each in readings] == list(range(40))
    for one, other in zip(readings, alone, strict=True):
        assert np.array_equal(one.grid.position_px, other.grid.position_px, equal_nan=True)
        assert len(one.contacts.contacts) == len(other.contacts.contacts)
    assert not is_tracking()


def test_an_error_of_the_source_reaches_the_caller_after_the_readings_before_it() -> None:
    readings, read = readings_of(DrawnSource(frames=40, files=FILES, fails_at=30)), []
    with pytest.raises(ValueError, match="fell off the table"):
        read.extend(each.frame.index for each in readings)
    assert not is_tracking()


@pytest.mark.parametrize("is_live", [False, True])
def test_frames_that_are_made_on_demand_are_not_taken_ahead(is_live: bool) -> None:
    """A simulation of one's own may go on after each reading."""
    source = DrawnSource(frames=60, is_live=is_live)
    readings = readings_of(source)
    for _ in range(20):
        reading = next(readings)
    assert source.taken[-1] == reading.frame.index
    assert not is_tracking()
    readings.close()


@pytest.mark.parametrize(("method", "thickness"), [("mechanics", "0.75 pitches"), ("perimeter", "one pitch")])
def test_the_sheet_that_is_assumed_for_a_sensor_without_one_is_stated(method: str, thickness: str) -> None:
    found = prepare(DrawnSource(frames=20), pitch_mm=4.0, method="perimeter").sensor
    sensor = replace(found, sheet=None, assumptions=())
    job = prepare(DrawnSource(frames=20), sensor=sensor, method=method)
    (sentence,) = (each for each in job.sensor.assumptions if "[sheet]" in each)
    assert f"The sheet is {thickness} thick" in sentence
    known = prepare(DrawnSource(frames=20), sensor=replace(sensor, sheet=found.sheet), method=method)
    assert not any("[sheet]" in each for each in known.sensor.assumptions)


@pytest.mark.parametrize("pitch_mm", [None, 4.0])
def test_a_sensor_with_a_camera_only_is_refused_with_one_remedy(pitch_mm: float | None) -> None:
    source = DrawnSource(frames=20)
    camera_only = replace(prepare(source, pitch_mm=4.0, method="perimeter").sensor, layout=None, sheet=None)
    with pytest.raises(SensorError, match="add them by manytouch calibrate rest"):
        prepare(DrawnSource(frames=20), sensor=camera_only, pitch_mm=pitch_mm)
