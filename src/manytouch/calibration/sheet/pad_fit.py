"""Young's modulus, thickness and depth of the markers of a pad, fitted to presses with known forces.

With wrong values of thickness or depth, shallow and deep, or narrow and wide, presses give different moduli.
The markers show them little: a wrong depth looks mostly like another shape of a contact. Each press is
estimated by `PadEstimator` with trial values of thickness and depth; Gauss-Newton steps reduce the residuals
that remain (variable projection: G. H. Golub and V. Pereyra 1973, doi:10.1137/0710036).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.calibration.sheet.fit import KnownPress
from manytouch.errors import SensorError
from manytouch.estimation import PadEstimator
from manytouch.estimation.pad.patch_fit import misfit_scale
from manytouch.geometry.refraction import rest_px
from manytouch.values import Contact, Sensor, Sheet, TrackedGrid
from manytouch.values.arrays import Points2
from manytouch.values.sensor_file.default_std import sheet_std

FORCE_STD = 0.05
"""Relative standard deviation of a force that the model does not explain, of each press: a choice, the median
error of forces on simulated pads with an exact sensor file."""
MODEL_STD = np.array([0.03, 0.01])
"""Standard deviations, in thicknesses, of thickness and depth by what the model does not explain: chosen by
the errors that are left on the seven pads of ADR 117."""
DIFFERENCE_STDS = 0.5
"""Step of the derivatives, in standard deviations of what the sensor file states."""
MOST_STEPS = 3
SMALL_STEP_STDS = 0.2
"""Step after which none follows."""
MOST_CHANGE_STDS = 3.0
"""Largest change of what the sensor file states."""
LEAST_DEPTH_MM = 0.01
"""Least depth of the markers below the contact face."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EstimatedPresses:
    """Presses estimated on a pad.

    Attributes:
        contacts: of the presses.
        force_over_E_mm2: (k,) their normal forces over E.
        residual_px: (k,) RMS residual of each press over its markers.
        whitened: (k, 2 m) residuals over their standard deviations by noise and model error.
        scale: (k,) misfit per degree of freedom, at least 1.
    """

    contacts: tuple[Contact, ...]
    force_over_E_mm2: Float64[np.ndarray, " k"]
    residual_px: Float64[np.ndarray, " k"]
    whitened: Float64[np.ndarray, "k r"]
    scale: Float64[np.ndarray, " k"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadParameters:
    """What presses show of a pad.

    Attributes:
        sheet: with the fitted thickness and depth of the markers, and their deviations.
        log_young: natural logarithm of Young's modulus, MPa.
        log_young_std: its deviation by the scatter of the forces and by thickness and depth.
        leave_one_out: (k,) logarithm of the force of each press predicted from all others, over its reading;
            NaN without reading.
        pressed: the presses on that pad.
    """

    sheet: Sheet
    log_young: float
    log_young_std: float
    leave_one_out: Float64[np.ndarray, " k"]
    pressed: EstimatedPresses


def press_pad(estimator: PadEstimator, sensor: Sensor, presses: Sequence[KnownPress]) -> EstimatedPresses:
    """Estimate presses, each from rest.

    Args:
        estimator: of the contacts.
        sensor: with layout and a bonded sheet.
        presses: any.

    Raises:
        SensorError: a press shows no contact.
    """
    assert sensor.layout is not None
    state, at_rest_px = estimator.start(sensor), rest_px(sensor, sensor.layout)
    contacts, residual_px, whitened, scale = [], [], [], []
    for press in presses:
        grid = _grid(press, at_rest_px)
        fit = estimator.fit_frame(state, grid)
        _, _, found = estimator.step(state, grid)
        if not found.touching:
            raise SensorError(
                f"{press.name} shows no contact: press harder, or check that its time and recording are right"
            )
        contacts.append(
            min(found.touching, key=lambda each: float(np.linalg.norm(each.centre_mm - press.place_mm)))
        )
        residual_px.append(float(np.sqrt(np.mean(fit.residual_px[np.repeat(press.is_seen, 2)] ** 2))))
        whitened.append(np.sqrt(fit.weight) * fit.residual_px)
        scale.append(misfit_scale(fit))
    return EstimatedPresses(
        contacts=tuple(contacts),
        force_over_E_mm2=np.array([contact.normal_force_over_E_mm2 for contact in contacts]),
        residual_px=np.array(residual_px),
        whitened=np.array(whitened),
        scale=np.array(scale),
    )


def fit_pad(estimator: PadEstimator, sensor: Sensor, presses: Sequence[KnownPress]) -> PadParameters:
    """Fit Young's modulus, and thickness and depth of the markers unless the sensor file states them exactly.

    The deviations of the file are those of the prior of thickness and depth; that of the modulus is not used.

    Args:
        estimator: of the contacts.
        sensor: with layout and a bonded sheet.
        presses: at least two with a force.

    Raises:
        SensorError: a press shows no contact.
    """
    sheet = sensor.sheet
    assert sheet is not None
    stds = sheet_std(sheet)
    stated_std_mm = np.array([stds.thickness_mm, stds.marker_depth_mm or 0.0])
    read_N = np.array([np.nan if press.force_N is None else press.force_N for press in presses], np.float64)
    known = np.flatnonzero(np.isfinite(read_N))

    def trial(change: Float64[np.ndarray, "2"], std_mm: Float64[np.ndarray, "2"]) -> "_Trial":
        tried = replace(sensor, sheet=_changed(sheet, change * stated_std_mm, std_mm))
        pressed = press_pad(estimator, tried, presses)
        log_young = np.log(read_N[known] / pressed.force_over_E_mm2[known])
        return _Trial(change=change, pressed=pressed, log_young=log_young)

    best, slope = _fitted(lambda tried: trial(tried, np.zeros(2)), np.flatnonzero(stated_std_mm))
    covariance = np.linalg.inv(slope.T @ slope)
    fitted_std_mm = np.sqrt(np.diag(covariance)[1:]) * best.scatter * stated_std_mm
    std_mm = np.minimum(stated_std_mm, np.hypot(fitted_std_mm, MODEL_STD * sheet.thickness_mm))
    # Trials keep thickness and depth as they are, else the estimator would fit them too. This one has the
    # deviations that are written: E belongs to the forces that follow from the new file.
    if std_mm.any():
        best = trial(best.change, std_mm)
    forces = slope[: len(known)]
    leverage = np.einsum("np,pq,nq->n", forces, covariance, forces)
    leave_one_out = np.full(len(presses), np.nan)
    leave_one_out[known] = -(best.log_young - best.log_young.mean()) / (1.0 - leverage)
    return PadParameters(
        sheet=_changed(sheet, best.change * stated_std_mm, std_mm),
        log_young=float(best.log_young.mean()),
        log_young_std=float(np.sqrt(covariance[0, 0])) * best.scatter,
        leave_one_out=leave_one_out,
        pressed=best.pressed,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Trial:
    """Presses with trial values.

    Attributes:
        change: (2,) of thickness and depth, in deviations of what the sensor file states.
        pressed: the presses.
        log_young: (n,) logarithm of Young's modulus by each press with a force.
    """

    change: Float64[np.ndarray, "2"]
    pressed: EstimatedPresses
    log_young: Float64[np.ndarray, " n"]

    @property
    def scatter(self) -> float:
        """Scatter of the moduli over the expected scatter, at least 1."""
        return max(1.0, float(self.log_young.std(ddof=1)) / FORCE_STD)

    def values(self, scale: Float64[np.ndarray, " k"], log_young: float = 0.0) -> Float64[np.ndarray, " r"]:
        """(n + k r + 2,) of forces, markers and prior, over their standard deviations.

        Errors of the model are alike in all presses: the markers of all count as those of one.

        Args:
            scale: (k,) misfit per degree of freedom of each press, the same for all trials.
            log_young: of which the forces are taken.
        """
        forces = (self.log_young - log_young) / FORCE_STD
        markers = self.pressed.whitened / np.sqrt(len(scale) * scale[:, None])
        return np.concatenate([forces, markers.ravel(), self.change])

    def residual(self, scale: Float64[np.ndarray, " k"]) -> Float64[np.ndarray, " r"]:
        """The residual with the modulus that fits best."""
        return self.values(scale, float(self.log_young.mean()))


def _fitted(
    trial: Callable[[np.ndarray], _Trial], fitted: np.ndarray
) -> tuple[_Trial, Float64[np.ndarray, "r 3"]]:
    """The best trial, and (n + k r + 2, 3) slopes of `values` by ln E, thickness and depth.

    Args:
        trial: the presses for a change.
        fitted: which of both are to be fitted.
    """
    best = trial(np.zeros(2))
    scale = best.pressed.scale
    slope = np.zeros((len(best.values(scale)), 3))
    slope[: len(best.log_young), 0], slope[-2:, 1:] = -1.0 / FORCE_STD, np.eye(2)
    for number in fitted:
        step = DIFFERENCE_STDS * np.eye(2)[number]
        slope[:, 1 + number] = (trial(step).values(scale) - best.values(scale)) / DIFFERENCE_STDS
    share = 1.0
    for _ in range(MOST_STEPS if len(fitted) > 0 else 0):
        step = -share * np.linalg.lstsq(slope, best.residual(scale))[0][1:]
        if np.abs(step).max() < SMALL_STEP_STDS:
            break
        tried = trial(np.clip(best.change + step, -MOST_CHANGE_STDS, MOST_CHANGE_STDS))
        if np.linalg.norm(tried.residual(scale)) < np.linalg.norm(best.residual(scale)):
            best = tried
        else:
            share *= 0.5
    return best, slope


def _changed(sheet: Sheet, change_mm: Float64[np.ndarray, "2"], std_mm: Float64[np.ndarray, "2"]) -> Sheet:
    """A pad with changed thickness and depth of the markers, and their deviations."""
    thickness_mm = sheet.thickness_mm + float(change_mm[0])
    if sheet.marker_depth_mm is None:
        return replace(sheet, thickness_mm=thickness_mm, thickness_std_mm=float(std_mm[0]))
    return replace(
        sheet,
        thickness_mm=thickness_mm,
        thickness_std_mm=float(std_mm[0]),
        marker_depth_mm=max(sheet.marker_depth_mm + float(change_mm[1]), LEAST_DEPTH_MM),
        marker_depth_std_mm=float(std_mm[1]),
    )


def _grid(press: KnownPress, at_rest_px: Points2) -> TrackedGrid:
    """The markers during a press."""
    seen = press.is_seen
    return TrackedGrid(
        position_px=np.where(seen[:, None], at_rest_px + press.displacement_px, np.nan),
        covariance_px2=np.where(seen[:, None, None], press.noise_px**2 * np.eye(2), np.nan),
        is_seen=seen,
        frames_unseen=np.where(seen, 0, 1).astype(np.int64),
    )
