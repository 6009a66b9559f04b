"""The result of a calibration at rest, and its sensor with provenance."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.calibration.outline.clamp_line import ClampLine
from manytouch.calibration.rest.adapt_nominal import NOMINAL, NOMINAL_NAME, NOMINAL_SHAPE
from manytouch.values import Sensor
from manytouch.values.arrays import Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RestCalibration:
    """A sensor calibrated on its untouched sheet.

    Attributes:
        sensor: with pose and its deviations, layout, missing markers and noise; `rest_px` are the measured
            positions.
        residual_px: (m, 2) measured minus predicted markers of a flat sheet in this pose; NaN if missing.
        pose_std: (6,) deviations of the rotation vector (rad) and the translation (mm), also by the lens.
        noise_px: noise of a marker's centre (`geometry.centre_noise`), median of the markers.
        contrast: grey levels between markers and background.
        frames: number of frames used: those in which the markers are at rest.
        frames_given: number of frames given.
        first_and_last: numbers of the first and the last frame used.
        motion_px: largest motion of the markers in the frames used (`MarkerTracks.motion_px`).
        clamp: measured edge of the sheet.
        warnings: one sentence each.
    """

    sensor: Sensor
    residual_px: Points2
    pose_std: Float64[np.ndarray, "6"]
    noise_px: float
    contrast: float
    frames: int
    frames_given: int
    first_and_last: tuple[int, int]
    motion_px: float
    clamp: ClampLine
    warnings: tuple[str, ...]

    @property
    def rms_px(self) -> float:
        """Root mean square distance of markers from a flat sheet."""
        left = self.residual_px[np.isfinite(self.residual_px[:, 0])]
        return float(np.sqrt((left**2).sum(axis=1).mean()))


def with_provenance(calibration: RestCalibration, source_name: str) -> Sensor:
    """The calibrated sensor; its provenance names source and residuals.

    It is not nominal any more, and its name does not state so; only the shape of its sheet is still that of
    the nominal file.
    """
    sensor = calibration.sensor
    shape = {NOMINAL_SHAPE: True} if sensor.is_nominal else {}
    provenance = {
        **{name: value for name, value in sensor.provenance.items() if name != NOMINAL},
        **shape,
        "rest": f"calibrated from {calibration.frames} frames of {source_name}",
        "rest_rms_px": round(calibration.rms_px, 4),
        "rest_warnings": list(calibration.warnings),
    }
    return replace(sensor, name=sensor.name.removesuffix(NOMINAL_NAME), provenance=provenance)
