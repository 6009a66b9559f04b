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

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.modes import (
    Series,
    affordable,
    best_estimate,
    cosines,
    is_coarse,
    outer,
    products,
    waves,
)
from manytouch.geometry.camera import cam_from_sheet
from manytouch.values import Sensor
from manytouch.values.arrays import Points2, Scalars, read_only

_GRADIENT = ((1, 0), (0, 1))


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

    def noise(self, std_mm: float, growth_std: float | None) -> tuple[float, float]:
        """Variances that `shift_spread` and `growth_spread` have in the covariance of the modes.

        Args:
            std_mm: standard deviation of displacements along each axis.
            growth_std: of growths; None when there are none.
        """
        shift = (std_mm / self.pitch_mm) ** 2
        if growth_std is None or self.growth_share == 0.0:
            return shift, 0.0
        return shift * (1.0 - self.growth_share) ** 2, (self.growth_share * growth_std) ** 2

    def load_std(self, point_mm: Points2, noise: tuple[float, float]) -> Scalars:
        """Standard deviation (n,) of `load_at` for a `noise`."""
        basis = self._basis(point_mm)
        return np.asarray(np.sqrt((self._spread(basis, noise) * basis).sum(axis=1)))

    def centre_covariance(
        self, point_mm: Points2, noise: tuple[float, float], modes: Float64[np.ndarray, "k l"]
    ) -> Float64[np.ndarray, "n 2 2"]:
        """Covariance in mm^2 of the places of maxima, from the `noise`.

        At a maximum grad q = 0, so noise moves it by -H^-1 grad dq with H the second derivatives of q.
        """
        count = len(point_mm)
        place = point_mm / self.pitch_mm - self.low
        x = [cosines(place[:, 0], self.wave_x, order) for order in range(3)]
        y = [cosines(place[:, 1], self.wave_y, order) for order in range(3)]
        slope = np.concatenate([outer(x[1], y[0]), outer(x[0], y[1])])
        pushed = self._spread(slope, noise).reshape(2, count, -1)
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

    def _spread(self, basis: np.ndarray, noise: tuple[float, float]) -> np.ndarray:
        """Rows (n, q) times the covariance of the modes, which is never formed: it is large."""
        shift, growth = noise
        single = basis.astype(self.shift_spread.dtype)
        spread = shift * (single @ self.shift_spread).astype(np.float64)
        return np.asarray(spread if growth == 0.0 else spread + growth * (single @ self.growth_spread))

    def _basis(self, point_mm: Points2) -> np.ndarray:
        return products(point_mm / self.pitch_mm - self.low, self.wave_x, self.wave_y)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Scene:
    """How the markers at rest are seen, in pitches: places and their slopes from the eye (m, 2)."""

    rest: Points2
    arm: Points2
    distance: float
    lever: float


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
        most_products: of cosines in each series: where a sheet has more markers than about three times
            that, the series of all loads are coarser, or the work would grow with the cube of the markers.
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
    most_products: int = 420
    points_per_pitch: float = 3.0

    def __call__(self, sensor: Sensor, rest_mm: Points2) -> LoadMap:
        """Works out the map for a sensor whose markers rest at (m, 2) in the plane of the sheet."""
        assert sensor.layout is not None
        pitch_mm = float(np.sqrt(np.prod(sensor.layout.pitch_mm)))
        pitch = sensor.layout.pitch_mm / pitch_mm
        rest = rest_mm / pitch_mm
        rotation, translation = cam_from_sheet(sensor.camera)
        eye = -translation @ rotation / pitch_mm
        low = rest.min(axis=0) - self.margin * pitch
        size = rest.max(axis=0) + self.margin * pitch - low
        scene = _Scene(
            rest=rest,
            arm=(rest - eye[:2]) / -eye[2],
            distance=-float(eye[2]),
            lever=0.0 if sensor.sheet is None else 0.5 * sensor.sheet.thickness_mm / pitch_mm,
        )
        finest = affordable(size, pitch, min(self.finest, self.finest_growth), self.most_products)
        depth = self._hollows(low, waves(size, pitch, finest))
        # Displacements and growths may tell loads down to different wavelengths.
        coarse, fine = (
            replace(depth, scale=depth.scale * is_coarse(depth.wave_x, depth.wave_y, size, pitch, each))
            for each in (max(self.finest, finest), max(self.finest_growth, finest))
        )
        finest = affordable(size, pitch, self.finest_tangential, self.most_products)
        pull = self._hollows(low, waves(size, pitch, finest))
        pull = replace(pull, scale=self.tangential * pull.scale)
        smooth = np.exp(-0.25 * self.fingertip**2 * depth.square)
        radius = sensor.layout.radius_mm
        mode_from_shift, shift_spread = best_estimate(
            lambda at: self._shifts(scene, coarse, pull, at), np.full(len(rest), self.model_error), smooth
        )
        mode_from_growth, growth_spread = best_estimate(
            lambda at: self._growths(scene, fine, pull, at),
            self.growth_error * np.maximum(1.0, np.median(radius) / radius) ** 8,
            smooth,
        )
        x_mm, y_mm = (self._axis(rest_mm[:, k], sensor.layout.pitch_mm[k]) for k in range(2))
        return LoadMap(
            x_mm=read_only(x_mm),
            y_mm=read_only(y_mm),
            mode_from_shift=read_only(mode_from_shift),
            mode_from_growth=read_only(mode_from_growth),
            shift_spread=read_only(shift_spread.astype(np.float32)),
            growth_spread=read_only(growth_spread.astype(np.float32)),
            growth_share=self.growth_share_assumed if assumes_view(sensor) else self.growth_share,
            low=read_only(low),
            wave_x=read_only(depth.wave_x),
            wave_y=read_only(depth.wave_y),
            along_x=read_only(cosines(x_mm / pitch_mm - low[0], depth.wave_x, 0)),
            along_y=read_only(cosines(y_mm / pitch_mm - low[1], depth.wave_y, 0)),
            pitch_mm=pitch_mm,
        )

    def _hollows(self, low: np.ndarray, wave: tuple[np.ndarray, np.ndarray]) -> Series:
        """What loads of variance 1 that are spread over fingertips do to the depth."""
        plain = Series(low=low, wave_x=wave[0], wave_y=wave[1], scale=np.ones(1))
        smooth = np.exp(-0.25 * self.fingertip**2 * plain.square)
        return replace(plain, scale=smooth / (plain.square + self.decay**-2))

    def _shifts(self, scene: _Scene, depth: Series, pull: Series, at: slice) -> np.ndarray:
        """(2, n, r) displacements of some markers along x and y by all that moves them."""
        rest, arm = scene.rest[at], scene.arm[at]
        bent = [arm[:, k, None] * depth(rest) - scene.lever * depth(rest, *_GRADIENT[k]) for k in range(2)]
        pulled = pull(rest)
        none = np.zeros_like(pulled)
        view = self._view(rest, arm, scene.distance)
        return np.stack(
            [
                np.concatenate([bent[0], pulled, none, view[0]], axis=1),
                np.concatenate([bent[1], none, pulled, view[1]], axis=1),
            ]
        )

    def _growths(self, scene: _Scene, depth: Series, pull: Series, at: slice) -> np.ndarray:
        """(1, n, r) growths of some markers by all that makes them grow."""
        rest, arm = scene.rest[at], scene.arm[at]
        nearer = depth(rest) * (2.0 / scene.distance + scene.lever * depth.square)
        pulled = [pull(rest, *orders) for orders in _GRADIENT]
        evenly = 2.0 * np.column_stack([np.ones(len(rest)), arm]) * [self.zoom, self.tilt, self.tilt]
        return np.concatenate([nearer, *pulled, evenly], axis=1)[None]

    def _view(self, rest: Points2, arm: Points2, distance: float) -> np.ndarray:
        """(2, n, 6) what the view's motions of usual size do to places (n, 2), along x and along y."""
        x, y = arm.T
        none, one = np.zeros(len(rest)), np.ones(len(rest))
        size = [self.shift, self.shift, self.angle_rad]
        size += [distance * each for each in (self.zoom, self.tilt, self.tilt)]
        along_x = np.column_stack([one, none, -rest[:, 1], x, x**2, x * y])
        along_y = np.column_stack([none, one, rest[:, 0], y, x * y, y**2])
        return np.stack([along_x, along_y]) * size

    def _axis(self, rest_mm: np.ndarray, pitch_mm: float) -> np.ndarray:
        low, high = rest_mm.min() - 0.5 * pitch_mm, rest_mm.max() + 0.5 * pitch_mm
        return np.linspace(low, high, max(3, round((high - low) / pitch_mm * self.points_per_pitch) + 1))


def assumes_view(sensor: Sensor) -> bool:
    """Was the camera's field of view assumed, so that distances and slopes are known badly?"""
    return any("field of view" in sentence for sentence in sensor.assumptions)
