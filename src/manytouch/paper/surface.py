"""The surface between markers by inverse distance weighting, and its peaks (Figures 11 to 13)."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from manytouch.values.arrays import Counts, Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InverseDistance:
    """Inverse distance weighting (D. Shepard 1968, doi:10.1145/800186.810616): from markers to a grid.

    Attributes:
        x_mm, y_mm: (n,) coordinates of columns and rows of the grid.
        weights: (n * n, m) distance to the negative power; 0 beyond the search radius.
    """

    x_mm: Float64[np.ndarray, " n"]
    y_mm: Float64[np.ndarray, " n"]
    weights: csr_array

    def __call__(self, value: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, "n n"]:
        """(row, column) surface through the known values; NaN where there is none within the radius."""
        is_known = np.isfinite(value)
        total = self.weights @ is_known.astype(np.float64)
        share = self.weights @ np.where(is_known, value, 0.0)
        plane = share / np.where(total > 0.0, total, np.nan)
        return np.asarray(plane.reshape(len(self.y_mm), len(self.x_mm)))

    def at(self, row: int, column: int, is_known: Bool[np.ndarray, " m"]) -> tuple[Counts, Scalars]:
        """The known markers that determine a point of the grid, and their weights, which sum to 1."""
        place = row * len(self.x_mm) + column
        part = slice(*self.weights.indptr[place : place + 2])
        marker, weight = self.weights.indices[part].astype(np.int64), self.weights.data[part]
        use = is_known[marker]
        return marker[use], weight[use] / weight[use].sum()


def inverse_distance(rest_mm: Points2, iterations: int, radius_mm: float, power: float) -> InverseDistance:
    """Weights from markers (m, 2) to a grid of iterations x iterations points over their bounding box."""
    low, high = rest_mm.min(axis=0), rest_mm.max(axis=0)
    x_mm = np.linspace(low[0], high[0], iterations)
    y_mm = np.linspace(low[1], high[1], iterations)
    point_mm = np.stack(np.meshgrid(x_mm, y_mm), axis=-1).reshape(-1, 2)
    near = cKDTree(point_mm).sparse_distance_matrix(cKDTree(rest_mm), radius_mm, output_type="ndarray")
    distance = np.maximum(near["v"] / radius_mm, 1e-6)  # a point at a marker gets its value
    weights = csr_array((distance**-power, (near["i"], near["j"])), shape=(len(point_mm), len(rest_mm)))
    return InverseDistance(x_mm=x_mm, y_mm=y_mm, weights=weights)


def peaks(
    depth_mm: Float64[np.ndarray, "rows columns"], least_mm: float, reach: np.ndarray
) -> tuple[Int64[np.ndarray, " c"], Int64[np.ndarray, " c"]]:
    """Rows and columns of the points deeper than `least_mm` that are the deepest within `reach`.

    The deepest is the first; of equal points within reach only the first one in row order is a peak.
    """
    height = np.where(np.isfinite(depth_mm), depth_mm, -np.inf)
    highest = cv2.dilate(height, reach, borderType=cv2.BORDER_CONSTANT, borderValue=(-np.inf,) * 4)
    row, column = np.nonzero((height == highest) & (height > least_mm))
    order = np.argsort(-height[row, column], kind="stable")
    row, column = row[order], column[order]
    middle = np.array(reach.shape) // 2
    step = np.stack([row[:, None] - row, column[:, None] - column], axis=-1) + middle
    is_inside = ((step >= 0) & (step < reach.shape)).all(axis=-1)
    step = np.where(is_inside[..., None], step, 0)
    is_near = is_inside & (reach[step[..., 0], step[..., 1]] > 0)
    is_kept = np.zeros(len(row), dtype=np.bool_)
    for place in range(len(row)):
        is_kept[place] = not (is_near[place] & is_kept).any()
    return row[is_kept].astype(np.int64), column[is_kept].astype(np.int64)


def disc_footprint(surface: InverseDistance, radius_mm: float) -> np.ndarray:
    """Points of the grid within a radius of the central one, as a footprint of 0 and 1."""
    step_mm = np.array([np.diff(surface.y_mm[:2])[0], np.diff(surface.x_mm[:2])[0]])
    reach = np.maximum(np.floor(radius_mm / step_mm).astype(int), 1)
    row, column = np.mgrid[-reach[0] : reach[0] + 1, -reach[1] : reach[1] + 1]
    inside = (row * step_mm[0]) ** 2 + (column * step_mm[1]) ** 2 <= radius_mm**2
    inside[reach[0], reach[1]] = True
    return np.asarray(inside.astype(np.uint8))
