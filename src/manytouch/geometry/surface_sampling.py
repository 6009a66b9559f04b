"""Depth, strain and pressure of a surface at any point of the sheet, with standard deviations.

Every map, profile and export of a surface is evaluated here, so that a number and a picture of the same point
agree. The interpolation is a field of the surface (`Interpolation`). By "spline", a surface with a spline is
the spline; the difference of its markers from the spline is interpolated between them, as other surfaces are
(`geometry.sampling`). By "idw", every surface is interpolated between its markers
(`geometry.inverse_distance`), and is not known outside of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float64

from manytouch.errors import ArgumentError, SensorError, require_type
from manytouch.geometry.inverse_distance import InverseDistanceSampling, inverse_distance_at
from manytouch.geometry.sampling import BEYOND_PITCH, GridSampling, PointSampling, sampling_at, sampling_on
from manytouch.geometry.sheet_face import SheetFace, SplineShape, sheet_face, spline_shape
from manytouch.values import Layout, SheetSpline, Surface
from manytouch.values.arrays import Points2, Scalars
from manytouch.values.surface import SPLINE, Interpolation

GAUGE_PITCH = 0.5
"""Length over which strain is measured, in pitches."""

STRAIN_SHARE = 0.5
"""Standard deviation of the model's strain, as a share of the largest strain within a thickness: the face of
a solid is dented more sharply than that of a shell."""

KPA_PER_MPA = 1000.0

Field = Float64[np.ndarray, "*shape"]
"""One number per point, in the shape of the points: (n,), or (ny, nx) on a grid."""

Sampling = PointSampling | GridSampling | InverseDistanceSampling

Interpolate = Callable[[Interpolation, float, float], tuple[Sampling, Points2]]
"""Interpolation between markers at points that are moved by dx, dy (mm); and these points (k, 2)."""

PREPARED = 16
"""Sets of points that a sampler keeps: each interpolation has one, and four more for strain."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SurfaceSample:
    """A surface at n points. NaN outside the sheet, and where a value is not known.

    Lengths are in the unit of the surface.

    Attributes:
        depth_mm: displacement of the camera-side face along -z; positive when pressed.
        depth_std_mm: its standard deviation.
        displacement_mm: of the camera-side face, in the sheet frame.
        strain: largest principal Green-Lagrange strain of the camera-side face.
        strain_std: its standard deviation; NaN without a posterior.
        pressure_kPa: normal force per area, positive in compression.
        pressure_std_kPa: its standard deviation; NaN without a posterior.
    """

    depth_mm: Float64[np.ndarray, " n"]
    depth_std_mm: Float64[np.ndarray, " n"]
    displacement_mm: Float64[np.ndarray, "n 3"]
    strain: Float64[np.ndarray, " n"]
    strain_std: Float64[np.ndarray, " n"]
    pressure_kPa: Float64[np.ndarray, " n"]
    pressure_std_kPa: Float64[np.ndarray, " n"]


def sample(
    surface: Surface,
    x_mm: Float[np.ndarray, " n"],
    y_mm: Float[np.ndarray, " n"],
    *,
    posterior: Sequence[SheetSpline] = (),
) -> SurfaceSample:
    """Depth, strain and pressure of a surface at n points, with standard deviations.

    Args:
        surface: of a reading or of a ground truth.
        x_mm, y_mm: (n,) the points on the undeformed sheet, sheet frame, in the unit of the surface.
        posterior: splines drawn from the posterior of the surface, from which the standard deviations of
            strain and pressure are computed. `PosteriorSamples` in
            `manytouch.estimation.mechanics.posterior_samples` draws them, which takes as long as a frame.

    Raises:
        SensorError: the surface has no layout.
        ArgumentError: the points are not n finite numbers each.
    """
    require_type("the surface", surface, Surface, "the surface of a reading: reading.surface")
    if surface.layout is None:
        raise SensorError(
            "a surface without a layout cannot be sampled; take it from a reading, or set its layout with "
            "dataclasses.replace(surface, layout=sensor.layout)"
        )
    try:
        x, y = (np.atleast_1d(np.asarray(each, np.float64)) for each in (x_mm, y_mm))
    except (TypeError, ValueError):
        kinds = f"{type(x_mm).__name__} and {type(y_mm).__name__}"
        raise ArgumentError(
            f"x_mm and y_mm are of the types {kinds}: give two arrays of n finite numbers"
        ) from None
    if x.ndim != 1 or x.shape != y.shape or not np.isfinite([x, y]).all():
        raise ArgumentError(
            f"x_mm and y_mm have the shapes {x.shape} and {y.shape}: give two arrays of n finite numbers (of "
            "np.meshgrid: x_mm.ravel(), y_mm.ravel())"
        )
    point_mm = np.column_stack([x, y])
    sampler = sampler_at(surface.layout, point_mm)
    displacement_mm = sampler.displacement(surface)
    return SurfaceSample(
        depth_mm=-displacement_mm[:, 2],
        depth_std_mm=sampler.depth_std(surface),
        displacement_mm=displacement_mm,
        strain=sampler.strain(surface),
        strain_std=sampler.strain_std(surface, posterior),
        pressure_kPa=sampler.pressure_kPa(surface),
        pressure_std_kPa=sampler.pressure_std_kPa(surface, posterior),
    )


def sampler_at(layout: Layout, point_mm: Points2) -> "SurfaceSampler":
    """Prepare n points for many surfaces; results have the shape (n,).

    Args:
        layout: of the surfaces.
        point_mm: (n, 2) on the undeformed sheet, sheet frame, in the unit of the layout.
    """

    def interpolate(how: Interpolation, dx_mm: float, dy_mm: float) -> tuple[Sampling, Points2]:
        moved_mm = _limited(layout, how, point_mm, (dx_mm, dy_mm))
        if how.kind == "idw":
            return inverse_distance_at(layout, how, moved_mm, (len(moved_mm),)), moved_mm
        return sampling_at(layout, moved_mm), moved_mm

    return SurfaceSampler(layout, interpolate)


def sampler_on(layout: Layout, x_mm: Scalars, y_mm: Float64[np.ndarray, " ny"]) -> "SurfaceSampler":
    """Prepare a grid for many surfaces; results have the shape (ny, nx).

    Args:
        layout: of the surfaces.
        x_mm: (nx,) columns on the undeformed sheet, sheet frame, in the unit of the layout.
        y_mm: (ny,) its rows.
    """

    def interpolate(how: Interpolation, dx_mm: float, dy_mm: float) -> tuple[Sampling, Points2]:
        x_row = np.column_stack([x_mm, np.full(len(x_mm), layout.rest_mm[0, 1])])
        y_row = np.column_stack([np.full(len(y_mm), layout.rest_mm[0, 0]), y_mm])
        x_moved = _limited(layout, how, x_row, (dx_mm, 0.0))[:, 0]
        y_moved = _limited(layout, how, y_row, (0.0, dy_mm))[:, 1]
        grid_mm = np.stack(np.meshgrid(x_moved, y_moved), axis=-1).reshape(-1, 2)
        if how.kind == "idw":
            return inverse_distance_at(layout, how, grid_mm, (len(y_mm), len(x_mm))), grid_mm
        return sampling_on(layout, x_moved, y_moved), grid_mm

    return SurfaceSampler(layout, interpolate)


class SurfaceSampler:
    """Evaluates surfaces of one layout at the same points again and again.

    What depends on the points only is computed once per interpolation; `strain_std` repeats it at each call
    for the eight points around each. Results have the shape of the points, and lengths the unit of the
    layout. They are NaN farther than half a pitch outside the markers ("idw": anywhere outside), and where
    the nearest marker of a surface is not known ("idw": no marker within the search radius).
    """

    def __init__(self, layout: Layout, interpolate: Interpolate) -> None:
        """Use `sampler_at` or `sampler_on`."""
        self.layout = layout
        self._interpolate = interpolate
        self._points = lru_cache(maxsize=PREPARED)(lambda how, dx, dy: _Points(*interpolate(how, dx, dy)))
        self._at_markers = _at_markers(layout)

    def displacement(self, surface: Surface) -> Float64[np.ndarray, "*shape 3"]:
        """Displacement of the camera-side face along x, y and z of the sheet frame."""
        return self._here(surface).displacement(_spline_of(surface), self._residual_mm(surface))

    def depth(self, surface: Surface) -> Field:
        """Displacement of the camera-side face along -z; positive when pressed."""
        if _spline_of(surface) is None:
            return self._here(surface).between_markers(-surface.displacement_mm[:, 2])
        return -self.displacement(surface)[..., 2]

    def depth_std(self, surface: Surface) -> Field:
        """Standard deviation of the depth."""
        return self.std_along(surface, np.array([0.0, 0.0, 1.0]))

    def std_along(self, surface: Surface, direction: Float64[np.ndarray, "3"]) -> Field:
        """Standard deviation of the displacement along a unit vector.

        It is interpolated between the markers, as their errors are nearly alike at neighbours.
        """
        variance_mm2 = np.einsum("i,mij,j->m", direction, surface.covariance_mm2, direction)
        return self._here(surface).between_markers(np.sqrt(variance_mm2))

    def strain(self, surface: Surface) -> Field:
        """Largest principal Green-Lagrange strain, 1/2 (F^T F - I), over `GAUGE_PITCH` pitches."""
        return self._strain(surface.interpolation, _spline_of(surface), self._residual_mm(surface))

    def strain_std(self, surface: Surface, posterior: Sequence[SheetSpline]) -> Field:
        """Standard deviation of the strain: of the posterior, and of the model (`STRAIN_SHARE`)."""
        spline, how = _spline_of(surface), surface.interpolation
        found, residual_mm = self.strain(surface), self._residual_mm(surface)
        if spline is None or not posterior:
            return np.full_like(found, np.nan)
        off2 = sum((self._strain(how, each, residual_mm) - found) ** 2 for each in posterior)
        largest = found.copy()
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                offset_mm = (dx * spline.thickness_mm, dy * spline.thickness_mm)
                if any(offset_mm):
                    largest = np.fmax(largest, self._moved(offset_mm).strain(surface))
        return np.asarray(np.sqrt(off2 / len(posterior) + (STRAIN_SHARE * largest) ** 2))

    def pressure_kPa(self, surface: Surface) -> Field:
        """Pressure, positive in compression; NaN where forces or Young's modulus are not known.

        It is always that of the spline, also where the shape is interpolated by "idw".
        """
        return self._points(SPLINE, 0.0, 0.0).pressure_kPa(surface.spline)

    def pressure_std_kPa(self, surface: Surface, posterior: Sequence[SheetSpline]) -> Field:
        """Standard deviation of the pressure.

        It is that of the spline's pressure: a contact narrower than an element appears wider in both.
        """
        found = self.pressure_kPa(surface)
        if surface.spline is None or not posterior:
            return np.full_like(found, np.nan)
        here = self._points(SPLINE, 0.0, 0.0)
        off2 = sum((here.pressure_kPa(each) - found) ** 2 for each in posterior)
        return np.asarray(np.sqrt(off2 / len(posterior)))

    def _moved(self, offset_mm: tuple[float, float]) -> "SurfaceSampler":
        dx_mm, dy_mm = offset_mm
        return SurfaceSampler(
            self.layout, lambda how, x_mm, y_mm: self._interpolate(how, dx_mm + x_mm, dy_mm + y_mm)
        )

    def _here(self, surface: Surface) -> "_Points":
        return self._points(surface.interpolation, 0.0, 0.0)

    def _residual_mm(self, surface: Surface) -> Float64[np.ndarray, "m 3"]:
        """(m, 3) what the markers are displaced beyond the spline."""
        spline = _spline_of(surface)
        if spline is None:
            return surface.displacement_mm
        face = self._at_markers.face(spline)
        return np.asarray(surface.displacement_mm - face.displacement_mm(spline))

    def _ends(self, how: Interpolation) -> "tuple[tuple[_Points, _Points], ...]":
        """Ends of the gauge lengths along x and along y."""
        half_mm = 0.5 * GAUGE_PITCH * float(np.sqrt(np.prod(self.layout.pitch_mm)))
        return tuple(
            (self._points(how, -dx, -dy), self._points(how, dx, dy))
            for dx, dy in ((half_mm, 0.0), (0.0, half_mm))
        )

    def _strain(
        self, how: Interpolation, spline: SheetSpline | None, residual_mm: Float64[np.ndarray, "m 3"]
    ) -> Field:
        gradient = []
        for axis, (before, after) in enumerate(self._ends(how)):
            length_mm = after.point_mm[:, axis] - before.point_mm[:, axis]
            change_mm = after.displacement(spline, residual_mm) - before.displacement(spline, residual_mm)
            with np.errstate(invalid="ignore", divide="ignore"):
                gradient.append(change_mm / length_mm.reshape(*change_mm.shape[:-1], 1))
        by_x, by_y = gradient
        xx = by_x[..., 0] + 0.5 * (by_x**2).sum(axis=-1)
        yy = by_y[..., 1] + 0.5 * (by_y**2).sum(axis=-1)
        xy = 0.5 * (by_y[..., 0] + by_x[..., 1] + (by_x * by_y).sum(axis=-1))
        strain = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
        return np.where(self._points(how, 0.0, 0.0).is_inside, strain, np.nan)


class _Points:
    """Fixed points, with all that can be prepared for them."""

    def __init__(self, sampling: Sampling | None, point_mm: Points2) -> None:
        self.point_mm = point_mm
        self._sampling = sampling
        self._face: tuple[SplineShape, SheetFace] | None = None

    @property
    def is_inside(self) -> np.ndarray:
        """Points within `BEYOND_PITCH` pitches of the markers; by "idw", within the markers."""
        return self._placed.is_inside

    def between_markers(self, value: Float64[np.ndarray, " m"]) -> Field:
        """Values at the markers, interpolated."""
        return self._placed(value)

    def displacement(
        self, spline: SheetSpline | None, residual_mm: Float64[np.ndarray, "m 3"]
    ) -> Float64[np.ndarray, "*shape 3"]:
        """Displacement of the spline, mm, plus the displacement of the markers from it."""
        found_mm = np.stack([self.between_markers(residual_mm[:, axis]) for axis in range(3)], axis=-1)
        if spline is not None:
            found_mm += self.face(spline).displacement_mm(spline).reshape(found_mm.shape)
        return found_mm

    def pressure_kPa(self, spline: SheetSpline | None) -> Field:
        """Pressure by the forces of a spline; NaN without one."""
        shape = self.is_inside.shape
        if spline is None:
            return np.full(shape, np.nan)
        pressure_kPa = KPA_PER_MPA * self.face(spline).pressure_MPa(spline).reshape(shape)
        return np.where(self.is_inside, pressure_kPa, np.nan)

    def face(self, spline: SheetSpline) -> SheetFace:
        """The face at the points, prepared once per shape of spline."""
        shape, prepared = spline_shape(spline), self._face
        if prepared is None or prepared[0] != shape:
            self._face = prepared = (shape, sheet_face(spline, self.point_mm))
        return prepared[1]

    @property
    def _placed(self) -> Sampling:
        assert self._sampling is not None, "these points are the markers"
        return self._sampling


@lru_cache(maxsize=PREPARED)
def _at_markers(layout: Layout) -> _Points:
    """The markers of a layout, prepared once for all samplers."""
    return _Points(None, np.ascontiguousarray(layout.rest_mm[:, :2]))


def _spline_of(surface: Surface) -> SheetSpline | None:
    """The spline that is the surface; None where it is interpolated between the markers."""
    return surface.spline if surface.interpolation.kind == "spline" else None


def _limited(
    layout: Layout, how: Interpolation, point_mm: Points2, offset_mm: tuple[float, float]
) -> Points2:
    """Points moved by an offset, but not across the limit up to which the sheet is sampled."""
    beyond_mm = (0.0 if how.kind == "idw" else BEYOND_PITCH) * layout.pitch_mm
    low = layout.rest_mm[:, :2].min(axis=0) - beyond_mm
    high = layout.rest_mm[:, :2].max(axis=0) + beyond_mm
    moved_mm = np.clip(point_mm + np.array(offset_mm), low, high)
    return np.where(np.array(offset_mm) == 0.0, point_mm, moved_mm)
