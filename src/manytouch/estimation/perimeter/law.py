"""The paper's depth for any layout, with its derivatives: equations 11 to 13 of Senarath et al.

m = d (1 - a/b), a and b the perimeters of a cell of neighbouring markers at rest and now, d the distance
of the camera from the sheet. Markers are projected along their rays onto the plane of the sheet at rest,
which removes tilt and scale of the camera. The depth of a sheet that comes nearer by z as a whole is exactly
z.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from manytouch.estimation.perimeter.law_inputs import CellLists, Rays
from manytouch.geometry.neighbours import Cells
from manytouch.values.arrays import Covariances2, Covariances3, Points2, Points3, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PerimeterLaw:
    """Depth of markers from the perimeters of the cells around them.

    Attributes:
        cells: of the layout.
        rest_mm: (m, 2) where the markers' rays meet the plane of the sheet at rest.
        axis_mm: (2,) foot of the camera in that plane.
        distance_mm: d of equation 11.
        rest_perimeter_mm: (c,) a of equation 11.
        cell_first: (m + 1,) where the cells at each marker begin in `cell`.
        cell: (k,) these cells.
        first: (m + 1,) where the corners of the cells at each marker begin in `pair_corner`.
        pair_corner: (q,) these corners, the marker itself among them.
        entry_first: (q + 1,) where the cells of each pair of marker and corner begin in `entry`.
        entry: (p,) the corner's place in these cells: four times the cell, and which of its corners.
    """

    cells: Cells
    rest_mm: Points2
    axis_mm: Float64[np.ndarray, "2"]
    distance_mm: float
    rest_perimeter_mm: Float64[np.ndarray, " c"]
    cell_first: Int32[np.ndarray, " m1"]
    cell: Int32[np.ndarray, " k"]
    first: Int32[np.ndarray, " m1"]
    pair_corner: Int32[np.ndarray, " q"]
    entry_first: Int32[np.ndarray, " q1"]
    entry: Int32[np.ndarray, " p"]

    @property
    def lists(self) -> CellLists:
        """The cells as the kernels take them."""
        return CellLists(
            self.cells.corner,
            self.rest_perimeter_mm,
            self.cell_first,
            self.cell,
            self.first,
            self.pair_corner,
            self.entry_first,
            self.entry,
        )

    @property
    def rays(self) -> Rays:
        """The rays at rest as the kernels take them."""
        return Rays(self.rest_mm, self.axis_mm, self.distance_mm)

    def __call__(self, plane_mm: Points2, covariance_mm2: Covariances2) -> tuple[Points3, Covariances3]:
        """Displacements (m, 3) of the markers, and their covariances.

        Args:
            plane_mm: (m, 2) where the markers' rays meet the plane of the sheet at rest.
            covariance_mm2: (m, 2, 2) of these.

        A marker at depth m is at the point of its ray that is m nearer to the camera; its covariance is the
        propagated one, with all correlations between a marker's own place and the perimeters around it.
        """
        from manytouch.estimation.perimeter.law_kernels import law_displacements

        displacement, covariance = law_displacements(plane_mm, self.rays, self.lists, covariance_mm2)
        return displacement, covariance


def perimeter_law(
    cells: Cells, rest_mm: Points2, axis_mm: Float64[np.ndarray, "2"], distance_mm: float
) -> PerimeterLaw:
    """The law for cells of markers that rest at (m, 2) in a plane at this distance from the camera."""
    count = len(rest_mm)
    rest_perimeter_mm, _ = perimeters(rest_mm[cells.corner])
    entry = (4 * cells.cell[:, None] + np.arange(4)).ravel()
    # A triangle repeats its last corner; the derivative belongs to the first of the two.
    key = np.repeat(cells.marker, 4) * count + cells.corner.ravel()[entry]
    order = np.argsort(key, kind="stable")
    number, entry_first = np.unique(key[order], return_index=True)
    return PerimeterLaw(
        cells=cells,
        rest_mm=read_only(rest_mm),
        axis_mm=read_only(axis_mm),
        distance_mm=distance_mm,
        rest_perimeter_mm=read_only(rest_perimeter_mm),
        cell_first=_int32(np.searchsorted(cells.marker, np.arange(count + 1))),
        cell=_int32(cells.cell),
        first=_int32(np.searchsorted(number, np.arange(count + 1) * count)),
        pair_corner=_int32(number % count),
        entry_first=_int32(np.append(entry_first, len(key))),
        entry=_int32(entry[order]),
    )


def _int32(number: np.ndarray) -> np.ndarray:
    """In half of the memory, because these lists are read in each frame."""
    return read_only(number.astype(np.int32))


def perimeters(
    corner: Float64[np.ndarray, "c 4 2"],
) -> tuple[Float64[np.ndarray, " c"], Float64[np.ndarray, "c 4 2"]]:
    """Perimeters of polygons and their derivatives with respect to the corners."""
    edge = np.roll(corner, -1, axis=1) - corner
    length = np.sqrt((edge**2).sum(axis=-1))
    unit = edge / np.where(length > 0.0, length, 1.0)[..., None]
    perimeter = length.sum(axis=1)
    return np.where(perimeter > 0.0, perimeter, np.nan), np.roll(unit, 1, axis=1) - unit
