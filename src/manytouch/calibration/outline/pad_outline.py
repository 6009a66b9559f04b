"""The outline of a bonded pad: as the image shows it, or as the sensor file states it."""

from dataclasses import replace

import cv2
import numpy as np

from manytouch.calibration.outline.clamp_line import ClampLine
from manytouch.values import Sensor, Sheet
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.default_std import sheet_std

SEEN_STD_MM = 0.2
"""Standard deviation of a side that the image shows."""
MAX_STDS = 3.0
"""A visible edge farther than this from the side in the sensor file, in its deviations, is not the pad's."""


def pad_of(sensor: Sensor) -> Sheet | None:
    """The sheet, if it is a bonded pad."""
    sheet = sensor.sheet
    return sheet if sheet is not None and sheet.boundary == "bonded" else None


def with_seen_outline(found: Sensor, seen: ClampLine) -> tuple[Sensor, ClampLine]:
    """The pad with the outline that the image shows, and its origin at the middle of the outline.

    Two opposite sides stay as stated where one is not visible or too far from the sensor file to be its own.

    Args:
        found: a bonded pad in its pose.
        seen: the edges in the frame of its markers.
    """
    sheet = found.sheet
    assert sheet is not None
    stated_mm = 0.5 * np.repeat(sheet.size_mm, 2) * [-1.0, 1.0, -1.0, 1.0]
    outline_mm = sheet_std(sheet).outline_mm
    limit_mm = max(MAX_STDS * outline_mm, MAX_STDS * SEEN_STD_MM)
    is_near = np.abs(seen.side_mm - stated_mm) <= limit_mm  # False for NaN
    is_seen = np.repeat(is_near.reshape(2, 2).all(axis=1), 2)
    if not is_seen.any():
        return found, seen
    side_mm = np.where(is_seen, seen.side_mm, stated_mm)
    size_mm = side_mm[1::2] - side_mm[::2]
    std_mm = min(outline_mm, SEEN_STD_MM) if is_seen.all() else outline_mm
    sized = replace(sheet, size_mm=read_only(size_mm), outline_std_mm=std_mm)
    moved, _ = with_origin_at(replace(found, sheet=sized), ClampLine(side_mm=side_mm))
    middle_mm = 0.5 * (side_mm[1::2] + side_mm[::2])
    return moved, ClampLine(side_mm=seen.side_mm - np.repeat(middle_mm, 2))


def with_origin_at(found: Sensor, outline: ClampLine) -> tuple[Sensor, ClampLine]:
    """The sensor and the outline with the origin of the sheet at the middle of the outline."""
    assert found.layout is not None
    middle_mm = np.array([*outline.middle_mm, 0.0])
    rotation, _ = cv2.Rodrigues(found.camera.rotation_vector)
    camera = replace(
        found.camera, translation_mm=read_only(found.camera.translation_mm + rotation @ middle_mm)
    )
    layout = replace(found.layout, rest_mm=read_only(found.layout.rest_mm - middle_mm))
    moved = ClampLine(side_mm=outline.side_mm - np.repeat(outline.middle_mm, 2))
    return replace(found, camera=camera, layout=layout), moved
