"""Interpolation of values at the markers to any other point of the sheet.

On a lattice the sampling is the product of cubic splines along x and along y, which go through the
values; between markers that form no lattice it is a moving least-squares plane (P. Lancaster and
K. Salkauskas 1981, doi:10.1090/S0025-5718-1981-0616367-1) with a weight that ends smoothly (H. Wendland
1995, doi:10.1007/BF02123482), which smooths a little. Both are linear in the values, give back constants
and planes exactly, and are computed once per sensor, so that a frame takes one small product.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array
from scipy.spatial import ConvexHull, QhullError, cKDTree

from manytouch.values import Layout
from manytouch.values.arrays import Mask, Points2, Scalars

BEYOND_PITCH = 0.5
"""How far outside the markers a value is still given, in pitches."""

Places = Float64[np.ndarray, "m 2"]
Values = Float64[np.ndarray, " m"]

_EVEN = 1e-6
_NEAREST = 12
_REACH = 1.35


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointSampling:
    """Samples at n points.

    Attributes:
        weight: (n, m) sparse; its rows sum to 1.
        is_inside: (n,) points that are not too far outside the markers.
        nearest: (n,) marker next to each point.
        rest_mm: (m, 2) where the values are known.
    """

    weight: csr_array
    is_inside: Mask
    nearest: np.ndarray
    rest_mm: Places

    def __call__(self, value: Values) -> Scalars:
        """(n,) values from the markers' (m,); NaN outside, and where the nearest marker has none."""
        is_known = np.isfinite(value)[self.nearest] & self.is_inside
        return np.where(is_known, self.weight @ _fill_missing(self.rest_mm, value), np.nan)

    def std(self, std: Values) -> Scalars:
        """(n,) standard deviations of the samples when the markers' (m,) are independent."""
        squared = self.weight.copy()
        squared.data = squared.data**2
        is_known = np.isfinite(std)[self.nearest] & self.is_inside
        return np.where(is_known, np.sqrt(squared @ _fill_missing(self.rest_mm, std**2)), np.nan)


class Spline(NamedTuple):
    """A spline through k values, evaluated at n positions.

    Attributes:
        solve: (k, k) part of each value, first index, in each coefficient.
        first: (n,) first coefficient that counts at each position.
        tap: (n, 4 or fewer) weights of the coefficients from there on.
        whole: (n, k) weights of the values.
    """

    solve: np.ndarray
    first: np.ndarray
    tap: np.ndarray
    whole: np.ndarray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GridSampling:
    """Samples on a grid, in map order (y, x).

    Attributes:
        x_mm, y_mm: (nx,), (ny,) the grid.
        along_x, along_y: splines of a lattice; None for other layouts.
        order: (m,) marker at each place of the lattice, row by row; None for other layouts.
        points: sampling of layouts that are not a lattice, else None.
        is_inside: (ny, nx) points that are not too far outside the markers.
        is_all_inside: whether all of them are.
        nearest: (ny, nx) marker next to each point.
        rest_mm: (m, 2) where the values are known.
    """

    x_mm: Scalars
    y_mm: Float64[np.ndarray, " ny"]
    along_x: Spline | None
    along_y: Spline | None
    order: np.ndarray | None
    points: PointSampling | None
    is_inside: np.ndarray
    is_all_inside: bool
    nearest: np.ndarray
    rest_mm: Places

    def __call__(self, value: Values) -> Float64[np.ndarray, "ny nx"]:
        """(ny, nx) values from the markers' (m,); NaN outside, and where the nearest marker has none."""
        if self.points is not None:
            return np.asarray(self.points(value).reshape(len(self.y_mm), len(self.x_mm)))
        if np.isfinite(value).all():
            whole = self._evaluate(value)
            if not self.is_all_inside:
                whole[~self.is_inside] = np.nan
            return whole
        is_known = np.isfinite(value)[self.nearest] & self.is_inside
        return np.where(is_known, self._evaluate(_fill_missing(self.rest_mm, value)), np.nan)

    def at(
        self, value: Float64[np.ndarray, "v m"], place: Int64[np.ndarray, "k 2"]
    ) -> Float64[np.ndarray, "v k"]:
        """(v, k) values at some points of the grid, the same as there on v whole maps.

        Args:
            value: (v, m) of the markers.
            place: (k, 2) row and column of each point.
        """
        if self.points is None and self.is_all_inside:
            from manytouch.geometry.sampling_kernels import evaluate_at_points

            assert self.along_x is not None
            assert self.along_y is not None
            assert self.order is not None
            found = evaluate_at_points(value, self.order, self.along_y, self.along_x, place)
            if np.isfinite(found).all():  # as every value counts, all are known
                return found
        row, column = place.T
        return np.stack([self(each)[row, column] for each in value])

    def std(self, std: Values) -> Float64[np.ndarray, "ny nx"]:
        """(ny, nx) standard deviations of the samples when the markers' (m,) are independent."""
        if self.points is not None:
            return np.asarray(self.points.std(std).reshape(len(self.y_mm), len(self.x_mm)))
        assert self.along_x is not None
        assert self.along_y is not None
        is_known = np.isfinite(std)[self.nearest] & self.is_inside
        squared = self._lattice(_fill_missing(self.rest_mm, std**2))
        variance = self.along_y.whole**2 @ squared @ (self.along_x.whole**2).T
        return np.where(is_known, np.sqrt(variance), np.nan)

    def _evaluate(self, value: np.ndarray) -> np.ndarray:
        """Values everywhere on the grid, from those of all markers."""
        from manytouch.geometry.sampling_kernels import evaluate_on_grid

        assert self.along_x is not None
        assert self.along_y is not None
        assert self.order is not None
        return evaluate_on_grid(np.ascontiguousarray(value), self.order, self.along_y, self.along_x)

    def _lattice(self, value: np.ndarray) -> np.ndarray:
        """(rows, columns) values of the markers."""
        assert self.along_x is not None
        assert self.along_y is not None
        assert self.order is not None
        return np.asarray(value[self.order].reshape(len(self.along_y.solve), len(self.along_x.solve)))


def sampling_at(layout: Layout, point_mm: Points2) -> PointSampling:
    """Samples at any points (n, 2) of the undeformed sheet."""
    rest_mm = layout.rest_mm[:, :2]
    lattice = _lattice(layout)
    if lattice is not None:
        x_mm, y_mm, order = lattice
        along_x, along_y = _spline(x_mm, point_mm[:, 0]).whole, _spline(y_mm, point_mm[:, 1]).whole
        weight = np.zeros((len(point_mm), len(rest_mm)))
        weight[:, order] = (along_y[:, :, None] * along_x[:, None, :]).reshape(len(point_mm), len(order))
        is_inside = _is_within(layout, x_mm, point_mm[:, 0], 0) & _is_within(layout, y_mm, point_mm[:, 1], 1)
        return PointSampling(
            weight=csr_array(weight),
            is_inside=is_inside,
            nearest=_nearest_marker(rest_mm, point_mm),
            rest_mm=rest_mm,
        )
    pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
    return PointSampling(
        weight=_moving_least_squares(rest_mm, point_mm, pitch_mm),
        is_inside=_is_near_hull(rest_mm, point_mm, pitch_mm),
        nearest=_nearest_marker(rest_mm, point_mm),
        rest_mm=rest_mm,
    )


def sampling_on(layout: Layout, x_mm: Scalars, y_mm: Float64[np.ndarray, " ny"]) -> GridSampling:
    """Samples on the grid of columns x_mm (nx,) and rows y_mm (ny,)."""
    rest_mm = layout.rest_mm[:, :2]
    lattice = _lattice(layout)
    point_mm = np.stack(np.meshgrid(x_mm, y_mm), axis=-1).reshape(-1, 2)
    nearest = _nearest_marker(rest_mm, point_mm).reshape(len(y_mm), len(x_mm))
    if lattice is None:
        points = sampling_at(layout, point_mm)
        is_inside = points.is_inside.reshape(len(y_mm), len(x_mm))
        return GridSampling(
            x_mm=x_mm,
            y_mm=y_mm,
            along_x=None,
            along_y=None,
            order=None,
            points=points,
            is_inside=is_inside,
            is_all_inside=bool(is_inside.all()),
            nearest=nearest,
            rest_mm=rest_mm,
        )
    column_mm, row_mm, order = lattice
    is_inside = _is_within(layout, row_mm, y_mm, 1)[:, None] & _is_within(layout, column_mm, x_mm, 0)
    return GridSampling(
        x_mm=x_mm,
        y_mm=y_mm,
        along_x=_spline(column_mm, x_mm),
        along_y=_spline(row_mm, y_mm),
        order=order,
        points=None,
        is_inside=is_inside,
        is_all_inside=bool(is_inside.all()),
        nearest=nearest,
        rest_mm=rest_mm,
    )


def _lattice(layout: Layout) -> tuple[Scalars, Float64[np.ndarray, " rows"], np.ndarray] | None:
    """x of the columns, y of the rows, markers in reading order; None unless they lie on straight lines."""
    shape = layout.shape
    if shape is None or layout.row_column is None or min(shape) < 2:
        return None
    row, column = layout.row_column.T
    order = np.lexsort((column, row))
    place = layout.rest_mm[order, :2].reshape(*shape, 2)
    x_mm, y_mm = place[..., 0].mean(axis=0), place[..., 1].mean(axis=1)
    bent = max(np.abs(place[..., 0] - x_mm).max(), np.abs(place[..., 1] - y_mm[:, None]).max())
    straight = bent <= _EVEN * float(layout.pitch_mm.min())
    rising = bool((np.diff(x_mm) > 0).all() and (np.diff(y_mm) > 0).all())
    return (x_mm, y_mm, order) if straight and rising else None


def _spline(knot: np.ndarray, at: np.ndarray) -> Spline:
    """Cubic spline through values at the knots; beyond them it continues along its tangent."""
    from scipy.interpolate import BSpline, make_interp_spline

    through = make_interp_spline(knot, np.eye(len(knot)), k=min(3, len(knot) - 1))
    degree, solve = through.k, np.ascontiguousarray(through.c.T)
    held = np.clip(at, knot[0], knot[-1])
    basis = BSpline(through.t, np.eye(len(knot)), degree)
    tap = np.asarray(basis(held) + (at - held)[:, None] * basis.derivative()(held))
    first = np.clip(np.searchsorted(through.t, held, side="right") - 1, degree, len(knot) - 1) - degree
    return Spline(
        solve=solve,
        first=first,
        tap=np.take_along_axis(tap, first[:, None] + np.arange(degree + 1), axis=1),
        whole=tap @ through.c,
    )


def _is_within(layout: Layout, knot: np.ndarray, at: np.ndarray, axis: int) -> np.ndarray:
    margin = (BEYOND_PITCH + 1e-9) * float(layout.pitch_mm[axis])
    return np.asarray((at >= knot[0] - margin) & (at <= knot[-1] + margin))


def _moving_least_squares(rest_mm: Places, point_mm: Points2, pitch_mm: float) -> csr_array:
    """Rows of weights: the value at each point of the plane fitted to the markers around it."""
    count = min(_NEAREST, len(rest_mm))
    distance, index = cKDTree(rest_mm).query(point_mm, k=np.arange(1, count + 1))
    # One beyond the last that counts, so that nothing jumps when markers change their order.
    reach = np.maximum(distance[:, -1:] * (1.0 if count == _NEAREST else _REACH), 1e-9)
    ratio = np.minimum(distance / reach, 1.0)
    weight = (1.0 - ratio) ** 4 * (4.0 * ratio + 1.0)
    offset = (rest_mm[index] - point_mm[:, None]) / pitch_mm
    design = np.concatenate([np.ones((*offset.shape[:2], 1)), offset], axis=2)
    normal = np.einsum("nk,nki,nkj->nij", weight, design, design)
    # Markers on a line or a single one: the least tilted plane.
    solved = np.linalg.pinv(normal, rcond=1e-9, hermitian=True)[:, 0]
    row = weight * np.einsum("ni,nki->nk", solved, design)
    row /= row.sum(axis=1, keepdims=True)
    start = np.arange(0, count * len(point_mm) + 1, count)
    return csr_array((row.ravel(), index.ravel(), start), shape=(len(point_mm), len(rest_mm)))


def _is_near_hull(rest_mm: Places, point_mm: Points2, pitch_mm: float) -> Mask:
    """Points within the hull of the markers or half a pitch outside, and not in a hole of the layout."""
    margin = (BEYOND_PITCH + 1e-9) * pitch_mm
    distance, _ = cKDTree(rest_mm).query(point_mm)
    spacing, _ = cKDTree(rest_mm).query(rest_mm, k=min(2, len(rest_mm)))
    near = np.asarray(distance <= max(1.5 * pitch_mm, float(np.max(spacing)), margin))
    try:
        facet = ConvexHull(rest_mm).equations
    except (QhullError, ValueError):
        return np.asarray(distance <= max(margin, float(np.max(spacing)) / 2))
    return np.asarray(near & (point_mm @ facet[:, :2].T + facet[:, 2] <= margin).all(axis=1))


def _fill_missing(rest_mm: Places, value: Values) -> Values:
    """Values, the missing ones taken from the nearest marker that has one; 0 where none has."""
    is_known = np.isfinite(value)
    if is_known.all():
        return value
    if not is_known.any():
        return np.zeros_like(value)
    _, nearest = cKDTree(rest_mm[is_known]).query(rest_mm)
    return np.asarray(value[is_known][nearest])


def _nearest_marker(rest_mm: Places, point_mm: Points2) -> np.ndarray:
    return np.asarray(cKDTree(rest_mm).query(point_mm)[1])
