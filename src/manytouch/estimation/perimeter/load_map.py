"""A map of what presses: a series of cosines whose coefficients are linear in what is seen."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.perimeter.cosine_series import cosines, outer, products
from manytouch.values import Layout
from manytouch.values.arrays import Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadMap:
    """From what is seen of all markers to a load everywhere. Lengths are in pitches inside.

    Attributes:
        x_mm, y_mm: (nx,), (ny,) columns and rows of the map.
        estimate: (k * l, n) coefficients of the load from n numbers that are seen.
        spread: (k * l, k * l) their covariance when these numbers have variance 1.
        evenness: (k * l, k * l) covariance of coefficients by whose deviation the load is divided at each
            place, so that a load near the border, which is seen worse, is not told too small; None: by 1.
        low, wave_x, wave_y: origin and wave numbers (k,), (l,) of the cosines, in pitches.
        along_x, along_y: (nx, k), (ny, l) cosines at the map's columns and rows.
        divisor: (ny, nx) of the load at the points of the map.
        pitch_mm: the unit.
    """

    x_mm: Scalars
    y_mm: Float64[np.ndarray, " ny"]
    estimate: np.ndarray
    spread: np.ndarray
    evenness: np.ndarray | None
    low: np.ndarray
    wave_x: np.ndarray
    wave_y: np.ndarray
    along_x: np.ndarray
    along_y: np.ndarray
    divisor: np.ndarray
    pitch_mm: float

    def modes(self, seen: Scalars) -> Float64[np.ndarray, "k l"]:
        """Coefficients of the load from what is seen (n,)."""
        modes = self.estimate @ seen.astype(self.estimate.dtype)
        return np.asarray(modes.reshape(len(self.wave_x), len(self.wave_y)).astype(np.float64))

    def load(self, modes: Float64[np.ndarray, "k l"]) -> Float64[np.ndarray, "ny nx"]:
        """The load on the map (ny, nx), positive where something presses."""
        return np.asarray(self.along_y @ modes.T @ self.along_x.T / self.divisor)

    def load_at(self, point_mm: Points2, modes: Float64[np.ndarray, "k l"]) -> Scalars:
        """The load at points (n, 2) of the sheet."""
        basis = self._basis(point_mm)
        return np.asarray(basis @ modes.ravel() / self._divisor(basis))

    def load_std(self, point_mm: Points2, variance: float) -> Scalars:
        """Standard deviation (n,) of `load_at` when what is seen has this variance."""
        basis = self._basis(point_mm)
        spread = (self._spread(basis, variance) * basis).sum(axis=1)
        return np.asarray(np.sqrt(spread) / self._divisor(basis))

    def centre_covariance(
        self, point_mm: Points2, variance: float, modes: Float64[np.ndarray, "k l"]
    ) -> Float64[np.ndarray, "n 2 2"]:
        """Covariance in mm^2 of the places of maxima, when what is seen has this variance.

        At a maximum grad q = 0, so noise moves it by -H^-1 grad dq with H the second derivatives of q.
        """
        count = len(point_mm)
        place = point_mm / self.pitch_mm - self.low
        x = [cosines(place[:, 0], self.wave_x, order) for order in range(3)]
        y = [cosines(place[:, 1], self.wave_y, order) for order in range(3)]
        slope = np.concatenate([outer(x[1], y[0]), outer(x[0], y[1])])
        pushed = self._spread(slope, variance).reshape(2, count, -1)
        moved = np.einsum("anq,bnq->nab", pushed, slope.reshape(2, count, -1)) * self.pitch_mm**2
        rows = [each @ modes for each in x]
        bend = np.empty((count, 2, 2))
        bend[:, 0, 0] = (rows[2] * y[0]).sum(axis=1)
        bend[:, 1, 1] = (rows[0] * y[2]).sum(axis=1)
        bend[:, 0, 1] = bend[:, 1, 0] = (rows[1] * y[1]).sum(axis=1)
        # A flat top is no sharper than a hill two pitches wide.
        bend -= 0.25 * np.abs((rows[0] * y[0]).sum(axis=1))[:, None, None] * np.eye(2)
        inverse = np.linalg.inv(bend)
        return np.asarray(inverse @ moved @ inverse)

    def _spread(self, basis: np.ndarray, variance: float) -> np.ndarray:
        """Rows (n, q) times the covariance of the modes."""
        return np.asarray(variance * (basis.astype(self.spread.dtype) @ self.spread).astype(np.float64))

    def _divisor(self, basis: np.ndarray) -> Scalars:
        if self.evenness is None:
            return np.ones(len(basis))
        pushed = basis.astype(self.evenness.dtype) @ self.evenness
        return np.asarray(np.sqrt((pushed * basis).sum(axis=1)))

    def _basis(self, point_mm: Points2) -> np.ndarray:
        return products(point_mm / self.pitch_mm - self.low, self.wave_x, self.wave_y)


def chart(
    layout: Layout,
    rest_mm: Points2,
    *,
    low: np.ndarray,
    wave: tuple[np.ndarray, np.ndarray],
    estimate: np.ndarray,
    spread: np.ndarray,
    points_per_pitch: float,
    evenness: np.ndarray | None = None,
) -> LoadMap:
    """The map over markers that rest at (m, 2), and half a pitch around them."""
    pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
    x_mm, y_mm = (_axis(rest_mm[:, k], layout.pitch_mm[k], points_per_pitch) for k in range(2))
    along_x, along_y = (cosines(at / pitch_mm - low[k], wave[k], 0) for k, at in enumerate((x_mm, y_mm)))
    divisor = np.ones((len(y_mm), len(x_mm)))
    if evenness is not None:
        for row, beside in enumerate(along_y):
            basis = outer(along_x, np.broadcast_to(beside, (len(along_x), len(beside))))
            divisor[row] = np.sqrt(((basis @ evenness) * basis).sum(axis=1))
        scale = float(np.median(divisor))
        divisor, evenness = divisor / scale, read_only((evenness / scale**2).astype(np.float32))
    return LoadMap(
        x_mm=read_only(x_mm),
        y_mm=read_only(y_mm),
        estimate=read_only(estimate),
        spread=read_only(spread.astype(np.float32)),
        evenness=evenness,
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
