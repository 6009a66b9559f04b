"""A contact in rig coordinates, and its row in contacts.csv of a rig."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from manytouch.rigs.rig_file import RigSensor
from manytouch.sinks.files.tables import cell, contact_column_names, six_digits
from manytouch.values import ESTIMATES, Contact, Frame, Phase, Sensor
from manytouch.values.tabular.rows import contact_row

_POSITION = [ESTIMATES.index(name) for name in ("x", "y", "depth")]
_FORCE = [ESTIMATES.index(name) for name in ("shear_x", "shear_y", "normal_force")]
_FLIP = np.diag([1.0, 1.0, -1.0])  # z = -depth, and force z = -normal force
_OF_THE_SHEET = {name: f"sheet_{name}" for name in ("x_mm", "y_mm", "x_std_mm", "y_std_mm")}
_OWN = tuple(
    name
    for name in contact_column_names("mm")
    if name not in ("frame", "time_s", "contact", "phase", "depth_mm")
)
"""Columns of a sensor alone that a rig has too, after its own."""
COLUMNS = (
    *("time_s", "sensor", "frame", "contact", "phase", "x_mm", "y_mm", "z_mm", "depth_mm"),
    *("force_x_N", "force_y_N", "force_z_N", "sensor_time_s"),
    *("x_std_mm", "y_std_mm", "z_std_mm", "force_x_std_N", "force_y_std_N", "force_z_std_N"),
    *(_OF_THE_SHEET.get(name, name) for name in _OWN),
)
Three = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class RigContact:
    """A contact in rig coordinates, which the pose of each sensor in the rig file defines; NaN is not known.

    Attributes:
        id, phase: see `manytouch.Contact`.
        frame: number of the frame of its sensor.
        sensor_time_s: of the frame, as the source counts it.
        position_mm, position_std_mm: of its centre on the pressed surface, without an error of the pose.
        force_N, force_std_N: of the object on the sheet.
        depth_mm: see `manytouch.Contact`.
        own: further values as the sensor alone states them, by column of its contacts.csv.
    """

    id: int
    phase: Phase
    frame: int
    sensor_time_s: float
    position_mm: Three
    position_std_mm: Three
    force_N: Three
    force_std_N: Three
    depth_mm: float
    own: dict[str, Any]

    def row(self, sensor: str, time_s: float) -> list[object]:
        """Values of `COLUMNS`."""
        numbers = (*self.position_mm, self.depth_mm, *self.force_N)
        stds = (*self.position_std_mm, *self.force_std_N)
        return [
            *(f"{time_s:.6f}", sensor, self.frame, self.id, self.phase.value),
            *(six_digits(value) for value in numbers),
            f"{self.sensor_time_s:.6f}",
            *(six_digits(value) for value in stds),
            *(cell(self.own[name]) for name in _OWN),
        ]


def in_rig(contact: Contact, sensor: Sensor, rig_sensor: RigSensor, frame: Frame) -> RigContact:
    """A contact in rig coordinates; without lengths if the sensor's scale is not known."""
    x, y = (float(value) for value in contact.centre_mm)
    has_scale = sensor.length_unit == "mm"
    position = rig_sensor.rotation @ np.array([x, y, -contact.depth_mm]) + rig_sensor.translation_mm
    position_std = _turned_stds(contact, _POSITION, rig_sensor)
    unknown = np.full(3, np.nan)
    own = contact_row(frame, contact)
    return RigContact(
        id=contact.id,
        phase=contact.phase,
        frame=frame.index,
        sensor_time_s=frame.timestamp_ns * 1e-9,
        position_mm=_three(position if has_scale else unknown),
        position_std_mm=_three(position_std if has_scale else unknown),
        force_N=_three(rig_sensor.rotation @ np.asarray(contact.force_N, dtype=np.float64)),
        force_std_N=_three(_turned_stds(contact, _FORCE, rig_sensor)),
        depth_mm=float(contact.depth_mm) if has_scale else float("nan"),
        own={name: own[name] if has_scale or not name.endswith(("_mm", "_mm2")) else None for name in _OWN},
    )


def _turned_stds(contact: Contact, places: list[int], rig_sensor: RigSensor) -> np.ndarray:
    """Standard deviations (3,) in rig coordinates of three estimates; the last is along -z of the sheet."""
    turn = rig_sensor.rotation @ _FLIP
    covariance = contact.covariance[np.ix_(places, places)]
    return np.asarray(np.sqrt(np.clip(np.diag(turn @ covariance @ turn.T), 0.0, None)))


def _three(values: np.ndarray) -> Three:
    x, y, z = (float(value) for value in values)
    return x, y, z
