"""The load over the sheet as a cosine series whose coefficients are linear in the observations."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from manytouch.estimation.load.cosine_series import cosines, products_at
from manytouch.values import Layout
from manytouch.values.arrays import Points2, Scalars, read_only

Observed = Float64[np.ndarray, " n"] | Float32[np.ndarray, " n"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadMap:
    """Load density at any point of the sheet from observations of all markers.

    Wave numbers, the origin and the load are in units of the pitch.

    Attributes:
        x_mm, y_mm: (nx,), (ny,) columns and rows of the map.
        estimate: (k * l, n) estimator of the coefficients from n observations.
        spread: (k * l, k * l) covariance of the coefficients for observations of variance 1.
        sensitivity: (k * l, k * l) covariance of the coefficients of a random load; the load is divided by
            the standard deviation that follows at each point, because markers near the border are fewer
            and the load would be underestimated there. None: the load is not divided.
        low, wave_x, wave_y: origin and wave numbers (k,), (l,) of the cosines.
        along_x, along_y: (nx, k), (ny, l) cosines at the columns and rows of the map.
        divisor: (ny, nx) divisor of the load at the points of the map.
        pitch_mm: geometric mean of the pitches.
    """

    x_mm: Scalars
    y_mm: Float64[np.ndarray, " ny"]
    estimate: np.ndarray
    spread: np.ndarray
    sensitivity: np.ndarray | None
    low: np.ndarray
    wave_x: np.ndarray
    wave_y: np.ndarray
    along_x: np.ndarray
    along_y: np.ndarray
    divisor: np.ndarray
    pitch_mm: float

    def coefficients(self, observed: Observed) -> Float64[np.ndarray, "k l"]:
        """Coefficients of the load from observations (n,)."""
        coefficients = self.estimate @ observed.astype(self.estimate.dtype, copy=False)
        return np.asarray(coefficients.reshape(len(self.wave_x), len(self.wave_y)).astype(np.float64))

    def load_on_grid(self, coefficients: Float64[np.ndarray, "k l"]) -> Float64[np.ndarray, "ny nx"]:
        """Load (ny, nx) at the points of the map, positive under a contact."""
        load = np.asarray(self.along_y @ coefficients.T @ self.along_x.T)
        return load if self.sensitivity is None else load / self.divisor

    def load_at(self, point_mm: Points2, coefficients: Float64[np.ndarray, "k l"]) -> Scalars:
        """(n,) load at points (n, 2) of the sheet."""
        basis = self._basis(point_mm)
        return np.asarray(basis @ coefficients.ravel() / self._divisor(basis))

    def load_std(self, point_mm: Points2, variance: float) -> Scalars:
        """(n,) standard deviation of `load_at` for observations of this variance."""
        basis = self._basis(point_mm)
        spread = (self._spread(basis, variance) * basis).sum(axis=1)
        return np.asarray(np.sqrt(spread) / self._divisor(basis))

    def centre_covariance(
        self, point_mm: Points2, variance: float, coefficients: Float64[np.ndarray, "k l"]
    ) -> Float64[np.ndarray, "n 2 2"]:
        """(n, 2, 2) covariance in mm^2 of the positions of maxima, for observations of this variance.

        At a maximum grad q = 0, so noise moves it by -H^-1 grad dq with H the second derivatives of q.
        """
        from manytouch.estimation.load.load_kernels import covariances_of_maxima, slopes_at_points

        place = point_mm / self.pitch_mm - self.low
        slope, bend = slopes_at_points(place, self.wave_x, self.wave_y, coefficients)
        weighted = slope.astype(self.spread.dtype) @ self.spread
        return covariances_of_maxima(slope, weighted, bend, variance * self.pitch_mm**2)

    def _spread(self, basis: np.ndarray, variance: float) -> np.ndarray:
        """(n, q) basis times the covariance of the coefficients."""
        return np.asarray(variance * (basis.astype(self.spread.dtype) @ self.spread).astype(np.float64))

    def _divisor(self, basis: np.ndarray) -> Scalars:
        if self.sensitivity is None:
            return np.ones(len(basis))
        weighted = basis.astype(self.sensitivity.dtype) @ self.sensitivity
        return np.asarray(np.sqrt((weighted * basis).sum(axis=1)))

    def _basis(self, point_mm: Points2) -> np.ndarray:
        from manytouch.estimation.load.load_kernels import products_at_points

        return products_at_points(point_mm / self.pitch_mm - self.low, self.wave_x, self.wave_y)


def make_load_map(
    layout: Layout,
    rest_mm: Points2,
    *,
    low: np.ndarray,
    wave: tuple[np.ndarray, np.ndarray],
    estimate: np.ndarray,
    spread: np.ndarray,
    points_per_pitch: float,
    sensitivity: np.ndarray | None = None,
) -> LoadMap:
    """A load map over markers at rest (m, 2) and half a pitch around them."""
    pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
    x_mm, y_mm = (_axis(rest_mm[:, k], layout.pitch_mm[k], points_per_pitch) for k in range(2))
    along_x, along_y = (cosines(at / pitch_mm - low[k], wave[k], 0) for k, at in enumerate((x_mm, y_mm)))
    divisor = np.ones((len(y_mm), len(x_mm)))
    if sensitivity is not None:
        for row, cosines_y in enumerate(along_y):
            basis = products_at(along_x, np.broadcast_to(cosines_y, (len(along_x), len(cosines_y))))
            divisor[row] = np.sqrt(((basis @ sensitivity) * basis).sum(axis=1))
        scale = float(np.median(divisor))
        divisor, sensitivity = divisor / scale, read_only((sensitivity / scale**2).astype(np.float32))
    return LoadMap(
        x_mm=read_only(x_mm),
        y_mm=read_only(y_mm),
        estimate=read_only(estimate),
        spread=read_only(spread.astype(np.float32)),
        sensitivity=sensitivity,
        low=read_only(low),
        wave_x=read_only(wave[0]),
        wave_y=read_only(wave[1]),
        along_x=read_only(along_x),
        along_y=read_only(along_y),
        divisor=read_only(divisor),
        pitch_mm=pitch_mm,
    )


def _axis(rest_mm: np.ndarray, pitch_mm: float, points_per_pitch: float) -> np.ndarray:
    low, high = rest_mm.min() - 0.5 * pitch_mm, rest_mm.max() + 0.5 * pitch_mm
    return np.linspace(low, high, max(3, round((high - low) / pitch_mm * points_per_pitch) + 1))
