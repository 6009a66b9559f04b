"""A session that outputs can be attached to."""

import pytest

from manytouch.values import Command, Comparison, Health, Sensor


class Session:
    """Controls of a session that does nothing but keep the commands."""

    def __init__(self, sensor: Sensor) -> None:
        self.sensor = sensor
        self.commands: list[Command] = []

    def send(self, command: Command) -> None:
        self.commands.append(command)

    def health(self) -> Health:
        return Health(
            is_running=True,
            source="ok",
            fps=30.0,
            latency_ms_p50=2.0,
            latency_ms_p99=3.0,
            frames=1,
            dropped=0,
            markers_seen=23,
            markers=23,
            method="mechanics",
            methods=("mechanics",),
            parameters={},
        )

    def comparison(self, frame_index: int) -> Comparison | None:
        return None


@pytest.fixture
def session(sensor: Sensor) -> Session:
    return Session(sensor)
