"""Where the sheet is loaded: the pressing that best explains how the markers moved.

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
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.camera import cam_from_sheet
from manytouch.values import Sensor
from manytouch.values.arrays import Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadMap:
    """From displacements to the load, for one sensor. Lengths are in pitches inside.

    Attributes:
        x_mm, y_mm: (nx,), (ny,) columns and rows of the map.
        mode_from_shift: (k * l, 2 m) coefficients of the load from all x, then all y displacements.
        spread: (k * l, k * l) covariance of the coefficients for displacements of variance 1.
        low, wave_x, wave_y: origin and wave numbers (k,), (l,) of the cosines, in pitches.
        along_x, along_y: (nx, k), (ny, l) cosines at the map's columns and rows.
        pitch_mm: the unit.
    """

    x_mm: Scalars
    y_mm: Float64[np.ndarray, " ny"]
    mode_from_shift: np.ndarray
    spread: np.ndarray
    low: np.ndarray
    wave_x: np.ndarray
    wave_y: np.ndarray
    along_x: np.ndarray
    along_y: np.ndarray
    pitch_mm: float

    def modes(self, shift_mm: Points2) -> Float64[np.ndarray, "k l"]:
        """Coefficients of the load from the displacements (m, 2) of all markers."""
        shift = (shift_mm.T.ravel() / self.pitch_mm).astype(self.mode_from_shift.dtype)
        modes = self.mode_from_shift @ shift
        return np.asarray(modes.reshape(len(self.wave_x), len(self.wave_y)).astype(np.float64))

    def load(self, modes: Float64[np.ndarray, "k l"]) -> Float64[np.ndarray, "ny nx"]:
        """The load times the pitch on the map (ny, nx), positive where something presses."""
        return np.asarray(self.along_y @ modes.T @ self.along_x.T)

    def load_at(self, point_mm: Points2, modes: Float64[np.ndarray, "k l"]) -> Scalars:
        """The load times the pitch at points (n, 2) of the sheet."""
        return np.asarray(self._basis(point_mm) @ modes.ravel())

    def load_std(self, point_mm: Points2, std_mm: float) -> Scalars:
        """Standard deviation (n,) of `load_at` for displacements of std_mm along x and along y each."""
        basis = self._basis(point_mm)
        variance = ((basis @ self.spread) * basis).sum(axis=1)
        return np.asarray(np.sqrt(variance) * std_mm / self.pitch_mm)

    def centre_covariance(
        self, point_mm: Points2, std_mm: float, modes: Float64[np.ndarray, "k l"]
    ) -> Float64[np.ndarray, "n 2 2"]:
        """Covariance in mm^2 of the places of maxima, from the noise of displacements.

        At a maximum grad q = 0, so noise moves it by -H^-1 grad dq with H the second derivatives of q.
        """
        slope = np.stack([self._basis(point_mm, 1, 0), self._basis(point_mm, 0, 1)], axis=1)
        noise = (slope @ self.spread) @ slope.transpose(0, 2, 1) * std_mm**2
        bend = np.empty((len(point_mm), 2, 2))
        for (a, b), orders in (((0, 0), (2, 0)), ((1, 1), (0, 2)), ((0, 1), (1, 1))):
            bend[:, a, b] = bend[:, b, a] = self._basis(point_mm, *orders) @ modes.ravel()
        # A flat top is no sharper than a hill two pitches wide.
        bend -= 0.25 * np.abs(self.load_at(point_mm, modes))[:, None, None] * np.eye(2)
        inverse = np.linalg.inv(bend)
        return np.asarray(inverse @ noise @ inverse)

    def _basis(self, point_mm: Points2, order_x: int = 0, order_y: int = 0) -> np.ndarray:
        place = point_mm / self.pitch_mm - self.low
        along_x = _cosines(place[:, 0], self.wave_x, order_x)
        along_y = _cosines(place[:, 1], self.wave_y, order_y)
        return np.asarray(
            (along_x[:, :, None] * along_y[:, None, :]).reshape(len(place), self.spread.shape[0])
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadModel:
    """What is assumed of sheet, fingers and view; all lengths in pitches.

    Attributes:
        margin: how far the sheet goes on beyond the outer markers.
        finest: shortest wavelength of the load, and of tangential loads.
        decay: length over which the sheet forgets a load.
        fingertip: radius over which a load is spread.
        tangential: size of tangential loads against normal ones.
        model_error: of a displacement; what the model does not explain.
        shift, angle_rad, tilt, zoom: usual size of the motion of the view: along the sheet, about its normal,
            of the camera's axis, and towards the sheet as part of the distance.
        points_per_pitch: of the map.
    """

    margin: float = 2.0
    finest: float = 4.0
    finest_tangential: float = 4.0
    decay: float = 4.0
    fingertip: float = 0.8
    tangential: float = 1.0
    model_error: float = 0.1
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
        wave_x, wave_y = _waves(size, pitch, self.finest)
        square = (wave_x[:, None] ** 2 + wave_y**2).ravel()
        smooth = np.exp(-0.25 * self.fingertip**2 * square)
        scale = smooth / (square + self.decay**-2)
        place = rest - low
        depth, slope_x, slope_y = (
            (
                _cosines(place[:, 0], wave_x, a)[:, :, None] * _cosines(place[:, 1], wave_y, b)[:, None, :]
            ).reshape(len(rest), -1)
            for a, b in ((0, 0), (1, 0), (0, 1))
        )
        normal = np.concatenate([arm[:, :1] * depth - lever * slope_x, arm[:, 1:] * depth - lever * slope_y])
        normal *= scale
        covariance = normal @ normal.T + self._view(rest, arm, -float(eye[2]))
        tangential = self._tangential(place, size, pitch)
        covariance[: len(rest), : len(rest)] += tangential
        covariance[len(rest) :, len(rest) :] += tangential
        covariance[np.diag_indices_from(covariance)] += self.model_error**2
        mode_from_shift = smooth[:, None] * np.linalg.solve(covariance, normal).T
        mode_from_shift *= smooth[:, None]
        spread = mode_from_shift @ mode_from_shift.T
        x_mm, y_mm = (self._axis(rest_mm[:, k], sensor.layout.pitch_mm[k]) for k in range(2))
        return LoadMap(
            x_mm=read_only(x_mm),
            y_mm=read_only(y_mm),
            mode_from_shift=read_only(mode_from_shift.astype(np.float32)),
            spread=read_only(spread),
            low=read_only(low),
            wave_x=read_only(wave_x),
            wave_y=read_only(wave_y),
            along_x=read_only(_cosines(x_mm / pitch_mm - low[0], wave_x, 0)),
            along_y=read_only(_cosines(y_mm / pitch_mm - low[1], wave_y, 0)),
            pitch_mm=pitch_mm,
        )

    def _tangential(self, place: Points2, size: np.ndarray, pitch: np.ndarray) -> np.ndarray:
        """(m, m) covariance of what tangential loads do, along x and along y alike."""
        wave_x, wave_y = _waves(size, pitch, self.finest_tangential)
        square = (wave_x[:, None] ** 2 + wave_y**2).ravel()
        scale = self.tangential * np.exp(-0.25 * self.fingertip**2 * square) / (square + self.decay**-2)
        along = _cosines(place[:, 0], wave_x, 0)[:, :, None] * _cosines(place[:, 1], wave_y, 0)[:, None, :]
        moved = along.reshape(len(place), -1) * scale
        return np.asarray(moved @ moved.T)

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


def _waves(size: np.ndarray, pitch: np.ndarray, finest: float) -> tuple[np.ndarray, np.ndarray]:
    """Wave numbers along x and y of the cosines down to the finest wavelength, in pitches."""
    counts = np.ceil(2.0 * size / (finest * pitch)).astype(int) + 1
    return np.arange(counts[0]) * np.pi / size[0], np.arange(counts[1]) * np.pi / size[1]


def _cosines(place: np.ndarray, wave: np.ndarray, order: int) -> np.ndarray:
    """(n, k) cosines of norm 1 on the interval of which they are the free modes, or their derivatives."""
    size = np.pi / wave[1]
    norm = np.where(wave == 0.0, 1.0, np.sqrt(2.0)) / np.sqrt(size)
    return np.asarray(norm * wave**order * np.cos(place[:, None] * wave + 0.5 * np.pi * order))
