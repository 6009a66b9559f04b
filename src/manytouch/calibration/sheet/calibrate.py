"""Pretension, thickness, stiffness and clamp of a sheet from presses at known places.

Each press is a smooth patch of load on the shell of `mechanics`. The dots outside the patch determine the
shape, hence pretension over E, thickness, the place of the clamp and the force over E of every press;
readings of a force scale determine E. The bending factor of a homogeneous sheet is 1 and hardly changes. All
unknowns are fitted together by Gauss-Newton steps with exact sensitivities. Deviations combine the normal
matrix, a jackknife over the presses and the known difference between shell and solid.

On a sheet that hardly stretches, pretension, bending and E can be scaled together without a change of any
force: forces are then determined much better than each of the three (docs/derivations/calibration.md).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.calibration.sheet.fit import (
    BENDING,
    COMMON,
    OUTLINE,
    TENSION,
    THICKNESS,
    YOUNG,
    FitParameters,
    KnownPress,
    PressFit,
    PressLinearisation,
)
from manytouch.calibration.sheet.modulus_check import modulus_warnings, require_determined
from manytouch.errors import SensorError
from manytouch.values import Sensor, Sheet
from manytouch.values.arrays import read_only

LEAST_PRESSES = 4
"""Fewest presses of a clamped sheet; a force is needed for none of them."""
MODEL_THICKNESS = 0.04
"""Relative difference between the fitted shell thickness and that of a solid sheet, on 3-D finite
elements."""
MODEL_STRAIN = 0.002
"""Difference between fitted and true pretension as a strain, on the same presses."""
MAX_OFFSET_MM = 2.0
"""A press whose centre of force lies farther than this from its stated place gives a warning."""
MISFIT_RATIO = 3.0
"""A press whose RMS residual is larger than this many times the median, and than `MISFIT_PX`, gives a
warning."""
MISFIT_PX = 0.15
"""RMS residual below which a press gives no warning; several times the noise of a marker."""
TO_DETERMINE = {TENSION: "pretension_over_E_mm", THICKNESS: "thickness_mm"}
"""Common unknowns that presses are to determine; the bending factor of a homogeneous sheet is known."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetCalibration:
    """A sheet calibrated by presses.

    Attributes:
        sheet: calibrated, its outline that of the clamp that the presses show; E is that of the sensor file
            if no force was measured. Poisson's ratio is stated also if it was assumed, since the fitted
            numbers hold with it only.
        std: standard deviations by name: pretension_over_E_std_mm, bending_factor_std, thickness_std_mm,
            outline_std_mm, pretension_std_N_per_mm, young_std_MPa, and marker_depth_std_mm of a pad; without
            those of parameters that were not fitted.
        undetermined: sentences about parameters that the presses determine no better than the prior.
        warnings: sentences about presses that contradict the table.
        force_over_E_mm2: (k,) of the presses.
        residual_px: (k,) RMS residual of each press over the dots outside the contact; of a pad over all
            that are seen.
        leave_one_out_error: (k,) force of each press predicted from the calibration on all other presses,
            over its reading, minus 1; NaN without reading.
    """

    sheet: Sheet
    std: dict[str, float]
    undetermined: tuple[str, ...]
    warnings: tuple[str, ...]
    force_over_E_mm2: Float64[np.ndarray, " k"]
    residual_px: Float64[np.ndarray, " k"]
    leave_one_out_error: Float64[np.ndarray, " k"]


def calibrate_sheet(sensor: Sensor, presses: Sequence[KnownPress]) -> SheetCalibration:
    """Fit a sheet to presses.

    Args:
        sensor: with layout and sheet, whose values are start and prior of the fit.
        presses: at least `LEAST_PRESSES`, at different places and depths.

    Raises:
        SensorError: no sheet or markers, too few presses, presses that hardly move a marker, or forces that
            determine neither the modulus nor each other.
    """
    sheet = sensor.sheet
    if sheet is None or sensor.layout is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no [sheet] or no [markers]: write size_mm and thickness_mm of "
            "the sheet into its file first"
        )
    if len(presses) < LEAST_PRESSES:
        given = "1 press is" if len(presses) == 1 else f"{len(presses)} presses are"
        raise SensorError(
            f"{given} too few to separate pretension and stiffness: give at least "
            f"{LEAST_PRESSES}, better 8, at different places, from shallow to deep"
        )
    weak = [press.name for press in presses if _largest_displacement(press) < 3.0]
    if weak:
        raise SensorError(
            f"these presses hardly move a marker: {', '.join(weak)}; press harder, or check that their "
            "time and recording are right"
        )
    fit = PressFit.start(sensor, presses)
    best, linear = fit.run()
    return _result(sensor, presses, fit, best, linear)


def _result(
    sensor: Sensor,
    presses: Sequence[KnownPress],
    fit: PressFit,
    best: FitParameters,
    linear: tuple[PressLinearisation, ...],
) -> SheetCalibration:
    """The calibration, with deviations from the normal matrix and the jackknife (one step without each
    press)."""
    sheet = sensor.sheet
    assert sheet is not None
    count = len(presses)
    has_force = [press.force_N is not None for press in presses]
    young = float(np.exp(best.common[YOUNG])) if any(has_force) else sheet.young_MPa
    spread = np.array([fit.step(best, linear, left_out=number)[:COMMON] for number in range(count)])
    normal, _ = fit.normal(best, linear)
    jackknife = (count - 1) / count * ((spread - spread.mean(axis=0)) ** 2).sum(axis=0)
    thickness = float(np.exp(best.common[THICKNESS]))
    model = np.zeros(COMMON)
    model[[TENSION, THICKNESS]] = MODEL_STRAIN * thickness, MODEL_THICKNESS
    std = np.sqrt(jackknife + np.diag(np.linalg.inv(normal))[:COMMON] + model**2)
    bending, outline_mm = float(np.exp(best.common[BENDING])), float(best.common[OUTLINE])
    deviations = {
        "pretension_over_E_std_mm": float(std[TENSION]),
        "bending_factor_std": bending * float(std[BENDING]),
        "thickness_std_mm": thickness * float(std[THICKNESS]),
        "outline_std_mm": float(std[OUTLINE]),
    }
    if young is not None:
        deviations["pretension_std_N_per_mm"] = young * float(std[TENSION])
    residual_px = np.array([fit.residual_rms_px(best, number) for number in range(count)])
    error = np.full(count, np.nan)
    for number in [number for number in range(count) if has_force[number] and sum(has_force) > 1]:
        error[number] = np.exp(fit.leave_one_out_error(best, linear, number, spread[number])) - 1.0
    if any(has_force) and young is not None:
        predicted = np.log1p(error[np.isfinite(error)])
        least = float(np.sqrt(np.mean(predicted**2))) if len(predicted) else 0.0
        deviations["young_std_MPa"] = young * max(float(std[YOUNG]), least)
        require_determined(presses, young, deviations["young_std_MPa"], error)
    calibrated = replace(
        sheet,
        size_mm=read_only(sheet.size_mm + 2.0 * outline_mm),
        outline_std_mm=deviations["outline_std_mm"],
        thickness_mm=thickness,
        thickness_std_mm=deviations["thickness_std_mm"],
        bending_factor=bending,
        bending_factor_std=deviations["bending_factor_std"],
        young_MPa=young,
        young_std_MPa=deviations.get("young_std_MPa", sheet.young_std_MPa),
        poisson=fit.poisson,
        pretension_N_per_mm=None if young is None else float(best.common[TENSION]) * young,
        pretension_std_N_per_mm=deviations.get("pretension_std_N_per_mm"),
    )
    return SheetCalibration(
        sheet=calibrated,
        std=deviations,
        undetermined=tuple(_undetermined(fit, std, any_force=any(has_force))),
        warnings=(
            *_warnings(presses, best.single[:, 1:], residual_px),
            *modulus_warnings(sheet, young, deviations.get("young_std_MPa"), error),
        ),
        force_over_E_mm2=np.exp(best.single[:, 0]),
        residual_px=residual_px,
        leave_one_out_error=error,
    )


def _undetermined(fit: PressFit, std: np.ndarray, *, any_force: bool) -> list[str]:
    found = []
    for place, name in TO_DETERMINE.items():
        if std[place] > 0.7 * fit.prior_std[place]:
            found.append(
                f"the presses do not determine {name} better than the prior: add deeper ones, and, with a "
                "ball, some nearer to the clamp"
            )
    if not any_force:
        found.append("no force was measured, so E is that of the sensor file: give at least one force in N")
    return found


def _warnings(presses: Sequence[KnownPress], offset_mm: np.ndarray, residual_px: np.ndarray) -> Iterator[str]:
    distance_mm = np.linalg.norm(offset_mm, axis=1)
    displaced = np.flatnonzero(distance_mm > MAX_OFFSET_MM)
    if len(displaced):
        names = ", ".join(presses[number].name for number in displaced.tolist())
        yield (
            f"{names}: the force acts up to {distance_mm.max():.1f} mm from the stated place; a flat foot "
            "near the clamp presses with its edge, since the sheet slopes there: press nearer to the centre, "
            "or with a ball, or correct the place"
        )
    usual_px = float(np.median(residual_px))
    for press, rms_px in zip(presses, residual_px, strict=True):
        if rms_px > max(MISFIT_RATIO * usual_px, MISFIT_PX):
            yield (
                f"{press.name} fits badly: its residual is {rms_px:.2f} px, the median of all presses "
                f"{usual_px:.2f} px: check that it was held at that time, by one foot of the stated radius"
            )


def _largest_displacement(press: KnownPress) -> float:
    """Largest displacement of a marker in deviations."""
    moved = np.linalg.norm(np.where(press.is_seen[:, None], press.displacement_px, 0.0), axis=1)
    return float(moved.max()) / press.noise_px
