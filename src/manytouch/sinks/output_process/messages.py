"""What a session and the process of its outputs exchange."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool

from manytouch.child_process import Refused
from manytouch.sinks.publishers.images import ImageTurns
from manytouch.values import (
    Command,
    Contacts,
    Detections,
    Frame,
    Health,
    OutputState,
    Reading,
    Sensor,
    Status,
    Surface,
    TrackedGrid,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Opening:
    """The first message to the process: which outputs to open, and for which session."""

    urls: tuple[str, ...]
    sensor: Sensor
    health: Health


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NewReading:
    """What outputs send of a reading: no detections, no positions in the image, no covariances of markers.

    Attributes:
        frame: has an image only if one is to be sent.
        contacts, milliseconds: as in `Reading`.
        statuses: of detections, grid and surface.
        is_seen: (m,) of the grid.
        surface_fields: fields of the surface that are sent.
        is_of_sensor: whether its layout is that of the sensor, which is left out.
        sensor: if it has changed.
        health: from time to time.
    """

    frame: Frame
    contacts: Contacts
    milliseconds: float
    statuses: tuple[Status, Status, Status]
    is_seen: Bool[np.ndarray, " m"]
    surface_fields: Mapping[str, Any]
    is_of_sensor: bool
    sensor: Sensor | None = None
    health: Health | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Opened:
    """The outputs are open; a sentence on each."""

    descriptions: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class States:
    """What each output has sent and dropped since the process was started."""

    outputs: tuple[OutputState, ...]


Answer = Opened | Refused | States | Command


def packed(
    reading: Reading,
    turns: Sequence[ImageTurns],
    sensor: Sensor,
    *,
    is_sensor_new: bool,
    health: Health | None,
) -> NewReading:
    """The message of a reading.

    Args:
        reading: of a session.
        turns: of the outputs that send images: an image that the camera did not encode is left out unless it
            is the turn of one of them.
        sensor: of the session now.
        is_sensor_new: whether the process does not have this sensor yet.
        health: to send with it.
    """
    surface = reading.surface
    is_of_sensor = surface.layout is not None and surface.layout is sensor.layout
    return NewReading(
        frame=_without_unused_image(reading.frame, turns),
        contacts=reading.contacts,
        milliseconds=reading.milliseconds,
        statuses=(reading.detections.status, reading.grid.status, surface.status),
        is_seen=reading.grid.is_seen,
        surface_fields={
            "position_mm": surface.position_mm,
            "displacement_mm": surface.displacement_mm,
            "spline": surface.spline,
            "interpolation": surface.interpolation,
            "layout": None if is_of_sensor else surface.layout,
        },
        is_of_sensor=is_of_sensor,
        sensor=sensor if is_sensor_new else None,
        health=health,
    )


def numbers_of(health: Health) -> Health:
    """The state of a session without the parameters of its method, which no output sends."""
    return replace(health, parameters={}, choices={}, parameter_info={})


def unpacked(message: NewReading, sensor: Sensor) -> Reading:
    """The reading of a message, for the sensor that was sent last; what was left out is unknown in it."""
    of_detections, of_grid, of_surface = message.statuses
    count = len(message.is_seen)
    fields = dict(message.surface_fields)
    if message.is_of_sensor:
        fields["layout"] = sensor.layout
    return Reading(
        frame=message.frame,
        detections=Detections(
            centre_px=_unknown(0, 2),
            covariance_px2=_unknown(0, 2, 2),
            area_px2=_unknown(0),
            contrast=_unknown(0),
            status=of_detections,
        ),
        grid=TrackedGrid(
            position_px=_unknown(count, 2),
            covariance_px2=_unknown(count, 2, 2),
            is_seen=message.is_seen,
            frames_unseen=(~message.is_seen).astype(np.int64),
            status=of_grid,
            timestamp_ns=message.frame.timestamp_ns,
        ),
        surface=Surface(**fields, covariance_mm2=_unknown(count, 3, 3), status=of_surface),
        contacts=message.contacts,
        milliseconds=message.milliseconds,
    )


def _unknown(*shape: int) -> np.ndarray:
    return np.broadcast_to(np.nan, shape)


def _without_unused_image(frame: Frame, turns: Sequence[ImageTurns]) -> Frame:
    is_sent = [turn.take(frame) for turn in turns]  # each counts its own turns
    if not any(is_sent):
        return replace(frame, image=None, encoded=None)
    return frame if frame.encoded is None else replace(frame, image=None)
