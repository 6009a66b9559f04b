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

from dataclasses import dataclass, replace

import numpy as np

from manytouch.estimation.perimeter.cosine_series import Series, affordable, best_estimate, waves
from manytouch.estimation.perimeter.load_map import LoadMap, chart
from manytouch.geometry.camera import cam_from_sheet
from manytouch.values import Sensor
from manytouch.values.arrays import Points2

_GRADIENT = ((1, 0), (0, 1))


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
        finest, finest_tangential: shortest wavelength of normal, tangential loads.
        decay: length over which the sheet forgets a load.
        fingertip: radius over which a load is spread.
        tangential: size of tangential loads against normal ones.
        model_error: of a displacement, what the model does not explain.
        shift, angle_rad, tilt, zoom: usual size of the motion of the view: along the sheet, about its normal,
            of the camera's axis, and towards the sheet as part of the distance.
        most_products: of cosines in each series: where a sheet has more markers than about three times
            that, the series of all loads are coarser, or the work would grow with the cube of the markers.
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
        scene = _Scene(
            rest=rest,
            arm=(rest - eye[:2]) / -eye[2],
            distance=-float(eye[2]),
            lever=0.0 if sensor.sheet is None else 0.5 * sensor.sheet.thickness_mm / pitch_mm,
        )
        wave = waves(size, pitch, affordable(size, pitch, self.finest, self.most_products))
        depth = self._hollows(low, wave)
        finest = affordable(size, pitch, self.finest_tangential, self.most_products)
        pull = self._hollows(low, waves(size, pitch, finest))
        pull = replace(pull, scale=self.tangential * pull.scale)
        smooth = np.exp(-0.25 * self.fingertip**2 * depth.square)
        estimate, spread = best_estimate(
            lambda at: self._shifts(scene, depth, pull, at), np.full(len(rest), self.model_error), smooth
        )
        return chart(
            sensor.layout,
            rest_mm,
            low=low,
            wave=wave,
            estimate=estimate,
            spread=spread,
            points_per_pitch=self.points_per_pitch,
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

    def _view(self, rest: Points2, arm: Points2, distance: float) -> np.ndarray:
        """(2, n, 6) what the view's motions of usual size do to places (n, 2), along x and along y."""
        x, y = arm.T
        none, one = np.zeros(len(rest)), np.ones(len(rest))
        size = [self.shift, self.shift, self.angle_rad]
        size += [distance * each for each in (self.zoom, self.tilt, self.tilt)]
        along_x = np.column_stack([one, none, -rest[:, 1], x, x**2, x * y])
        along_y = np.column_stack([none, one, rest[:, 0], y, x * y, y**2])
        return np.stack([along_x, along_y]) * size


def assumes_view(sensor: Sensor) -> bool:
    """Was the camera's field of view assumed, so that distances and slopes are known badly?"""
    return any("field of view" in sentence for sentence in sensor.assumptions)
