"""The paper's depth for any layout, with its derivatives: equations 11 to 13 of Senarath et al.

m = d (1 - a/b), a and b the perimeters of a cell of neighbouring markers at rest and now, d the distance
of the camera from the sheet. Markers are taken where their rays meet the sheet's plane at rest, which is the
image but for the camera's tilt and scale. So a sheet that comes nearer by z as a whole reads exactly z.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.neighbours import Cells
from manytouch.values.arrays import Covariances2, Covariances3, Points2, Points3, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PerimeterLaw:
    """Depth of markers from the perimeters of the cells around them.

    Attributes:
        cells: of the layout.
        rest_mm: (m, 2) where the markers' rays meet the plane of the sheet at rest.
        eye_mm: (2,) foot of the camera in that plane.
        distance_mm: d of equation 11.
        rest_perimeter_mm: (c,) a of equation 11.
        pair: (p,) for each marker, cell at it and corner of the cell the number of (marker, corner).
        pair_marker, pair_corner: (q,) the markers of each number.
        pair_share: (p,) weight of the cell in the marker's depth.
        pair_cell, pair_place: (p,) cell, and which of its corners.
        own: (m,) number of (marker, marker), or -1 where a marker is in no cell.
    """

    cells: Cells
    rest_mm: Points2
    eye_mm: Float64[np.ndarray, "2"]
    distance_mm: float
    rest_perimeter_mm: Float64[np.ndarray, " c"]
    pair: Int64[np.ndarray, " p"]
    pair_marker: Int64[np.ndarray, " q"]
    pair_corner: Int64[np.ndarray, " q"]
    pair_share: Float64[np.ndarray, " p"]
    pair_cell: Int64[np.ndarray, " p"]
    pair_place: Int64[np.ndarray, " p"]
    own: Int64[np.ndarray, " m"]

    def cell_depth(self, plane_mm: Points2) -> tuple[Float64[np.ndarray, " c"], Float64[np.ndarray, "c 4 2"]]:
        """Depth of each cell, and its derivative with respect to its corners in the plane."""
        perimeter_mm, along = perimeters(plane_mm[self.cells.corner])
        ratio = self.rest_perimeter_mm / perimeter_mm
        depth_mm = self.distance_mm * (1.0 - ratio)
        return depth_mm, (self.distance_mm * ratio / perimeter_mm)[:, None, None] * along

    def __call__(
        self, plane_mm: Points2, covariance_mm2: Covariances2
    ) -> tuple[Points3, Covariances3, Float64[np.ndarray, " c"]]:
        """Displacements (m, 3) of the markers, their covariances, and the depths of the cells.

        Args:
            plane_mm: (m, 2) where the markers' rays meet the plane of the sheet at rest.
            covariance_mm2: (m, 2, 2) of these.

        A marker at depth m is at the point of its ray that is m nearer to the camera; its covariance is the
        propagated one, with all correlations between a marker's own place and the perimeters around it.
        """
        count = len(plane_mm)
        cell_mm, slope = self.cell_depth(plane_mm)
        depth_mm = self.cells.to_markers(cell_mm, count)
        shrink = 1.0 - depth_mm / self.distance_mm
        arm = plane_mm - self.eye_mm
        displacement = np.column_stack([self.eye_mm + shrink[:, None] * arm - self.rest_mm, -depth_mm])
        jacobian = self._marker_slopes(slope)
        return displacement, self._covariance(jacobian, covariance_mm2, shrink, arm), cell_mm

    def _marker_slopes(self, slope: Float64[np.ndarray, "c 4 2"]) -> Float64[np.ndarray, "q 2"]:
        """Derivative of each marker's depth with respect to each marker around it."""
        part = self.pair_share[:, None] * slope[self.pair_cell, self.pair_place]
        size = len(self.pair_marker)
        return np.column_stack([np.bincount(self.pair, part[:, k], minlength=size) for k in range(2)])

    def _covariance(
        self, jacobian: np.ndarray, covariance_mm2: Covariances2, shrink: Scalars, arm: Points2
    ) -> Covariances3:
        count = len(shrink)
        pushed = np.einsum("qab,qb->qa", covariance_mm2[self.pair_corner], jacobian)
        variance = np.bincount(self.pair_marker, (jacobian * pushed).sum(axis=1), minlength=count)
        variance = np.where(self.own >= 0, variance, np.nan)
        own = np.where((self.own >= 0)[:, None], pushed[self.own] if len(pushed) else np.nan, np.nan)
        reach = arm / self.distance_mm
        mixed = shrink[:, None, None] * own[:, :, None] * reach[:, None, :]
        covariance = np.empty((count, 3, 3))
        covariance[:, :2, :2] = (
            shrink[:, None, None] ** 2 * covariance_mm2
            - mixed
            - mixed.transpose(0, 2, 1)
            + variance[:, None, None] * reach[:, :, None] * reach[:, None, :]
        )
        covariance[:, :2, 2] = -(shrink[:, None] * own - variance[:, None] * reach)
        covariance[:, 2, :2] = covariance[:, :2, 2]
        covariance[:, 2, 2] = variance
        return covariance


def perimeter_law(
    cells: Cells, rest_mm: Points2, eye_mm: Float64[np.ndarray, "2"], distance_mm: float
) -> PerimeterLaw:
    """The law for cells of markers that rest at (m, 2) in a plane at this distance from the camera."""
    count = len(rest_mm)
    rest_perimeter_mm, _ = perimeters(rest_mm[cells.corner])
    pair_cell = np.repeat(cells.cell, 4)
    pair_place = np.tile(np.arange(4), len(cells.cell))
    pair_share = np.repeat(cells.share, 4)
    # A triangle repeats its last corner; the derivative belongs to the first of the two.
    corner = cells.corner[pair_cell, pair_place]
    key = np.repeat(cells.marker, 4) * count + corner
    number, pair = np.unique(key, return_inverse=True)
    own = np.full(count, -1, dtype=np.int64)
    pair_marker, pair_corner = number // count, number % count
    is_own = pair_marker == pair_corner
    own[pair_marker[is_own]] = np.flatnonzero(is_own)
    return PerimeterLaw(
        cells=cells,
        rest_mm=read_only(rest_mm),
        eye_mm=read_only(eye_mm),
        distance_mm=distance_mm,
        rest_perimeter_mm=read_only(rest_perimeter_mm),
        pair=read_only(pair.astype(np.int64)),
        pair_marker=read_only(pair_marker.astype(np.int64)),
        pair_corner=read_only(pair_corner.astype(np.int64)),
        pair_share=read_only(pair_share),
        pair_cell=read_only(pair_cell.astype(np.int64)),
        pair_place=read_only(pair_place.astype(np.int64)),
        own=read_only(own),
    )


def perimeters(
    corner: Float64[np.ndarray, "c 4 2"],
) -> tuple[Float64[np.ndarray, " c"], Float64[np.ndarray, "c 4 2"]]:
    """Perimeters of polygons and their derivatives with respect to the corners."""
    edge = np.roll(corner, -1, axis=1) - corner
    length = np.sqrt((edge**2).sum(axis=-1))
    unit = edge / np.where(length > 0.0, length, 1.0)[..., None]
    perimeter = length.sum(axis=1)
    return np.where(perimeter > 0.0, perimeter, np.nan), np.roll(unit, 1, axis=1) - unit
