"""The reading with which messages are made before there is a real one."""

import pytest

from manytouch.sinks.output_process.rest_reading import rest_reading
from manytouch.sinks.publishers import foxglove_live, ros2
from manytouch.sinks.publishers.registry import warm_up


@pytest.mark.parametrize("young_MPa", [None, 2.0])
def test_all_messages_can_be_made_of_it(sensor_of, young_MPa) -> None:
    sensor = sensor_of(young_MPa=young_MPa)
    reading = rest_reading(sensor.layout)
    messages = ros2.warm_up(reading, sensor)
    assert {message.topic.rpartition("/")[2] for message in messages} == {
        *("wrench", "contacts", "surface", "contact_markers", "compressed", "camera_info")
    }
    assert all(foxglove_live.warm_up(reading, sensor))
    assert len(foxglove_live.warm_up(reading, sensor)) == 6


def test_only_requested_outputs_are_warmed_up(sensor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros2, "RosMessages", lambda _: pytest.fail("it was not requested"))
    warm_up(["osc://127.0.0.1:9", "foxglove://:1"], rest_reading(sensor.layout), sensor)
    with pytest.raises(pytest.fail.Exception):
        warm_up(["ros2://a"], rest_reading(sensor.layout), sensor)
