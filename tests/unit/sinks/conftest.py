"""A small sensor, wider than high, readings of it made by hand, and a session for outputs."""

from collections.abc import Callable

import numpy as np
import pytest

from contacts import contact_with
from layouts import lattice_layout
from manytouch.values import (
    Command,
    Comparison,
    Contact,
    Contacts,
    Detections,
    Frame,
    Health,
    Phase,
    Reading,
    Sensor,
    Sheet,
    Status,
    Surface,
    TrackedGrid,
)
from straight import straight_camera

ROWS, COLUMNS, MISSING = 4, 6, 9


def make_sensor(unit: str = "mm", young_MPa: float | None = 2.0) -> Sensor:
    """4 x 6 markers, 5 mm apart in x and 4 mm in y, one of them missing."""
    return Sensor(
        name="bench",
        camera=straight_camera(320, 240, focal_px=400.0, distance_mm=50.0),
        layout=lattice_layout(ROWS, COLUMNS, (5.0, 4.0), radius_mm=0.8, polarity="dark", missing=[MISSING]),
        sheet=Sheet(size_mm=np.array([40.0, 30.0]), thickness_mm=3.0, young_MPa=young_MPa),
        scale_is_known=unit == "mm",
        assumptions=("The camera has no distortion.",),
    )


def make_contact(number: int = 1, phase: Phase = Phase.MOVE, **changes: object) -> Contact:
    """A contact whose forces, torque and area are not known."""
    covariance = np.full((8, 8), np.nan)
    covariance[[0, 1, 2], [0, 1, 2]] = [0.04, 0.09, 0.25]
    known = {
        "centre_mm": np.array([2.5, -1.25]),
        "centre_px": np.array([179.5, 109.5]),
        "depth_mm": 1.5,
        "covariance": covariance,
    }
    return contact_with(id=number, phase=phase, **(known | changes))


def make_reading(
    index: int = 0,
    contacts: tuple[Contact, ...] = (),
    *,
    sensor: Sensor | None = None,
    shift_px: tuple[float, float] = (0.0, 0.0),
    unseen: tuple[int, ...] = (),
    depth_mm: float = 0.0,
    status: Status = Status.OK,
) -> Reading:
    """A frame in which all markers are moved alike and pressed alike."""
    layout = (sensor or make_sensor()).layout
    count = len(layout.rest_mm)
    seen = ~layout.is_missing
    seen[list(unseen)] = False
    position = layout.rest_mm[:, :2] * 8.0 + [159.5, 119.5] + np.array(shift_px)
    position[~seen] = np.nan
    displacement = np.tile([0.1, -0.2, -depth_mm], (count, 1))
    displacement[~seen] = np.nan
    covariance = np.tile(np.eye(3) * 0.01, (count, 1, 1))
    covariance[~seen] = np.nan
    image = None if status is Status.DECODE_ERROR else np.full((240, 320), 180, np.uint8)
    return Reading(
        frame=Frame(index=index, timestamp_ns=index * 40_000_000, camera="bench", image=image),
        detections=Detections(
            centre_px=position[seen],
            covariance_px2=np.tile(np.eye(2), (int(seen.sum()), 1, 1)),
            area_px2=np.full(int(seen.sum()), 100.0),
            contrast=np.full(int(seen.sum()), 80.0),
            status=status,
        ),
        grid=TrackedGrid(
            position_px=position,
            covariance_px2=np.tile(np.eye(2), (count, 1, 1)),
            is_seen=seen,
            frames_unseen=(~seen).astype(np.int64),
        ),
        surface=Surface(
            position_mm=layout.rest_mm + displacement,
            displacement_mm=displacement,
            covariance_mm2=covariance,
        ),
        contacts=Contacts(contacts=contacts),
        milliseconds=2.0 + index,
    )


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
            source_state="ok",
            readings_per_s=30.0,
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
def sensor() -> Sensor:
    return make_sensor()


@pytest.fixture
def sensor_of() -> Callable[..., Sensor]:
    return make_sensor


@pytest.fixture
def contact_of() -> Callable[..., Contact]:
    return make_contact


@pytest.fixture
def reading_of() -> Callable[..., Reading]:
    return make_reading


@pytest.fixture
def session(sensor: Sensor) -> Session:
    return Session(sensor)
