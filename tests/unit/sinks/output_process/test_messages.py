"""Messages to the process of the outputs: what is left out of a reading, and what is not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.sinks.output_process.messages import packed, unpacked
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.images import ImageTurns
from manytouch.values import Status
from piped import received, sent


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "pipe"


def test_a_reading_arrives_as_it_was_with_the_layout_of_the_sensor(
    sensor, reading_of, contact_of, file
) -> None:
    reading = reading_of(3, (contact_of(7),), depth_mm=1.5)
    reading = replace(reading, surface=replace(reading.surface, layout=sensor.layout))
    arrived = received(sent(packed(reading, [], sensor, is_sensor_new=True, health=None), file))
    found = unpacked(arrived, arrived.sensor)
    assert found.surface.layout is arrived.sensor.layout
    assert np.array_equal(found.surface.layout.rest_mm, sensor.layout.rest_mm)
    assert found.to_dict() == reading.to_dict()
    assert found.frame.timestamp_ns == reading.frame.timestamp_ns
    for name in ("displacement_mm", "position_mm"):
        before, after = getattr(reading.surface, name), getattr(found.surface, name)
        assert np.array_equal(before, after, equal_nan=True)
    assert np.isnan(found.surface.covariance_mm2).all()


def test_each_status_arrives(sensor, reading_of, file) -> None:
    reading = reading_of(3, status=Status.BLURRED)
    for part in ("detections", "grid", "surface", "contacts"):
        changed = replace(reading, detections=replace(reading.detections, status=Status.OK))
        changed = replace(changed, **{part: replace(getattr(changed, part), status=Status.DARK)})
        arrived = received(sent(packed(changed, [], sensor, is_sensor_new=False, health=None), file))
        found = unpacked(arrived, sensor)
        assert getattr(found, part).status is Status.DARK
        assert found.status is Status.DARK


def test_a_layout_of_an_earlier_sensor_goes_with_its_reading(sensor, sensor_of, reading_of) -> None:
    reading = reading_of(3)
    reading = replace(reading, surface=replace(reading.surface, layout=sensor.layout))
    message = packed(reading, [], sensor_of(), is_sensor_new=False, health=None)
    assert message.sensor is None
    assert unpacked(message, sensor_of()).surface.layout is sensor.layout


def test_only_images_that_an_output_sends_are_passed_on(sensor, reading_of) -> None:
    turns = [ImageTurns(parse_address(f"foxglove://:1?images={rate}")) for rate in (5, 10)]
    readings = [reading_of(index) for index in range(50)]  # 25 per second
    messages = [packed(each, turns, sensor, is_sensor_new=False, health=None) for each in readings]
    assert sum(message.frame.image is not None for message in messages) == 20
    assert packed(readings[0], [], sensor, is_sensor_new=False, health=None).frame.image is None
    encoded = replace(readings[0], frame=replace(readings[0].frame, encoded=b"jpeg"))
    frame = packed(encoded, turns, sensor, is_sensor_new=False, health=None).frame
    assert (frame.image, frame.encoded) == (None, b"jpeg")
    frame = packed(encoded, [], sensor, is_sensor_new=False, health=None).frame
    assert (frame.image, frame.encoded) == (None, None)
