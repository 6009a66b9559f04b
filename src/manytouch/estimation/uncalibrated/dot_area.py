"""Change of the area of each dot in the image since the sheet was at rest."""

from dataclasses import dataclass

import numpy as np

from manytouch.geometry.neighbours import Neighbours
from manytouch.medians import median
from manytouch.values import TrackedGrid
from manytouch.values.arrays import Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotAreaChange:
    """Change of the logarithm of each dot's area.

    Attributes:
        limit: changes are clipped to this size; a dot that a glint cuts seems to shrink by more.
        drift: least weight of a new frame in the running mean of the logarithms at rest.
    """

    limit: float = 0.4
    drift: float = 0.01

    def __call__(self, grid: TrackedGrid, rest_log_area: Scalars, neighbours: Neighbours) -> Scalars | None:
        """(m,) change for all markers; None if the detection does not measure areas.

        Args:
            grid: markers of the frame.
            rest_log_area: (m,) logarithm of the areas at rest in px^2, NaN where not known.
            neighbours: of the markers; a marker without an area gets the mean of its neighbours, or 0.
        """
        if grid.area_px2 is None:
            return None
        with np.errstate(invalid="ignore", divide="ignore"):
            growth: Scalars = np.clip(np.log(grid.area_px2) - rest_log_area, -self.limit, self.limit)
        known = np.isfinite(growth)
        growth[~known] = 0.0
        blank = np.flatnonzero(~known)
        if len(blank):
            around = neighbours.index[blank]
            growth[blank] = growth[around].sum(axis=1) / np.maximum(known[around].sum(axis=1), 1)
        return read_only(growth)

    def std(self, grid: TrackedGrid) -> float | None:
        """Standard deviation of a change: sqrt(2 pi v / A); None if the detection does not measure areas.

        v is the variance of a centre along x and A the area of a dot, medians of the seen markers. Noise of
        the outline, of the radius r at the angle t, moves the centre by the mean of 2 noise cos t and changes
        the logarithm of the area by the mean of 2 noise / r: the mean of cos^2 t is 1/2, hence
        sqrt(2 v) / r, with A = pi r^2.
        """
        if grid.area_px2 is None:
            return None
        variance_px2 = median(grid.covariance_px2[grid.is_seen, 0, 0])
        return float(np.sqrt(2.0 * np.pi * variance_px2 / median(grid.area_px2[grid.is_seen])))

    def updated_rest(self, grid: TrackedGrid, rest_log_area: Scalars, frames_before: int) -> Scalars:
        """(m,) logarithm of the areas at rest in px^2 after one more frame at rest.

        It is the mean of the first 1 / `drift` frames, then falls off exponentially. A marker without an area
        keeps its value; where that is NaN, the first area is taken.

        Args:
            grid: markers of the frame.
            rest_log_area: (m,) before it, NaN where not known.
            frames_before: number of frames at rest before it.
        """
        if grid.area_px2 is None:
            return rest_log_area
        with np.errstate(invalid="ignore", divide="ignore"):
            now = np.log(grid.area_px2)
        now[~np.isfinite(now)] = np.nan
        moved = rest_log_area + max(self.drift, 1.0 / (frames_before + 1)) * (now - rest_log_area)
        kept = np.where(np.isnan(moved), rest_log_area, moved)
        return read_only(np.where(np.isnan(rest_log_area), now, kept))
