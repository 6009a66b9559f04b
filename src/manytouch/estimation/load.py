"""Where the sheet is loaded: the pressing that best explains how the markers moved and grew.

The depth itself is a poor witness of contacts: two fingers share one hollow, and the image of a press
far from the optical axis is drawn outward. What tells them apart is where the sheet is bent by a force
and not just hangs between forces. So the displacement u of the markers in the plane of the sheet is taken
for a sum of independent Gaussian processes (C. E. Rasmussen, C. K. I. Williams 2006, chapter 2):

    u = r/d w - l grad w  +  s  +  motion of the view  +  noise,      -lap w + w/L^2 = q

with w the depth (perspective moves a marker at r from the foot of the optical axis by r w/d, bending moves
it by the lever l, half the thickness of the sheet, down the slope), q the load, white but for the size of a
fingertip, and s the same for tangential loads. All are series of cosines over the sheet and a margin, so the
best estimate of q is linear in u: one matrix, worked out once, times the displacements of a frame.
q times the pitch is a pure number, the angle by which the slope of the sheet turns within one pitch.

A second witness is how much each dot has grown in the image, the change g of the logarithm of its area:

    g = 2 w/d - l lap w + div s  +  motion of the view  +  noise

It is local where displacements are not: a finger that drags the sheet, or edges that are pulled inward, move
dots far away, but these dots do not grow. Distance, lever and the sheet beyond the view are known badly or
not at all, and one model that has to explain both witnesses bends the load to mend its own mistakes. So each
gives its own estimate, and the load is their weighted mean.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.linalg import cho_factor, cho_solve

from manytouch.geometry.camera import cam_from_sheet
from manytouch.values import Sensor
from manytouch.values.arrays import Points2, Scalars, read_only

_GRADIENT = ((0, 0), (1, 0), (0, 1))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadMap:
    """From displacements to the load, for one sensor. Lengths are in pitches inside.

    Attributes:
        x_mm, y_mm: (nx,), (ny,) columns and rows of the map.
        mode_from_shift: (k * l, 2 m) coefficients of the load from all x, then all y displacements.
        mode_from_growth: (k * l, m) coefficients of the load from the growth of the dots.
        shift_spread, growth_spread: (k * l, k * l) their covariance for displacements, growths of variance 1.
        growth_share: weight of the growth in the load.
        low, wave_x, wave_y: origin and wave numbers (k,), (l,) of the cosines, in pitches.
        along_x, along_y: (nx, k), (ny, l) cosines at the map's columns and rows.
        pitch_mm: the unit.
    """

    x_mm: Scalars
    y_mm: Float64[np.ndarray, " ny"]
    mode_from_shift: np.ndarray
    mode_from_growth: np.ndarray
    shift_spread: np.ndarray
    growth_spread: np.ndarray
    growth_share: float
    low: np.ndarray
    wave_x: np.ndarray
    wave_y: np.ndarray
    along_x: np.ndarray
    along_y: np.ndarray
    pitch_mm: float

    def shift_modes(self, shift_mm: Points2) -> Float64[np.ndarray, "k l"]:
        """Coefficients of the load from displacements (m, 2) of all markers alone."""
        shift = (shift_mm.T.ravel() / self.pitch_mm).astype(self.mode_from_shift.dtype)
        return self._shaped(self.mode_from_shift @ shift)

    def joined(
        self, shift_modes: Float64[np.ndarray, "k l"], growth: Scalars | None
    ) -> Float64[np.ndarray, "k l"]:
        """Coefficients of the load from both witnesses; growths (m,), or None when there are none."""
        if growth is None or self.growth_share == 0.0:
            return shift_modes
        grown = self._shaped(self.mode_from_growth @ growth.astype(self.mode_from_growth.dtype))
        return np.asarray((1.0 - self.growth_share) * shift_modes + self.growth_share * grown)

    def _shaped(self, modes: np.ndarray) -> Float64[np.ndarray, "k l"]:
        return np.asarray(modes.reshape(len(self.wave_x), len(self.wave_y)).astype(np.float64))

    def load(self, modes: Float64[np.ndarray, "k l"]) -> Float64[np.ndarray, "ny nx"]:
        """The load times the pitch on the map (ny, nx), positive where something presses."""
        return np.asarray(self.along_y @ modes.T @ self.along_x.T)

    def load_at(self, point_mm: Points2, modes: Float64[np.ndarray, "k l"]) -> Scalars:
        """The load times the pitch at points (n, 2) of the sheet."""
        return np.asarray(self._basis(point_mm) @ modes.ravel())

    def spread(self, std_mm: float, growth_std: float | None) -> Float64[np.ndarray, "q q"]:
        """Covariance of the modes for displacements of std_mm along each axis and growths of growth_std."""
        shift = (std_mm / self.pitch_mm) ** 2
        if growth_std is None or self.growth_share == 0.0:
            return shift * self.shift_spread
        shift *= (1.0 - self.growth_share) ** 2
        return np.asarray(
            shift * self.shift_spread + (self.growth_share * growth_std) ** 2 * self.growth_spread
        )

    def load_std(self, point_mm: Points2, spread: Float64[np.ndarray, "q q"]) -> Scalars:
        """Standard deviation (n,) of `load_at` for a `spread` of the modes."""
        basis = self._basis(point_mm)
        return np.asarray(np.sqrt(((basis @ spread) * basis).sum(axis=1)))

    def centre_covariance(
        self, point_mm: Points2, spread: Float64[np.ndarray, "q q"], modes: Float64[np.ndarray, "k l"]
    ) -> Float64[np.ndarray, "n 2 2"]:
        """Covariance in mm^2 of the places of maxima, from the `spread` of the modes.

        At a maximum grad q = 0, so noise moves it by -H^-1 grad dq with H the second derivatives of q.
        """
        slope = np.stack([self._basis(point_mm, 1, 0), self._basis(point_mm, 0, 1)], axis=1)
        noise = (slope @ spread) @ slope.transpose(0, 2, 1) * self.pitch_mm**2
        bend = np.empty((len(point_mm), 2, 2))
        for (a, b), orders in (((0, 0), (2, 0)), ((1, 1), (0, 2)), ((0, 1), (1, 1))):
            bend[:, a, b] = bend[:, b, a] = self._basis(point_mm, *orders) @ modes.ravel()
        # A flat top is no sharper than a hill two pitches wide.
        bend -= 0.25 * np.abs(self.load_at(point_mm, modes))[:, None, None] * np.eye(2)
        inverse = np.linalg.inv(bend)
        return np.asarray(inverse @ noise @ inverse)

    def _basis(self, point_mm: Points2, order_x: int = 0, order_y: int = 0) -> np.ndarray:
        return _products(point_mm / self.pitch_mm - self.low, self.wave_x, self.wave_y, order_x, order_y)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadModel:
    """What is assumed of sheet, fingers and view; all lengths in pitches.

    Attributes:
        margin: how far the sheet goes on beyond the outer markers.
        finest, finest_growth: shortest wavelength of the load that displacements, growths are to tell.
        finest_tangential: shortest wavelength of tangential loads.
        decay: length over which the sheet forgets a load.
        fingertip: radius over which a load is spread.
        tangential: size of tangential loads against normal ones.
        model_error, growth_error: of a displacement, of a growth; what the model does not explain. The error
            of a growth rises with the fourth power of how much smaller than usual a dot's area is at rest,
            since a half-printed dot seems to grow when the light changes.
        growth_share, growth_share_assumed: weight of the growth in the load, when the camera is known and
            when its field of view was assumed: displacements then put the load in the wrong place.
        shift, angle_rad, tilt, zoom: usual size of the motion of the view: along the sheet, about its normal,
            of the camera's axis, and towards the sheet as part of the distance.
        points_per_pitch: of the map.
    """

    margin: float = 2.0
    finest: float = 4.0
    finest_growth: float = 4.0
    finest_tangential: float = 4.0
    decay: float = 4.0
    fingertip: float = 0.8
    tangential: float = 1.0
    model_error: float = 0.1
    growth_error: float = 0.2
    growth_share: float = 0.1
    growth_share_assumed: float = 0.6
    shift: float = 1.0
    angle_rad: float = 0.05
    tilt: float = 0.05
    zoom: float = 0.03
    points_per_pitch: float = 3.0

    def __call__(self, sensor: Sensor, rest_mm: Points2) -> LoadMap:
        """Works out the map for a sensor whose markers rest at (m, 2) in the plane of the sheet."""
        assert sensor.layout is not None
        pitch_mm = float(np.sqrt(np.prod(sensor.layout.pitch_mm)))
        pitch = sensor.layout.pitch_mm / pitch_mm
        rest = rest_mm / pitch_mm
        rotation, translation = cam_from_sheet(sensor.camera)
        eye = -translation @ rotation / pitch_mm
        arm = (rest - eye[:2]) / -eye[2]
        lever = 0.0 if sensor.sheet is None else 0.5 * sensor.sheet.thickness_mm / pitch_mm
        low = rest.min(axis=0) - self.margin * pitch
        size = rest.max(axis=0) + self.margin * pitch - low
        place = rest - low
        wave_x, wave_y = _waves(size, pitch, min(self.finest, self.finest_growth))
        square = (wave_x[:, None] ** 2 + wave_y**2).ravel()
        smooth = np.exp(-0.25 * self.fingertip**2 * square)
        scale = smooth / (square + self.decay**-2)
        is_coarse = _is_coarse(wave_x, wave_y, size, pitch, self.finest)
        depth, slope_x, slope_y = (_products(place, wave_x, wave_y, *orders) for orders in _GRADIENT)
        normal = np.concatenate([arm[:, :1] * depth - lever * slope_x, arm[:, 1:] * depth - lever * slope_y])
        tangential = self._tangential(place, size, pitch)
        none = np.zeros_like(tangential[0])
        pulled = np.block([[tangential[0], none], [none, tangential[0]]])
        mode_from_shift = _best(
            normal * (scale * is_coarse),
            pulled @ pulled.T + self._view(rest, arm, -float(eye[2])),
            np.full(2 * len(rest), self.model_error),
            smooth,
        )
        pulled = np.concatenate(tangential[1:], axis=1)
        evenly = np.column_stack([np.ones(len(rest)), arm]) * [self.zoom, self.tilt, self.tilt]
        radius = sensor.layout.radius_mm
        mode_from_growth = _best(
            (-2.0 / eye[2] * depth + lever * depth * square) * scale,
            pulled @ pulled.T + 4.0 * evenly @ evenly.T,
            self.growth_error * np.maximum(1.0, np.median(radius) / radius) ** 8,
            smooth,
        )
        x_mm, y_mm = (self._axis(rest_mm[:, k], sensor.layout.pitch_mm[k]) for k in range(2))
        return LoadMap(
            x_mm=read_only(x_mm),
            y_mm=read_only(y_mm),
            mode_from_shift=read_only(mode_from_shift.astype(np.float32)),
            mode_from_growth=read_only(mode_from_growth.astype(np.float32)),
            shift_spread=read_only(mode_from_shift @ mode_from_shift.T),
            growth_spread=read_only(mode_from_growth @ mode_from_growth.T),
            growth_share=self.growth_share_assumed if assumes_view(sensor) else self.growth_share,
            low=read_only(low),
            wave_x=read_only(wave_x),
            wave_y=read_only(wave_y),
            along_x=read_only(_cosines(x_mm / pitch_mm - low[0], wave_x, 0)),
            along_y=read_only(_cosines(y_mm / pitch_mm - low[1], wave_y, 0)),
            pitch_mm=pitch_mm,
        )

    def _tangential(self, place: Points2, size: np.ndarray, pitch: np.ndarray) -> list[np.ndarray]:
        """What tangential loads along an axis do: displacements, their derivatives along x and y; (m, q)."""
        wave_x, wave_y = _waves(size, pitch, self.finest_tangential)
        square = (wave_x[:, None] ** 2 + wave_y**2).ravel()
        scale = self.tangential * np.exp(-0.25 * self.fingertip**2 * square) / (square + self.decay**-2)
        return [_products(place, wave_x, wave_y, *orders) * scale for orders in _GRADIENT]

    def _view(self, rest: Points2, arm: Points2, distance: float) -> np.ndarray:
        """(2 m, 2 m) covariance of what the view's motion does."""
        none, one = np.zeros(len(rest)), np.ones(len(rest))
        view = np.column_stack(
            [
                self.shift * np.concatenate([one, none]),
                self.shift * np.concatenate([none, one]),
                self.angle_rad * np.concatenate([-rest[:, 1], rest[:, 0]]),
                self.zoom * distance * np.concatenate([arm[:, 0], arm[:, 1]]),
                self.tilt * distance * np.concatenate([arm[:, 0] ** 2, arm[:, 0] * arm[:, 1]]),
                self.tilt * distance * np.concatenate([arm[:, 0] * arm[:, 1], arm[:, 1] ** 2]),
            ]
        )
        return np.asarray(view @ view.T)

    def _axis(self, rest_mm: np.ndarray, pitch_mm: float) -> np.ndarray:
        low, high = rest_mm.min() - 0.5 * pitch_mm, rest_mm.max() + 0.5 * pitch_mm
        return np.linspace(low, high, max(3, round((high - low) / pitch_mm * self.points_per_pitch) + 1))


def assumes_view(sensor: Sensor) -> bool:
    """Was the camera's field of view assumed, so that distances and slopes are known badly?"""
    return any("field of view" in sentence for sentence in sensor.assumptions)


def _best(known: np.ndarray, other: np.ndarray, error: np.ndarray, smooth: np.ndarray) -> np.ndarray:
    """(q, n) best linear estimate of the modes of the load from n observations.

    Args:
        known: (n, q) what modes of variance 1 do to the observations.
        other: (n, n) covariance of the observations from causes that are of no interest.
        error: (n,) standard deviation of each observation.
        smooth: (q,) size of a fingertip in each mode.
    """
    covariance = known @ known.T + other
    covariance[np.diag_indices_from(covariance)] += error**2
    factor = cho_factor(covariance, lower=True, overwrite_a=True, check_finite=False)
    estimate = cho_solve(factor, known, check_finite=False)
    # The series of the load holds fingertips, so it is smoothed like one when it is read.
    return np.asarray(smooth[:, None] ** 2 * estimate.T)


def _products(
    place: Points2, wave_x: np.ndarray, wave_y: np.ndarray, order_x: int, order_y: int
) -> Float64[np.ndarray, "n q"]:
    """Products of the cosines along x and y, or of their derivatives."""
    along_x, along_y = _cosines(place[:, 0], wave_x, order_x), _cosines(place[:, 1], wave_y, order_y)
    count = len(wave_x) * len(wave_y)
    return np.asarray((along_x[:, :, None] * along_y[:, None, :]).reshape(len(place), count))


def _is_coarse(
    wave_x: np.ndarray, wave_y: np.ndarray, size: np.ndarray, pitch: np.ndarray, finest: float
) -> np.ndarray:
    """(q,) which products of cosines are no finer than a wavelength."""
    coarse_x, coarse_y = _waves(size, pitch, finest)
    return np.asarray(
        ((np.arange(len(wave_x)) < len(coarse_x))[:, None] & (np.arange(len(wave_y)) < len(coarse_y))).ravel()
    )


def _waves(size: np.ndarray, pitch: np.ndarray, finest: float) -> tuple[np.ndarray, np.ndarray]:
    """Wave numbers along x and y of the cosines down to the finest wavelength, in pitches."""
    counts = np.ceil(2.0 * size / (finest * pitch)).astype(int) + 1
    return np.arange(counts[0]) * np.pi / size[0], np.arange(counts[1]) * np.pi / size[1]


def _cosines(place: np.ndarray, wave: np.ndarray, order: int) -> np.ndarray:
    """(n, k) cosines of norm 1 on the interval of which they are the free modes, or their derivatives."""
    size = np.pi / wave[1]
    norm = np.where(wave == 0.0, 1.0, np.sqrt(2.0)) / np.sqrt(size)
    return np.asarray(norm * wave**order * np.cos(place[:, None] * wave + 0.5 * np.pi * order))
