"""Change of the area of each dot in the image since the sheet was at rest."""

from dataclasses import dataclass

import numpy as np

from manytouch.geometry.neighbours import Neighbours
from manytouch.values import TrackedGrid
from manytouch.values.arrays import Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotAreaChange:
    """Change of the logarithm of each dot's area.

    Attributes:
        limit: changes are clipped to this size; a dot that a glint cuts seems to shrink by more.
        drift: share of the remaining change that a frame at rest adds to the areas at rest.
    """

    limit: float = 0.4
    drift: float = 0.01

    def __call__(self, grid: TrackedGrid, rest: Scalars, neighbours: Neighbours) -> Scalars | None:
        """(m,) change for all markers; None for a frame without areas.

        Args:
            grid: markers of the frame.
            rest: (m,) logarithm of the areas at rest in px^2, NaN where not known.
            neighbours: of the markers; a marker without an area gets the mean of its neighbours, or 0.
        """
        if grid.area_px2 is None:
            return None
        with np.errstate(invalid="ignore", divide="ignore"):
            growth: Scalars = np.clip(np.log(grid.area_px2) - rest, -self.limit, self.limit)
        known = np.isfinite(growth)
        growth[~known] = 0.0
        blank = np.flatnonzero(~known)
        if len(blank):
            around = neighbours.index[blank]
            growth[blank] = growth[around].sum(axis=1) / np.maximum(known[around].sum(axis=1), 1)
        return read_only(growth)

    def std(self, grid: TrackedGrid) -> float | None:
        """Median standard deviation of a change, from that of the centres; None for a frame without areas.

        Noise on the outline of a disc of radius r moves its centre along an axis by s and changes the
        logarithm of its area by sqrt(2) s / r: the weights along the outline are cos and 1.
        """
        if grid.area_px2 is None:
            return None
        from manytouch.estimation.kernels import median_where

        variance_px2 = median_where(grid.covariance_px2[:, 0, 0], grid.is_seen)
        return float(np.sqrt(2.0 * np.pi * variance_px2 / median_where(grid.area_px2, grid.is_seen)))

    def at_rest(self, grid: TrackedGrid, rest: Scalars, frames: int) -> Scalars:
        """(m,) logarithm of the areas at rest after one more frame at rest; `frames` came before it."""
        if grid.area_px2 is None:
            return rest
        with np.errstate(invalid="ignore", divide="ignore"):
            now = np.log(grid.area_px2)
        now[~np.isfinite(now)] = np.nan
        moved = rest + max(self.drift, 1.0 / (frames + 1)) * (now - rest)
        return read_only(np.where(np.isnan(rest), now, np.where(np.isnan(moved), rest, moved)))
