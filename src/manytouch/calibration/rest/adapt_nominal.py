"""A nominal sensor file adapted to a recording: rows, columns and pose as the first frames show them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manytouch.calibration.rest.assumed_sensor import sensor_from_rest
from manytouch.calibration.rest.pose import fit_pose
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.sheet.pad_outline import pad_of
from manytouch.errors import LayoutError
from manytouch.values import Frame, Roi, Sensor
from manytouch.values.arrays import read_only

NOMINAL = "nominal"
"""Key of `[provenance]` in the sensor files of the package, which describe a kind of sensor, not a device."""


def is_nominal(sensor: Sensor) -> bool:
    """Whether a sensor file describes a kind of sensor."""
    return sensor.provenance.get(NOMINAL) is True


def register_nominal(sensor: Sensor, frames: Sequence[Frame], *, roi_px: Roi | None = None) -> Sensor:
    """As `register_rest`, with rows, columns and pose of the frames where they differ from the nominal ones.

    Camera, pitch and sheet are those of the file. What was changed is an assumption of the sensor.

    Raises:
        SensorError, SourceError: see `register_rest`.
        LayoutError: the frames show no lattice, and the nominal markers were not found either.
    """
    assert sensor.layout is not None
    nominal = sensor.layout
    pitch_mm = (float(nominal.pitch_mm[0]), float(nominal.pitch_mm[1]))
    try:
        found = sensor_from_rest(frames, name=sensor.name, pitch_mm=pitch_mm, roi_px=roi_px)
    except LayoutError:
        return register_rest(sensor, frames, roi_px=roi_px)
    layout = found.layout
    if layout is None or layout.row_column is None or layout.rest_px is None or layout.shape == nominal.shape:
        return register_rest(sensor, frames, roi_px=roi_px)
    middle = layout.row_column.max(axis=0) / 2
    rest_mm = np.zeros((len(layout.rest_mm), 3))
    rest_mm[:, :2] = (layout.row_column - middle)[:, ::-1] * nominal.pitch_mm
    there = ~layout.is_missing & np.isfinite(layout.rest_px[:, 0])
    camera, _ = fit_pose(sensor.camera, rest_mm[there], layout.rest_px[there], pad_of(sensor))
    adapted = replace(
        layout,
        rest_mm=read_only(rest_mm),
        pitch_mm=nominal.pitch_mm,
        radius_mm=read_only(np.full(len(rest_mm), float(np.median(nominal.radius_mm)))),
        height_mm=nominal.height_mm,
    )
    shapes = [" x ".join(map(str, shape or ("?",))) for shape in (layout.shape, nominal.shape)]
    sentence = (
        f"The sensor file is nominal: it has {shapes[1]} markers, but {shapes[0]} were found. Rows, columns "
        "and pose are those of this recording; camera, pitch and sheet are those of the file."
    )
    return register_rest(
        replace(sensor, camera=camera, layout=adapted, assumptions=(*sensor.assumptions, sentence)),
        frames,
        roi_px=roi_px,
    )
