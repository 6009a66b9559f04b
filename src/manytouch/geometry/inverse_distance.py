"""The surface of the paper: inverse distance weighting on a plane of points, linear between these.

D. Shepard 1968, doi:10.1145/800186.810616; Figure 11 and Table 2 of the paper. The plane covers the bounding
box of the markers with the same number of points along both sides; beyond it the surface is not known.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from manytouch.values import Layout
from manytouch.values.arrays import Points2, Scalars
from manytouch.values.surface import Interpolation

ON_POINT = 1e-9  # of a step: closer places are the point itself
AT_MARKER = 1e-6  # of the search radius: a point at a marker gets its value


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InverseDistancePlane:
    """Inverse distance weighting from markers to a plane of points.

    Attributes:
        x_mm, y_mm: (n,) coordinates of columns and rows of the plane.
        weights: (n * n, m) distance to the negative power; 0 beyond the search radius.
    """

    x_mm: Scalars
    y_mm: Scalars
    weights: csr_array

    def __call__(self, value: Float64[np.ndarray, " m"]) -> Float64[np.ndarray, "n n"]:
        """(row, column) surface through the known values; NaN where there is none within the radius."""
        is_known = np.isfinite(value)
        total = self.weights @ is_known.astype(np.float64)
        share = self.weights @ np.where(is_known, value, 0.0)
        plane = share / np.where(total > 0.0, total, np.nan)
        return np.asarray(plane.reshape(len(self.y_mm), len(self.x_mm)))


def inverse_distance_plane(
    rest_mm: Points2, iterations: int, radius_mm: float, power: float
) -> InverseDistancePlane:
    """Weights from markers (m, 2) to a plane of iterations x iterations points over their bounding box."""
    low, high = rest_mm.min(axis=0), rest_mm.max(axis=0)
    x_mm = np.linspace(low[0], high[0], iterations)
    y_mm = np.linspace(low[1], high[1], iterations)
    point_mm = np.stack(np.meshgrid(x_mm, y_mm), axis=-1).reshape(-1, 2)
    near = cKDTree(point_mm).sparse_distance_matrix(cKDTree(rest_mm), radius_mm, output_type="ndarray")
    distance = np.maximum(near["v"] / radius_mm, AT_MARKER)
    weights = csr_array((distance**-power, (near["i"], near["j"])), shape=(len(point_mm), len(rest_mm)))
    return InverseDistancePlane(x_mm=x_mm, y_mm=y_mm, weights=weights)


@lru_cache(maxsize=8)
def plane_of(layout: Layout, interpolation: Interpolation) -> InverseDistancePlane:
    """The plane of a layout; all samplings of the layout share its weights."""
    pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
    return inverse_distance_plane(
        layout.rest_mm[:, :2],
        interpolation.iterations,
        interpolation.search_radius_pitch * pitch_mm,
        interpolation.power,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InverseDistanceSampling:
    """Samples of the plane at k points, linear between its points.

    Attributes:
        plane: of the layout.
        corner: (k, 4) points of the plane around each point.
        share: (k, 4) their shares, which sum to 1.
        is_inside: points within the plane, in the shape of the results.
    """

    plane: InverseDistancePlane
    corner: Int64[np.ndarray, "k 4"]
    share: Float64[np.ndarray, "k 4"]
    is_inside: Bool[np.ndarray, "*shape"]

    def __call__(self, value: Float64[np.ndarray, " m"]) -> np.ndarray:
        """Values at the points from the markers' (m,); NaN beyond the plane and where none is in reach."""
        at_corner = np.where(self.share > 0.0, self.plane(value).ravel()[self.corner], 0.0)
        found = (self.share * at_corner).sum(axis=1).reshape(self.is_inside.shape)
        return np.where(self.is_inside, found, np.nan)


def inverse_distance_at(
    layout: Layout, interpolation: Interpolation, point_mm: Points2, shape: tuple[int, ...]
) -> InverseDistanceSampling:
    """Samples at points (k, 2) of the undeformed sheet; results get a shape of k elements."""
    plane = plane_of(layout, interpolation)
    column, right, is_across = _place(plane.x_mm, point_mm[:, 0])
    row, down, is_along = _place(plane.y_mm, point_mm[:, 1])
    first = row * len(plane.x_mm) + column
    steps = np.array([0, 1, len(plane.x_mm), len(plane.x_mm) + 1])
    share = [(1.0 - down) * (1.0 - right), (1.0 - down) * right, down * (1.0 - right), down * right]
    return InverseDistanceSampling(
        plane=plane,
        corner=first[:, None] + steps,
        share=np.stack(share, axis=1),
        is_inside=(is_across & is_along).reshape(shape),
    )


def _place(axis_mm: Scalars, at_mm: Float64[np.ndarray, " k"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Interval of an even axis in which each coordinate lies, place 0..1 in it, and whether it is inside."""
    length = float(axis_mm[-1] - axis_mm[0])
    place = (at_mm - axis_mm[0]) / length * (len(axis_mm) - 1) if length > 0.0 else np.zeros(len(at_mm))
    whole = np.rint(place)
    place = np.where(np.abs(place - whole) < ON_POINT, whole, place)
    inside = (place >= 0) & (place <= len(axis_mm) - 1)
    index = np.clip(np.floor(place), 0, len(axis_mm) - 2).astype(np.int64)
    return index, np.clip(place - index, 0.0, 1.0), inside
