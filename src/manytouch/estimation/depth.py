"""The paper's depth for any layout, with its derivatives: equations 11 to 13 of Senarath et al.

m = d (1 - a/b), a and b the perimeters of a cell of neighbouring markers at rest and now, d the distance
of the camera from the sheet. Markers are taken where their rays meet the sheet's plane at rest, which is the
image but for the camera's tilt and scale. So a sheet that comes nearer by z as a whole reads exactly z.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.neighbours import Cells
from manytouch.values.arrays import Covariances2, Covariances3, Points2, Points3, read_only


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
        from manytouch.estimation.law_kernels import along_rays, cell_depths, depth_noise, marker_depths

        cells = self.cells
        cell_mm, slope = cell_depths(plane_mm, cells.corner, self.rest_perimeter_mm, self.distance_mm)
        depth_mm = marker_depths(cells.marker, cells.cell, cells.share, cell_mm, len(plane_mm))
        variance, mixed = depth_noise(
            slope,
            self.pair,
            self.pair_share,
            self.pair_cell,
            self.pair_place,
            self.pair_marker,
            self.pair_corner,
            self.own,
            covariance_mm2,
        )
        displacement, covariance = along_rays(
            plane_mm,
            self.rest_mm,
            self.eye_mm,
            self.distance_mm,
            depth_mm,
            covariance_mm2,
            variance,
            mixed,
        )
        return displacement, covariance, cell_mm


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
