"""Tare: the present marker positions become the reference."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manytouch.geometry.refraction import rest_px
from manytouch.values import Sensor, TrackedGrid
from manytouch.values.arrays import read_only

TARE_FRAMES = 15
_LEAST_SHARE = 0.5


def tare_sensor(sensor: Sensor, grids: Sequence[TrackedGrid]) -> Sensor | None:
    """Replace the reference positions of a sensor by the medians over some frames.

    A marker that is seen in none of them is moved by the median of the others.

    Args:
        sensor: with a layout.
        grids: of consecutive frames of the sheet at rest.

    Returns:
        The sensor, or None when fewer than half of the markers were seen.
    """
    layout = sensor.layout
    if layout is None or not grids:
        return None
    before_px = rest_px(sensor, layout)
    place_px = np.stack([grid.position_px for grid in grids])
    seen = np.isfinite(place_px[..., 0]).any(axis=0)
    if seen.sum() < _LEAST_SHARE * (~layout.is_missing).sum():
        return None
    after_px = np.array(before_px)
    after_px[seen] = np.nanmedian(place_px[:, seen], axis=0)
    after_px[~seen] += np.median(after_px[seen] - before_px[seen], axis=0)
    return replace(sensor, layout=replace(layout, rest_px=read_only(after_px)), rest_is_doubtful=False)
