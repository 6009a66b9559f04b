"""The load that best explains how the markers moved.

Depth alone does not separate contacts: two fingers share one hollow, and the image of a press far from the
optical axis is displaced outward. A contact is where a force bends the sheet. The displacement u of the
markers in the plane of the sheet is therefore modelled as a sum of independent Gaussian processes (C. E.
Rasmussen, C. K. I. Williams 2006, chapter 2):

    u = r/d w - l grad w  +  s  +  motion of the view  +  noise,      -lap w + w/L^2 = q

with w the depth (perspective moves a marker at r from the foot of the optical axis by r w/d, bending moves
it by the lever l, half the thickness of the sheet, down the slope), q the load, white but for the size of a
fingertip, and s the same for tangential loads. All are series of cosines over the sheet and a margin, so the
best estimate of q is linear in u: a matrix that is computed once, times the displacements of a frame.
q times the pitch is a pure number, the angle in rad by which the slope of the sheet turns within one pitch.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from manytouch.estimation.load.cosine_series import (
    CosineSeries,
    best_linear_estimate,
    finest_affordable_wavelength,
    wave_numbers,
)
from manytouch.estimation.load.load_estimator import LoadEstimate
from manytouch.estimation.load.load_map import LoadMap, make_load_map
from manytouch.geometry.camera import cam_from_sheet
from manytouch.values import Sensor, TrackedGrid
from manytouch.values.arrays import Points2

_DERIVATIVE_ORDERS = ((1, 0), (0, 1))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _View:
    """The markers and the camera, in units of the pitch.

    Attributes:
        rest: (m, 2) markers in the plane of the sheet.
        slope: (m, 2) tangent of the angle between their rays and the optical axis, along x and y.
        distance: of the camera from the sheet.
        lever: half the thickness of the sheet.
    """

    rest: Points2
    slope: Points2
    distance: float
    lever: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadModel:
    """Prior of sheet, fingers and view; all lengths in pitches.

    Attributes:
        margin: extent of the sheet beyond the outer markers.
        finest, finest_tangential: shortest wavelength of normal, tangential loads.
        decay: length L over which the effect of a load decays.
        fingertip: radius over which a load is spread.
        tangential: size of tangential loads relative to normal ones.
        model_error: standard deviation of a displacement that the model does not explain.
        shift, angle_rad, tilt, zoom: standard deviations of the motion of the view: along the sheet, about
            its normal, of the camera's axis, and towards the sheet relative to the distance.
        most_products: largest number of cosine products in each series. A sheet with more markers than about
            three times that gets coarser series, because the cost grows with the cube of their number.
        points_per_pitch: resolution of the map.
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
    most_products: int = 420
    points_per_pitch: float = 3.0

    def __call__(self, sensor: Sensor, rest_mm: Points2) -> LoadMap:
        """The map of the load times the pitch, from all x, then all y displacements in pitches.

        Args:
            sensor: with a layout.
            rest_mm: (m, 2) markers in the plane of the sheet.
        """
        assert sensor.layout is not None
        pitch_mm = float(np.sqrt(np.prod(sensor.layout.pitch_mm)))
        pitch = sensor.layout.pitch_mm / pitch_mm
        rest = rest_mm / pitch_mm
        rotation, translation = cam_from_sheet(sensor.camera)
        eye = -translation @ rotation / pitch_mm
        low = rest.min(axis=0) - self.margin * pitch
        size = rest.max(axis=0) + self.margin * pitch - low
        view = _View(
            rest=rest,
            slope=(rest - eye[:2]) / -eye[2],
            distance=-float(eye[2]),
            lever=0.0 if sensor.sheet is None else 0.5 * sensor.sheet.thickness_mm / pitch_mm,
        )
        finest = finest_affordable_wavelength(size, pitch, self.finest, self.most_products)
        wave = wave_numbers(size, pitch, finest)
        depth = self._depth_series(low, wave)
        finest = finest_affordable_wavelength(size, pitch, self.finest_tangential, self.most_products)
        tangential = self._depth_series(low, wave_numbers(size, pitch, finest))
        tangential = replace(tangential, scale=self.tangential * tangential.scale)
        smooth = np.exp(-0.25 * self.fingertip**2 * depth.square)
        estimate, spread = best_linear_estimate(
            lambda at: self._displacements(view, depth, tangential, at),
            np.full(len(rest), self.model_error),
            smooth,
        )
        return make_load_map(
            sensor.layout,
            rest_mm,
            low=low,
            wave=wave,
            estimate=estimate,
            spread=spread,
            points_per_pitch=self.points_per_pitch,
        )

    def _depth_series(self, low: np.ndarray, wave: tuple[np.ndarray, np.ndarray]) -> CosineSeries:
        """Depth under loads of variance 1 that are spread over fingertips."""
        white = CosineSeries(low=low, wave_x=wave[0], wave_y=wave[1], scale=np.ones(1))
        smooth = np.exp(-0.25 * self.fingertip**2 * white.square)
        return replace(white, scale=smooth / (white.square + self.decay**-2))

    def _displacements(
        self, view: _View, depth: CosineSeries, tangential: CosineSeries, at: slice
    ) -> np.ndarray:
        """(2, n, r) displacements of some markers along x and y for each coefficient of the model."""
        rest, slope = view.rest[at], view.slope[at]
        by_depth = [
            slope[:, k, None] * depth(rest) - view.lever * depth(rest, *_DERIVATIVE_ORDERS[k])
            for k in range(2)
        ]
        by_tangential = tangential(rest)
        zero = np.zeros_like(by_tangential)
        by_view = self._view_motions(rest, slope, view.distance)
        return np.stack(
            [
                np.concatenate([by_depth[0], by_tangential, zero, by_view[0]], axis=1),
                np.concatenate([by_depth[1], zero, by_tangential, by_view[1]], axis=1),
            ]
        )

    def _view_motions(self, rest: Points2, slope: Points2, distance: float) -> np.ndarray:
        """(2, n, 6) displacements of points (n, 2) along x and y for motions of the view of one deviation."""
        x, y = slope.T
        zero, one = np.zeros(len(rest)), np.ones(len(rest))
        size = [self.shift, self.shift, self.angle_rad]
        size += [distance * each for each in (self.zoom, self.tilt, self.tilt)]
        along_x = np.column_stack([one, zero, -rest[:, 1], x, x**2, x * y])
        along_y = np.column_stack([zero, one, rest[:, 0], y, x * y, y**2])
        return np.stack([along_x, along_y]) * size


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DisplacementLoad:
    """The load from the displacements of markers, for a known view and sheet.

    Attributes:
        model: of sheet, fingers and view.
    """

    model: LoadModel = field(default_factory=LoadModel)

    def start(self, sensor: Sensor, rest_mm: Points2) -> LoadMap:
        """The map; nothing else is kept between frames."""
        return self.model(sensor, rest_mm)

    def load_map(self, state: LoadMap) -> LoadMap:
        """The state itself."""
        return state

    def estimate_load(
        self, state: LoadMap, grid: TrackedGrid, displacement_mm: Points2, std_mm: float
    ) -> LoadEstimate:
        """The load of a frame; see `LoadEstimator`."""
        observed = np.empty((2, len(displacement_mm)), dtype=state.estimate.dtype)
        np.divide(displacement_mm.T, state.pitch_mm, out=observed, casting="same_kind")
        return LoadEstimate(
            load_map=state,
            coefficients=state.coefficients(observed.ravel()),
            variance=(std_mm / state.pitch_mm) ** 2,
            observed=np.zeros(0),
        )

    def refine(self, state: LoadMap, load: LoadEstimate, centre_mm: Points2) -> Points2:
        """The centres of the load peaks."""
        return centre_mm

    def update_rest(self, state: LoadMap, grid: TrackedGrid, frames: int) -> LoadMap:
        """The state, which does not depend on rest."""
        return state
