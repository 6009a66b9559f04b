"""A session that does nothing by itself, and readings with known content, for tests of the viewer."""

import time
from dataclasses import replace

import numpy as np

from contacts import contact_with
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import (
    Command,
    Comparison,
    Contacts,
    ContactShape,
    Detections,
    Frame,
    Health,
    OutlineRing,
    Reading,
    Sensor,
    Surface,
    TrackedGrid,
)
from manytouch.values.arrays import Points2

HEALTH = Health(
    is_running=True,
    source_state="ok",
    readings_per_s=30.0,
    latency_ms_p50=float("nan"),
    latency_ms_p99=float("nan"),
    frames=0,
    dropped=0,
    markers_seen=600,
    markers=600,
    method="perimeter",
    methods=("perimeter", "paper"),
    parameters={"detect.least_share": 0.5},
)


class FakeSession:
    """Controls that only list the commands that they receive."""

    def __init__(self) -> None:
        self.sensor: Sensor = demo_sensor(320)
        self.commands: list[Command] = []
        self.now = HEALTH
        self.other: Comparison | None = None

    def send(self, command: Command) -> None:
        self.commands.append(command)

    def health(self) -> Health:
        return self.now

    def comparison(self, frame_index: int) -> Comparison | None:
        return self.other

    def change_sensor(self, sensor: Sensor) -> None:
        self.sensor = sensor
        self.now = replace(self.now, sensor_version=self.now.sensor_version + 1)


def _circle(count: int) -> Points2:
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angle), np.sin(angle)])


def reading_of(index: int, depth_mm: float = 2.0, *, at_mm: tuple[float, float] = (-20.0, 8.0)) -> Reading:
    """A reading with one round dent and one contact."""
    layout = demo_sensor(320).layout
    assert layout is not None
    count = len(layout.rest_mm)
    moved = np.zeros((count, 3))
    moved[:, 2] = -depth_mm * np.exp(-np.sum((layout.rest_mm[:, :2] - at_mm) ** 2, axis=1) / 200.0)
    contact = contact_with(
        id=7,
        centre_mm=np.array(at_mm),
        centre_px=np.array([100.0, 90.0]),
        depth_mm=depth_mm,
        force_N=np.array([np.nan, np.nan, -1.5]),
        area_mm2=50.0,
        half_major_mm=5.0,
        half_minor_mm=3.0,
        orientation_rad=0.4,
        shape=ContactShape.PATCH,
        shape_probability=0.9,
        outline=(
            OutlineRing(point_mm=at_mm + 6.0 * _circle(24)),
            OutlineRing(point_mm=at_mm + 2.0 * _circle(12)[::-1], is_hole=True),
        ),
        covariance=np.diag(np.array([0.04, 0.09, 0.01, np.nan, np.nan, 0.0025, np.nan, np.nan])),
    )
    return Reading(
        frame=Frame(
            index=index,
            timestamp_ns=round(index * 1e9 / 30),
            camera="drawn",
            image=np.full((180, 320), 60, np.uint8),
            arrived_ns=time.monotonic_ns(),
        ),
        detections=Detections(
            centre_px=np.zeros((0, 2)),
            covariance_px2=np.zeros((0, 2, 2)),
            area_px2=np.zeros(0),
            contrast=np.zeros(0),
        ),
        grid=TrackedGrid(
            position_px=np.full((count, 2), 50.0),
            covariance_px2=np.zeros((count, 2, 2)),
            is_seen=np.ones(count, dtype=np.bool_),
            frames_unseen=np.zeros(count, dtype=np.int64),
        ),
        surface=Surface(
            position_mm=layout.rest_mm + moved,
            displacement_mm=moved,
            covariance_mm2=np.tile(0.01 * np.eye(3), (count, 1, 1)),
        ),
        contacts=Contacts(contacts=(contact,)),
        milliseconds=1.5,
    )
