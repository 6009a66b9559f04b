"""How much each dot has grown in the image since the sheet was at rest."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.neighbours import Neighbours
from manytouch.values import Layout, TrackedGrid
from manytouch.values.arrays import Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotGrowth:
    """Change of the logarithm of each dot's area.

    Attributes:
        limit: largest change that is believed, either way; a dot that a glint cuts seems to shrink by more.
        settle: part of what remains while nothing touches that is taken for rest, per frame.
        reach_pitch: radius of the window within which `summit` looks at growths.
        climb_pitch: how far a summit may be from where the climb begins.
        climbs: steps of a climb.
    """

    limit: float = 0.4
    settle: float = 0.01
    reach_pitch: float = 0.75
    climb_pitch: float = 1.5
    climbs: int = 10

    def __call__(self, grid: TrackedGrid, rest: Scalars, neighbours: Neighbours) -> Scalars | None:
        """Growth (m,) of all markers; None when the frame tells no areas.

        Args:
            grid: markers of the frame.
            rest: (m,) logarithm of the areas at rest in px^2, NaN where not known.
            neighbours: of the markers; those that show nothing take the mean of theirs, or 0.
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

    def summit(
        self,
        point_mm: Points2,
        growth: Float64[np.ndarray, " m"],
        layout: Layout,
        rest_mm: Float64[np.ndarray, "m 2"],
    ) -> Points2:
        """Where the dots near points (n, 2) have grown most: mean shift over what is above the median growth.

        Small dots count less, with the fourth power of their area: light changes what is seen of them.
        (Y. Cheng 1995, doi:10.1109/34.400568.)
        """
        trust = np.minimum(1.0, layout.radius_mm / np.median(layout.radius_mm)) ** 8
        weight = trust * np.maximum(growth - np.median(growth), 0.0)
        here_mm = point_mm
        for _ in range(self.climbs):
            off = (rest_mm - here_mm[:, None]) / (self.reach_pitch * layout.pitch_mm)
            near = weight * np.exp(-0.5 * (off**2).sum(axis=2))
            total = near.sum(axis=1, keepdims=True)
            here_mm = np.where(total > 0.0, near @ rest_mm / np.where(total > 0.0, total, 1.0), here_mm)
        way = (here_mm - point_mm) / layout.pitch_mm
        length = np.linalg.norm(way, axis=1, keepdims=True)
        way *= np.minimum(1.0, self.climb_pitch / np.maximum(length, 1e-12))
        summit_mm: Points2 = point_mm + way * layout.pitch_mm
        return summit_mm

    def std(self, grid: TrackedGrid) -> float | None:
        """Usual standard deviation of a growth, from that of the centres.

        Noise on the outline of a disc of radius r moves its centre along an axis by s and changes the
        logarithm of its area by sqrt(2) s / r: the weights along the outline are cos and 1.
        """
        if grid.area_px2 is None:
            return None
        from manytouch.estimation.kernels import median

        variance_px2 = median(grid.covariance_px2[:, 0, 0], grid.is_seen)
        return float(np.sqrt(2.0 * np.pi * variance_px2 / median(grid.area_px2, grid.is_seen)))

    def at_rest(self, grid: TrackedGrid, rest: Scalars, frames: int) -> Scalars:
        """Logarithm (m,) of the areas at rest after one more frame at rest; `frames` came before it."""
        if grid.area_px2 is None:
            return rest
        with np.errstate(invalid="ignore", divide="ignore"):
            now = np.log(grid.area_px2)
        now[~np.isfinite(now)] = np.nan
        moved = rest + max(self.settle, 1.0 / (frames + 1)) * (now - rest)
        return read_only(np.where(np.isnan(rest), now, np.where(np.isnan(moved), rest, moved)))
