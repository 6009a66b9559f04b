"""What the sheet does at every point of an even grid: depth, its deviation, strain, pressure.

Methods that know a spline of the sheet are sampled there, and what they say of the markers beyond it is
spread between these; of others the values at the markers are. Both by cubic splines
(`manytouch.geometry.sampling`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64
from scipy.ndimage import maximum_filter

from manytouch.geometry.sampling import BEYOND_PITCH, sampling_on
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.shell import Shell
from manytouch.sinks.files.description import layout_of
from manytouch.values import Layout, Sensor, SheetSpline, Surface

POINTS_PER_PITCH = 4
KPA_PER_MPA = 1000.0
STRAIN_SHARE = 0.5
"""Of the largest strain nearby: what a solid's face and a shell's differ by, as a deviation."""
Map = Float64[np.ndarray, "ny nx"]


class SheetMaps:
    """Maps of one sensor's surfaces, up to half a pitch outside its outer markers; NaN where not known.

    Attributes:
        x_mm: (nx,) columns of the maps, undeformed sheet coordinates in the sensor's unit.
        y_mm: (ny,) their rows.
    """

    def __init__(
        self, layout: Layout, x_mm: Float64[np.ndarray, " nx"], y_mm: Float64[np.ndarray, " ny"]
    ) -> None:
        self.x_mm, self.y_mm = x_mm, y_mm
        self._sampling = sampling_on(layout, x_mm, y_mm)
        self._sampled: _SampledSpline | None = None

    def displacement(self, surface: Surface) -> Float64[np.ndarray, "ny nx 3"]:
        """Displacement of the camera-side face in the sheet frame; the depth is minus its z."""
        if surface.spline is None:
            return self._between_markers(surface.displacement_mm)
        sampled = self._of(surface.spline)
        at_markers = sampled.at_markers(surface.spline.coefficient_mm)
        found = sampled.on_grid(surface.spline.coefficient_mm).reshape(len(self.y_mm), len(self.x_mm), 3)
        found += self._between_markers(surface.displacement_mm - at_markers)
        return found

    def _between_markers(self, value: Float64[np.ndarray, "m 3"]) -> Float64[np.ndarray, "ny nx 3"]:
        return np.stack([self._sampling(value[:, axis]) for axis in range(3)], axis=-1)

    def depth(self, surface: Surface) -> Map:
        """Depth, positive when pressed."""
        if surface.spline is None:
            return self._sampling(-surface.displacement_mm[:, 2])
        return -self.displacement(surface)[..., 2]

    def depth_std(self, surface: Surface) -> Map:
        """Standard deviation of the depth: that of the markers around, whose errors are much alike."""
        return self._sampling(np.sqrt(surface.covariance_mm2[:, 2, 2]))

    def strain(self, surface: Surface) -> Map:
        """Largest principal Green-Lagrange strain of the camera-side face, 1/2 (F^T F - I)."""
        return self._strain(self.displacement(surface))

    def strain_std(self, surface: Surface, likely: Sequence[SheetSpline]) -> Map:
        """Standard deviation of the strain, from sheets as likely as the surface's (`PosteriorSamples`).

        To the noise is added `STRAIN_SHARE` of the largest strain within a thickness: there a solid's face is
        dented sharper than a shell's.
        """
        if surface.spline is None or not likely:
            return np.full((len(self.y_mm), len(self.x_mm)), np.nan)
        moved = self.displacement(surface)
        on_grid, found = self._of(surface.spline).on_grid, self._strain(moved)
        here = on_grid(surface.spline.coefficient_mm)
        off = (
            self._strain(moved + (on_grid(other.coefficient_mm) - here).reshape(moved.shape)) - found
            for other in likely
        )
        noise2 = sum(each**2 for each in off) / len(likely)
        reach = [
            1 + 2 * round(surface.spline.thickness_mm / abs(float(along[1] - along[0])))
            for along in (self.y_mm, self.x_mm)
        ]
        around = maximum_filter(np.nan_to_num(found), size=reach)
        return np.asarray(np.sqrt(noise2 + (STRAIN_SHARE * around) ** 2))

    def _strain(self, moved: Float64[np.ndarray, "ny nx 3"]) -> Map:
        by_y, by_x = np.gradient(moved, self.y_mm, self.x_mm, axis=(0, 1))
        xx = by_x[..., 0] + 0.5 * (by_x**2).sum(axis=-1)
        yy = by_y[..., 1] + 0.5 * (by_y**2).sum(axis=-1)
        xy = 0.5 * (by_y[..., 0] + by_x[..., 1] + (by_x * by_y).sum(axis=-1))
        return np.asarray(0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy))

    def pressure_kPa(self, surface: Surface) -> Map | None:
        """Pressure, positive in compression; None where forces or Young's modulus are not known.

        A node's force is spread over the integral of its basis function, so the map's integral is the
        total force, and it is as smooth as the spline.
        """
        spline = surface.spline
        if spline is None or spline.young_MPa is None:
            return None
        pressure_MPa = self._of(spline).pressure(-spline.young_MPa * spline.force_over_E_mm2[:, 2])
        return KPA_PER_MPA * pressure_MPa.reshape(len(self.y_mm), len(self.x_mm))

    def pressure_std_kPa(self, surface: Surface, likely: Sequence[SheetSpline]) -> Map | None:
        """Standard deviation of the pressure, from sheets as likely as the surface's (`PosteriorSamples`).

        It is that of the map, which is as smooth as the spline: a contact narrower than an element is
        shown wider.
        """
        found = self.pressure_kPa(surface)
        if found is None:
            return None
        if not likely:
            return np.full_like(found, np.nan)
        off = (self.pressure_kPa(replace(surface, spline=other)) - found for other in likely)
        return np.asarray(np.sqrt(sum(each**2 for each in off) / len(likely)))

    def _of(self, spline: SheetSpline) -> "_SampledSpline":
        if self._sampled is None or not self._sampled.fits(spline):
            place_mm = np.stack(np.meshgrid(self.x_mm, self.y_mm), axis=-1).reshape(-1, 2)
            self._sampled = _SampledSpline(spline, place_mm, self._sampling.rest_mm)
        return self._sampled


class _SampledSpline:
    """The basis functions of splines on one rectangle, at the points of the grid and at the markers."""

    def __init__(
        self, spline: SheetSpline, point_mm: Float64[np.ndarray, "k 2"], marker_mm: Float64[np.ndarray, "m 2"]
    ) -> None:
        patch = SplinePatch(
            size_mm=spline.size_mm,
            elements=spline.elements,
            boundary="clamped" if spline.is_clamped else "soft",
            centre_mm=spline.centre_mm,
        )
        shell = Shell(patch=patch, thickness_mm=spline.thickness_mm, poisson=spline.poisson)
        face = Face(shell=shell, point_mm=point_mm)
        self._key = _shape(spline)
        self.on_grid: Callable[[np.ndarray], np.ndarray] = face.displacement
        at_markers = Face(shell=shell, point_mm=np.ascontiguousarray(marker_mm))
        self.at_markers: Callable[[np.ndarray], np.ndarray] = at_markers.displacement
        self._basis, self._area_mm2 = face.basis, patch.area_mm2

    def fits(self, spline: SheetSpline) -> bool:
        """Is the spline on the same rectangle of the same sheet?"""
        return _shape(spline) == self._key

    def pressure(self, force_N: Float64[np.ndarray, " nodes"]) -> Float64[np.ndarray, " k"]:
        """(k,) MPa from nodal forces."""
        return self._basis.field((force_N / self._area_mm2)[:, None])[:, 0]


def _shape(spline: SheetSpline) -> tuple[object, ...]:
    outline = (spline.size_mm, spline.centre_mm, spline.elements, spline.is_clamped)
    return (*outline, spline.thickness_mm, spline.poisson)


def maps_of(sensor: Sensor) -> SheetMaps:
    """Maps with four points per pitch.

    Raises:
        SensorError: the sensor is a camera only.
    """
    layout = layout_of(sensor)
    rest_mm = layout.rest_mm[:, :2]
    step = float(np.sqrt(np.prod(layout.pitch_mm))) / POINTS_PER_PITCH
    beyond = BEYOND_PITCH * layout.pitch_mm
    low, high = rest_mm.min(axis=0) - beyond, rest_mm.max(axis=0) + beyond
    x_mm, y_mm = (
        np.linspace(begin, end, max(int(np.ceil((end - begin) / step)) + 1, 2))
        for begin, end in zip(low, high, strict=True)
    )
    return SheetMaps(layout, x_mm, y_mm)
