"""Neighbouring markers: the cells between them, and the nearest others of each."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import Delaunay, QhullError, cKDTree

from manytouch.values.arrays import Points2, read_only

_SLIVER = 0.2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cells:
    """Polygons whose corners are markers.

    Attributes:
        corner: (c, 4) markers in order around each cell; a triangle repeats its last corner.
        marker, cell: (k,) pairs of a marker and a cell that has it as a corner, sorted by marker.
        share: (k,) one over the number of cells at the marker, so that sums over pairs are means.
    """

    corner: Int64[np.ndarray, "c 4"]
    marker: Int64[np.ndarray, " k"]
    cell: Int64[np.ndarray, " k"]
    share: Float64[np.ndarray, " k"]

    def to_markers(self, value: Float64[np.ndarray, " c"], count: int) -> Float64[np.ndarray, " m"]:
        """Mean (count,) of the cells at each marker; NaN where there are none."""
        mean = np.bincount(self.marker, self.share * value[self.cell], minlength=count)
        is_isolated = np.ones(count, dtype=np.bool_)
        is_isolated[self.marker] = False
        mean[is_isolated] = np.nan
        return mean


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Neighbours:
    """The nearest others of each marker.

    Attributes:
        index: (m, k), the nearest first.
        distance: (m, k) in the unit of the points.
    """

    index: Int64[np.ndarray, "m k"]
    distance: Float64[np.ndarray, "m k"]


def lattice_cells(row_column: Int64[np.ndarray, "m 2"]) -> Cells:
    """The quadrilaterals of four neighbouring markers of a rectangle, corners in order around each."""
    rows, columns = (int(n) for n in row_column.max(axis=0) + 1)
    number = np.empty((rows, columns), dtype=np.int64)
    number[row_column[:, 0], row_column[:, 1]] = np.arange(len(row_column))
    corner = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    return _cells(corner.reshape(-1, 4))


def triangle_cells(point: Points2) -> Cells:
    """Delaunay triangles of any points without slivers; none when all are on a line."""
    none = np.zeros((0, 4), dtype=np.int64)
    if len(point) < 3:
        return _cells(none)
    try:
        corner = Delaunay(point).simplices.astype(np.int64)
    except QhullError:
        return _cells(none)
    a, b, c = (point[corner[:, k]] for k in range(3))
    twice_area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    longest = np.maximum.reduce([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))])
    corner = corner[twice_area > _SLIVER * longest]
    return _cells(corner[:, [0, 1, 2, 2]])


def nearest_neighbours(point: Points2, count: int = 8) -> Neighbours:
    """The `count` nearest others of each point (fewer where there are fewer points)."""
    among = min(count + 1, len(point))
    distance, index = cKDTree(point).query(point, k=np.arange(2, among + 1))
    return Neighbours(
        index=read_only(index.astype(np.int64)), distance=read_only(distance.astype(np.float64))
    )


def _cells(corner: np.ndarray) -> Cells:
    cell = np.repeat(np.arange(len(corner)), 4)
    marker = corner.ravel()
    is_first = np.ones(corner.shape, dtype=np.bool_)
    is_first[:, 3] = corner[:, 3] != corner[:, 2]
    marker, cell = marker[is_first.ravel()], cell[is_first.ravel()]
    order = np.argsort(marker, kind="stable")
    marker, cell = marker[order], cell[order]
    count = np.bincount(marker) if len(marker) else np.zeros(0)
    return Cells(
        corner=read_only(corner.astype(np.int64)),
        marker=read_only(marker.astype(np.int64)),
        cell=read_only(cell.astype(np.int64)),
        share=read_only(1.0 / count[marker] if len(marker) else np.zeros(0)),
    )
