"""Young's modulus, thickness and depth of the markers of a bonded pad from presses with known forces.

Each press is estimated as in use, by `PadEstimator`; its normal force over E and the reading of the scale
give E. What Poisson's ratio changes of the normal force is thus part of E: nearly the same for all presses.
Shear hardly depends on Poisson's ratio, so that weights on a tilted sensor show whether both forces have the
same E.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manytouch.calibration.sheet.calibrate import MAX_OFFSET_MM, SheetCalibration
from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.modulus_check import modulus_warnings, require_determined
from manytouch.calibration.sheet.pad_fit import fit_pad
from manytouch.errors import SensorError
from manytouch.estimation import PadEstimator
from manytouch.values import Contact, Sensor

LEAST_FORCES = 2
"""Fewest presses with a known force."""
MODEL_SHARE = 0.05
"""Relative standard deviation of a force that the model does not explain, common to all presses: a choice.
With it, E of the seven simulated pads of ADR 117 is 6 % (RMS) off, and within 1.8 of its deviations."""
SHEAR_SHARE = 0.05
"""`MODEL_SHARE` of a shear force: the same choice."""
MAX_ANGLE_RAD = 0.2
"""A shear force that points farther away from the weight gives a warning: a choice, 11 degrees. With a wrong
sign, or axes exchanged, a single tilt is 180 or 90 degrees away."""
LEAST_SHEAR = 0.1
"""Shear over the normal force from which a press gives the modulus of shear: a choice, a tilt of 6 degrees;
with less, errors of the tilt count for more."""


def calibrate_pad(sensor: Sensor, presses: Sequence[KnownPress]) -> SheetCalibration:
    """Fit Young's modulus, thickness and depth of the markers to presses.

    Args:
        sensor: with layout and a bonded sheet.
        presses: at least `LEAST_FORCES` with a force.

    Raises:
        SensorError: too few forces, a press that shows no contact, or forces that do not determine the
            modulus.
    """
    sheet, layout = sensor.sheet, sensor.layout
    if sheet is None or layout is None:
        raise SensorError(f"the sensor {sensor.name!r} has no [sheet] or no [markers]")
    if sum(press.force_N is not None for press in presses) < LEAST_FORCES:
        raise SensorError(
            f"a pad needs {LEAST_FORCES} presses or more with a force in N: "
            "add normal_force_N to the table of presses"
        )
    fit = fit_pad(PadEstimator(), sensor, presses)
    error = np.expm1(fit.leave_one_out)
    least = float(np.sqrt(np.nanmean(np.log1p(error) ** 2)))
    std = max(float(np.hypot(fit.log_young_std, MODEL_SHARE)), least)
    young_MPa, contacts = float(np.exp(fit.log_young)), fit.pressed.contacts
    require_determined(presses, young_MPa, std * young_MPa, error)
    poisson = PadEstimator().nominal_pad.poisson if sheet.poisson is None else sheet.poisson
    deviations = {
        "young_std_MPa": std * young_MPa,
        "thickness_std_mm": fit.sheet.thickness_std_mm,
        "marker_depth_std_mm": fit.sheet.marker_depth_std_mm,
    }
    return SheetCalibration(
        sheet=replace(fit.sheet, young_MPa=young_MPa, young_std_MPa=std * young_MPa, poisson=poisson),
        std={name: value for name, value in deviations.items() if value},
        undetermined=(),
        warnings=(
            *_warnings(presses, contacts),
            *_shear_warnings(presses, contacts, young_MPa, std),
            *modulus_warnings(sheet, young_MPa, std * young_MPa, error),
        ),
        force_over_E_mm2=fit.pressed.force_over_E_mm2,
        residual_px=fit.pressed.residual_px,
        leave_one_out_error=error,
    )


def _warnings(presses: Sequence[KnownPress], found: Sequence[Contact]) -> list[str]:
    sentences = []
    for press, contact in zip(presses, found, strict=True):
        away_mm = float(np.linalg.norm(contact.centre_mm - press.place_mm))
        if away_mm > MAX_OFFSET_MM:
            sentences.append(f"{press.name}: the force acts {away_mm:.1f} mm from the stated place")
    return sentences


def _shear_warnings(
    presses: Sequence[KnownPress], found: Sequence[Contact], young_MPa: float, std: float
) -> list[str]:
    """Where shear has another direction or gives another modulus than the normal forces."""
    sentences, log_ratio = [], []
    for press, contact in zip(presses, found, strict=True):
        if press.shear_N is None or press.force_N is None:
            continue
        known_N, shear_mm2 = press.shear_N, np.array(contact.shear_over_E_mm2)
        amount_N = float(np.linalg.norm(known_N))
        if amount_N < LEAST_SHEAR * press.force_N:
            continue
        cross = float(known_N[0] * shear_mm2[1] - known_N[1] * shear_mm2[0])
        away_rad = abs(float(np.arctan2(cross, known_N @ shear_mm2)))
        if away_rad > MAX_ANGLE_RAD:
            sentences.append(
                f"{press.name}: the shear points {np.rad2deg(away_rad):.0f} degrees away from that of the "
                "weight: check tilt_x_deg and tilt_y_deg"
            )
            continue
        log_ratio.append(np.log(amount_N / np.linalg.norm(shear_mm2) / young_MPa))
    ratio = float(np.exp(np.mean(log_ratio))) if log_ratio else 1.0
    if abs(np.log(ratio)) > 2.0 * np.hypot(std, SHEAR_SHARE):
        sentences.append(
            f"the shear forces give E = {ratio * young_MPa:.3g} MPa, the normal forces {young_MPa:.3g} MPa: "
            "Poisson's ratio or the thickness differs from [sheet], and shear forces are wrong by as much"
        )
    return sentences
