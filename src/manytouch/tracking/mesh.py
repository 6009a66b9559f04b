"""Which markers are neighbours: the part of tracking that only the layout decides."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from manytouch.values.arrays import Mask, Points2, read_only

_NEAR = 20
_NEAR_REACH = 2.4
_ADJACENT_REACH = 1.6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Mesh:
    """Neighbourhoods of the markers that are present, in flat arrays.

    Attributes:
        rest_px: (m, 2) reference centres.
        is_present: (m,) markers that are not known to be missing.
        spacing_px: (m,) distance to the nearest neighbour, smoothed over neighbours.
        usual_px: its median.
        start: (m + 1,) where each marker's neighbours begin in `near`.
        adjacent_end: (m,) where those of its inner ring end in `near`.
        near: (k,) neighbours of all markers, of each the nearest first.
        triangle: (t, 3) Delaunay triangles at rest, all of one orientation, slivers left out.
    """

    rest_px: Points2
    is_present: Mask
    spacing_px: np.ndarray
    usual_px: float
    start: np.ndarray
    adjacent_end: np.ndarray
    near: np.ndarray
    triangle: np.ndarray

    @property
    def net(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """What the kernels take: is_present, spacing_px, start, adjacent_end, near."""
        return self.is_present, self.spacing_px, self.start, self.adjacent_end, self.near


def mesh_of(rest_px: Points2, is_missing: Mask) -> Mesh:
    """Neighbourhoods of any layout, rectangle or table, from its reference centres in the image."""
    present = np.flatnonzero(~is_missing)
    points = rest_px[present]
    spacing = np.full(len(rest_px), np.inf)
    near_of: list[np.ndarray] = [np.zeros(0, dtype=np.int64)] * len(rest_px)
    adjacent = np.zeros(len(rest_px), dtype=np.int64)
    if len(present) > 1:
        count = min(_NEAR + 1, len(present))
        distance, index = cKDTree(points).query(points, k=count)
        distance, index = distance[:, 1:], index[:, 1:]
        spacing[present] = np.median(distance[index[:, :4], 0], axis=1)
        # The mean of the four nearest is between the two pitches of a lattice that is not square.
        reach = np.median(distance[:, : min(4, count - 1)].mean(axis=1)[index[:, :4]], axis=1)
        for k, marker in enumerate(present):
            within = distance[k] <= _NEAR_REACH * reach[k]
            near_of[marker] = present[index[k][within]]
            adjacent[marker] = int((distance[k] <= _ADJACENT_REACH * reach[k]).sum())
    finite = spacing[np.isfinite(spacing)]
    usual_px = float(np.median(finite)) if len(finite) else 100.0
    spacing[~np.isfinite(spacing)] = usual_px
    start = np.concatenate([[0], np.cumsum([len(each) for each in near_of])]).astype(np.int64)
    return Mesh(
        rest_px=read_only(np.ascontiguousarray(rest_px, dtype=np.float64).copy()),
        is_present=read_only(~is_missing),
        spacing_px=read_only(spacing),
        usual_px=usual_px,
        start=read_only(start),
        adjacent_end=read_only(start[:-1] + adjacent),
        near=read_only(np.concatenate([*near_of, np.zeros(0, dtype=np.int64)]).astype(np.int64)),
        triangle=read_only(_triangles(points, present)),
    )


def _triangles(points: Points2, present: np.ndarray) -> np.ndarray:
    if len(points) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    try:
        corner = Delaunay(points).simplices
    except QhullError:  # all dots on one line: nothing can fold
        return np.zeros((0, 3), dtype=np.int64)
    edge_a = points[corner[:, 1]] - points[corner[:, 0]]
    edge_b = points[corner[:, 2]] - points[corner[:, 0]]
    twice_area = edge_a[:, 0] * edge_b[:, 1] - edge_a[:, 1] * edge_b[:, 0]
    corner = np.where((twice_area > 0)[:, None], corner, corner[:, [0, 2, 1]])
    edges = points[corner] - points[np.roll(corner, 1, axis=1)]
    longest = np.linalg.norm(edges, axis=-1).max(axis=1)
    return np.asarray(present[corner[np.abs(twice_area) > 0.25 * longest**2]], dtype=np.int64)
