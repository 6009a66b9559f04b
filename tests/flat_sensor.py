"""Sensors whose camera looks straight at the sheet with 1 px per mm, and detections of their dots."""

import numpy as np

from layouts import marker_layout, rows_and_columns
from manytouch.values import Detections, Sensor, Status
from straight import straight_camera


def flat_sensor(
    rest_px,
    *,
    width_px,
    height_px,
    pitch_px=40.0,
    radius_px=8.0,
    row_column=None,
    is_missing=None,
    polarity="light",
):
    """The sensor whose markers (m, 2) lie at given positions in the image; markers at rest are at z = 0."""
    return Sensor(
        name="flat",
        camera=straight_camera(width_px, height_px, focal_px=1e3, distance_mm=1e3, principal_px=(0.0, 0.0)),
        layout=marker_layout(
            rest_px,
            pitch_mm=pitch_px,
            radius_mm=radius_px,
            row_column=row_column,
            polarity=polarity,
            missing=() if is_missing is None else np.flatnonzero(is_missing),
        ),
    )


def rectangle_px(rows, columns, pitch_px=(40.0, 40.0), first_px=(0.0, 0.0)):
    """(m, 2) positions of a rectangle of markers."""
    return rows_and_columns(rows, columns)[:, ::-1] * np.array(pitch_px) + np.array(first_px)


def detections_of(centre_px, *, std_px=0.02, area_px2=200.0, contrast=60.0, status=Status.OK):
    """Detections of dots (n, 2) with one covariance; area and contrast are numbers or (n,)."""
    n = len(centre_px)
    return Detections(
        centre_px=np.array(centre_px, dtype=np.float64).reshape(n, 2),
        covariance_px2=np.tile(std_px**2 * np.eye(2), (n, 1, 1)),
        area_px2=np.broadcast_to(area_px2, n).astype(np.float64),
        contrast=np.broadcast_to(contrast, n).astype(np.float64),
        status=status,
    )
