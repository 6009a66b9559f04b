"""Results and truth from values in memory."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from manytouch.evaluation.evaluated_recordings.evaluated_recording import (
    ContactRows,
    EvaluatedRecording,
    EvaluationError,
    contact_rows,
)
from manytouch.values import Contacts, Reading, Sensor, Surface, TrackedGrid, Truth
from manytouch.values.arrays import read_only


@runtime_checkable
class OneFrame(Protocol):
    """What a reading and a truth have in common."""

    @property
    def grid(self) -> TrackedGrid: ...

    @property
    def surface(self) -> Surface: ...

    @property
    def contacts(self) -> Contacts: ...


def recording_of_readings(
    readings: Sequence[Reading], sensor: Sensor, *, name: str, method: str
) -> EvaluatedRecording:
    """A recording as a method estimated it."""
    return _recording(
        readings,
        sensor,
        name=name,
        method=method,
        frame=np.array([reading.frame.index for reading in readings], dtype=np.int64),
        status=tuple(reading.status for reading in readings),
        milliseconds=np.array([reading.milliseconds for reading in readings], dtype=np.float64),
    )


def recording_of_truths(truths: Sequence[Truth], sensor: Sensor, *, name: str) -> EvaluatedRecording:
    """The ground truth of a recording; the sensor is the true one."""
    return _recording(
        truths,
        sensor,
        name=name,
        method="",
        frame=np.array([truth.frame_index for truth in truths], dtype=np.int64),
        status=("ok",) * len(truths),
        milliseconds=np.full(len(truths), np.nan),
    )


def _recording(
    frames: Sequence[OneFrame],
    sensor: Sensor,
    *,
    name: str,
    method: str,
    frame: np.ndarray,
    status: tuple[str, ...],
    milliseconds: np.ndarray,
) -> EvaluatedRecording:
    if sensor.layout is None:
        raise EvaluationError(f"the sensor {sensor.name!r} has no markers; evaluate with one that has")
    if not frames:
        raise EvaluationError(f"{name} contains no frame; evaluate at least one")
    deviation_px = [np.sqrt(np.einsum("mii->mi", one.grid.covariance_px2)) for one in frames]
    seen = np.stack([one.grid.is_seen for one in frames])
    centre_px = np.stack([one.grid.position_px for one in frames])
    return EvaluatedRecording(
        name=name,
        method=method,
        unit=sensor.length_unit,
        frame=read_only(frame),
        status=status,
        milliseconds=read_only(milliseconds),
        marker=read_only(np.arange(len(sensor.layout.rest_mm))),
        place=read_only(sensor.layout.rest_mm[:, :2].copy()),
        place_unit=sensor.length_unit,
        centre_px=read_only(np.where(seen[..., None], centre_px, np.nan)),
        centre_std_px=read_only(np.stack(deviation_px)),
        depth_mm=read_only(np.stack([-one.surface.displacement_mm[:, 2] for one in frames])),
        depth_std_mm=read_only(np.sqrt(np.stack([one.surface.covariance_mm2[:, 2, 2] for one in frames]))),
        contacts=_rows([(int(index), one.contacts) for index, one in zip(frame, frames, strict=True)]),
    )


def _rows(contacts: Sequence[tuple[int, Contacts]]) -> ContactRows:
    touching = [(frame, contact) for frame, both in contacts for contact in both.touching]
    rows = [contact for _, contact in touching]

    def column(values: list[float]) -> np.ndarray:
        return np.array(values, dtype=np.float64)

    deviations = {
        **{f"{name}_std": column([row.std(name) for row in rows]) for name in ("x", "y", "depth")},
        **{f"{name}_std": column([row.std(name) for row in rows]) for name in ("shear_x", "shear_y")},
        "force_std": column([row.std("normal_force") for row in rows]),
    }
    return contact_rows(
        {
            "frame": np.array([frame for frame, _ in touching], dtype=np.int64),
            "id": np.array([row.id for row in rows], dtype=np.int64),
            "x": column([float(row.centre_mm[0]) for row in rows]),
            "y": column([float(row.centre_mm[1]) for row in rows]),
            "depth": column([row.depth_mm for row in rows]),
            "normal_force": column([-float(row.force_N[2]) for row in rows]),
            "shear_x": column([float(row.force_N[0]) for row in rows]),
            "shear_y": column([float(row.force_N[1]) for row in rows]),
            "torque": column([row.torque_Nmm for row in rows]),
            "torque_std": column([row.std("torque") for row in rows]),
            "area": column([row.area_mm2 for row in rows]),
            "area_std": column([row.std("area") for row in rows]),
            "half_major": column([row.half_major_mm for row in rows]),
            "half_minor": column([row.half_minor_mm for row in rows]),
            "orientation": column([row.orientation_rad for row in rows]),
            **deviations,
        }
    )
