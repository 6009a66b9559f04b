"""A sensor with the markers of a part of its sheet, for tests that need few of them."""

from dataclasses import replace

import numpy as np

from manytouch.values import Sensor


def part_of_sheet(sensor: Sensor, size_mm: tuple[float, float]) -> Sensor:
    """The same camera before a sheet of that size, with the markers that are on it."""
    layout, sheet = sensor.layout, sensor.sheet
    assert layout is not None
    assert sheet is not None
    near = (np.abs(layout.rest_mm[:, :2]) < np.array(size_mm) / 2).all(axis=1)
    few = replace(
        layout,
        rest_mm=layout.rest_mm[near],
        row_column=None,
        radius_mm=layout.radius_mm[near],
        is_missing=layout.is_missing[near],
        rest_px=None if layout.rest_px is None else layout.rest_px[near],
        rest_radius_px=None if layout.rest_radius_px is None else layout.rest_radius_px[near],
    )
    return replace(sensor, layout=few, sheet=replace(sheet, size_mm=np.array(size_mm)))
