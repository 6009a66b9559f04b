"""Tare: the present marker positions become the reference."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from manytouch.errors import SensorError
from manytouch.geometry.refraction import rest_px
from manytouch.pipeline import TrackedFrame
from manytouch.values import Sensor, TrackedGrid
from manytouch.values.arrays import read_only

TARE_FRAMES = 15
_LEAST_SHARE = 0.5


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TareTime:
    """Timestamps of the first and the last frame that a tare was computed from."""

    begin_ns: int
    end_ns: int


class TareCollector:
    """Collects the frames of a tare that was requested."""

    def __init__(self) -> None:
        """None is requested."""
        self._frames: list[TrackedFrame] | None = None

    def begin(self) -> None:
        """Collect the following frames, unless this has begun."""
        self._frames = [] if self._frames is None else self._frames

    def add(self, tracked: TrackedFrame, sensor: Sensor) -> tuple[Sensor, TareTime | None]:
        """Take a frame.

        Returns:
            The sensor with the new reference and the time of the tare, once there are enough frames; until
            then the sensor and None.

        Raises:
            SensorError: there are enough, and too few markers are seen in them.
        """
        if self._frames is None:
            return sensor, None
        self._frames.append(tracked)
        if len(self._frames) < TARE_FRAMES:
            return sensor, None
        frames, self._frames = self._frames, None
        tared = tare_sensor(sensor, [each.grid for each in frames])
        if tared is None:
            raise SensorError("fewer than half of the markers are seen")
        begin_ns, end_ns = (frames[place].frame.timestamp_ns for place in (0, -1))
        return tared, TareTime(begin_ns=begin_ns, end_ns=end_ns)


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
