"""The depth of the sheet on an even lattice of points, between and a little beyond the markers."""

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import LinearNDInterpolator

from manytouch.sinks.description import layout_of
from manytouch.values import Sensor, Surface

POINTS_PER_PITCH = 4


class DepthMap:
    """Samples surfaces of one sensor.

    Attributes:
        x_mm: (nx,) columns of the map, undeformed sheet coordinates in the sensor's unit.
        y_mm: (ny,) its rows.
    """

    def __init__(self, sensor: Sensor) -> None:
        layout = layout_of(sensor)
        self._rest_mm = layout.rest_mm[:, :2]
        step = float(np.sqrt(np.prod(layout.pitch_mm))) / POINTS_PER_PITCH
        low, high = self._rest_mm.min(axis=0), self._rest_mm.max(axis=0)
        self.x_mm, self.y_mm = (
            np.linspace(begin, end, max(int(np.ceil((end - begin) / step)) + 1, 2))
            for begin, end in zip(low, high, strict=True)
        )

    def __call__(self, surface: Surface) -> Float64[np.ndarray, "y x"]:
        """Depth (ny, nx), positive when pressed; NaN where not known."""
        depth = -surface.displacement_mm[:, 2]
        known = np.isfinite(depth)
        if known.sum() < 4:
            return np.full((len(self.y_mm), len(self.x_mm)), np.nan)
        x, y = np.meshgrid(self.x_mm, self.y_mm)
        return np.asarray(LinearNDInterpolator(self._rest_mm[known], depth[known])(x, y))
