"""The depth of the sheet on an even grid of points, between and a little beyond the markers."""

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.sampling import BEYOND_PITCH, sampling_on
from manytouch.sinks.description import layout_of
from manytouch.values import Sensor, Surface

POINTS_PER_PITCH = 4


class DepthMap:
    """Samples surfaces of one sensor, up to half a pitch outside its outer markers.

    Attributes:
        x_mm: (nx,) columns of the map, undeformed sheet coordinates in the sensor's unit.
        y_mm: (ny,) its rows.
    """

    def __init__(self, sensor: Sensor) -> None:
        layout = layout_of(sensor)
        rest_mm = layout.rest_mm[:, :2]
        step = float(np.sqrt(np.prod(layout.pitch_mm))) / POINTS_PER_PITCH
        beyond = BEYOND_PITCH * layout.pitch_mm
        low, high = rest_mm.min(axis=0) - beyond, rest_mm.max(axis=0) + beyond
        self.x_mm, self.y_mm = (
            np.linspace(begin, end, max(int(np.ceil((end - begin) / step)) + 1, 2))
            for begin, end in zip(low, high, strict=True)
        )
        self._sampling = sampling_on(layout, self.x_mm, self.y_mm)

    def __call__(self, surface: Surface) -> Float64[np.ndarray, "ny nx"]:
        """Depth (ny, nx), positive when pressed; NaN where not known."""
        return self._sampling(-surface.displacement_mm[:, 2])
