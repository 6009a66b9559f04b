"""Protocol of what computes the load of each frame: `DisplacementLoad`, `SwellingLoad`."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.load.load_map import LoadMap
from manytouch.values import Sensor, TrackedGrid
from manytouch.values.arrays import Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadEstimate:
    """The load of one frame.

    Attributes:
        load_map: evaluates the load.
        coefficients: (k, l) of the load.
        variance: of the observations that the coefficients are linear in, from the noise of the image.
        observed: (m,) the observations, one per marker, where contacts are fitted to them; else empty.
    """

    load_map: LoadMap
    coefficients: Float64[np.ndarray, "k l"]
    variance: float
    observed: Scalars

    def at(self, point_mm: Points2) -> Scalars:
        """(n,) load at points (n, 2) of the sheet."""
        return self.load_map.load_at(point_mm, self.coefficients)


@runtime_checkable
class LoadEstimator(Protocol):
    """Computes the load of each frame. Its state is a value."""

    def start(self, sensor: Sensor, rest_mm: Points2) -> Any:
        """The state before the first frame, for markers (m, 2) in the plane of the sheet."""

    def load_map(self, state: Any) -> LoadMap:
        """The map of the state; the points at which it evaluates the load are the same in all frames."""

    def estimate_load(
        self, state: Any, grid: TrackedGrid, displacement_mm: Points2, std_mm: float
    ) -> LoadEstimate:
        """Estimate the load of a frame.

        Args:
            state: of the frame before.
            grid: markers of the frame.
            displacement_mm: (m, 2) from the present rest, in the plane of the sheet.
            std_mm: median standard deviation of these along an axis.
        """

    def refine(self, state: Any, load: LoadEstimate, centre_mm: Points2) -> Points2:
        """Centres (c, 2) of contacts, from those of the load peaks."""

    def update_rest(self, state: Any, grid: TrackedGrid, frames: int) -> Any:
        """The state after a frame at rest; `frames` at rest came before it."""
