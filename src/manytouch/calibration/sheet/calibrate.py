"""Pretension, bending factor, thickness and stiffness of a sheet from presses at known places.

Each press is a smooth patch of load on the shell of `mechanics`. What the dots outside it show decides
the shape, hence pretension over E, bending factor, thickness and the force over E of every press; readings
of a force scale decide E. All unknowns are fitted together by Gauss-Newton steps with exact
sensitivities. Deviations are those of the normal matrix, of leaving one press out at a time (jackknife)
and of what the shell was seen to differ from a solid, together.

On a sheet that hardly stretches, pretension, bending and E can grow together without a change of any
force: forces are then known much better than each of the three (docs/derivations/calibration.md).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.calibration.sheet.fit import Guess, Press, PressFit, Told
from manytouch.errors import SensorError
from manytouch.values import Sensor, Sheet

LEAST_PRESSES = 4
MODEL_THICKNESS = 0.04
"""The shell's thickness that explains a solid sheet differs from the sheet's own by about this share."""
MODEL_STRAIN = 0.002
"""And its pretension by about this strain: both seen on presses of 3-D finite elements."""
ASIDE_MM = 2.0
"""A press that bears farther than this from its place is worth a word,"""
MISFIT, MISFIT_PX = 3.0, 0.15
"""and one that leaves so many times what is usual, and at least so much."""
PARAMETERS = ("pretension_over_E_mm", "bending_factor", "thickness_mm")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetCalibration:
    """A sheet with what presses tell of it.

    Attributes:
        sheet: calibrated; its stiffness is that of the sensor file where no force was read.
        std: deviation of each of `PARAMETERS`, of pretension_N_per_mm, and of young_MPa where it was fitted.
        not_told: sentences about parameters that the presses cannot tell from what was assumed.
        odd: sentences about presses that are not what the table says.
        force_over_E_mm2: (k,) of the presses.
        residual_px: (k,) root mean square of what is left of each press, dots outside the contact.
        left_out: (k,) force that the others predict over the reading, minus 1; NaN without reading.
    """

    sheet: Sheet
    std: dict[str, float]
    not_told: tuple[str, ...]
    odd: tuple[str, ...]
    force_over_E_mm2: Float64[np.ndarray, " k"]
    residual_px: Float64[np.ndarray, " k"]
    left_out: Float64[np.ndarray, " k"]


def calibrate_sheet(sensor: Sensor, presses: Sequence[Press]) -> SheetCalibration:
    """Fit a sheet to presses.

    Args:
        sensor: with layout and sheet; the sheet's values are where the fit starts and what it prefers.
        presses: at least `LEAST_PRESSES`, at different places and depths.

    Raises:
        SensorError: no sheet or markers, too few presses, or presses that tell nothing.
    """
    sheet = sensor.sheet
    if sheet is None or sensor.layout is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no [sheet] or no [markers]: write size_mm and thickness_mm of "
            "the sheet into its file first"
        )
    if len(presses) < LEAST_PRESSES:
        raise SensorError(
            f"{len(presses)} presses are too few to tell pretension and stiffness apart: give at least "
            f"{LEAST_PRESSES}, better 8, at different places and from light to deep"
        )
    weak = [press.name for press in presses if _reach(press) < 3.0]
    if weak:
        raise SensorError(
            f"these presses hardly move a marker: {', '.join(weak)}; press harder, or check that their "
            "time and recording are right"
        )
    fit = PressFit.start(sensor, presses)
    best, told = fit.run()
    return _read(sensor, presses, fit, best, told)


def _read(
    sensor: Sensor, presses: Sequence[Press], fit: PressFit, best: Guess, told: tuple[Told, ...]
) -> SheetCalibration:
    """The result, with deviations of the normal matrix and of the jackknife (one step without each press)."""
    sheet = sensor.sheet
    assert sheet is not None
    count = len(presses)
    has_force = [press.force_N is not None for press in presses]
    young = float(np.exp(best.common[3])) if any(has_force) else sheet.young_MPa
    spread = np.array([fit.step(best, told, left_out=number)[:4] for number in range(count)])
    normal, _ = fit.normal(best, told)
    jackknife = (count - 1) / count * ((spread - spread.mean(axis=0)) ** 2).sum(axis=0)
    thickness = float(np.exp(best.common[2]))
    model = np.array([MODEL_STRAIN * thickness, 0.0, MODEL_THICKNESS, 0.0])
    std = np.sqrt(jackknife + np.diag(np.linalg.inv(normal))[:4] + model**2)
    bending = float(np.exp(best.common[1]))
    deviations = {
        "pretension_over_E_mm": float(std[0]),
        "bending_factor": bending * float(std[1]),
        "thickness_mm": thickness * float(std[2]),
    }
    if young is not None:
        deviations["pretension_N_per_mm"] = young * float(std[0])
    if any(has_force) and young is not None:
        deviations["young_MPa"] = young * float(std[3])
    residual_px = np.array([fit.left_px(best, number) for number in range(count)])
    left_out = np.full(count, np.nan)
    for number in [number for number in range(count) if has_force[number] and sum(has_force) > 1]:
        left_out[number] = np.exp(fit.off_without(best, told, number, spread[number])) - 1.0
    calibrated = replace(
        sheet,
        thickness_mm=thickness,
        bending_factor=bending,
        young_MPa=young,
        young_std_MPa=deviations.get("young_MPa", sheet.young_std_MPa),
        poisson=fit.poisson,
        pretension_N_per_mm=None if young is None else float(best.common[0]) * young,
    )
    return SheetCalibration(
        sheet=calibrated,
        std=deviations,
        not_told=tuple(_not_told(fit, std, any_force=any(has_force))),
        odd=tuple(_odd(presses, best.single[:, 1:], residual_px)),
        force_over_E_mm2=np.exp(best.single[:, 0]),
        residual_px=residual_px,
        left_out=left_out,
    )


def _not_told(fit: PressFit, std: np.ndarray, *, any_force: bool) -> list[str]:
    found = []
    for place, name in enumerate(PARAMETERS):
        if std[place] > 0.7 * fit.doubt[place]:
            found.append(
                f"the presses do not tell {name} better than it was assumed: add deeper ones, and with a "
                "ball some nearer to the clamp"
            )
    if not any_force:
        found.append("no force was read, so stiffness is as in the sensor file: give at least one force in N")
    return found


def _odd(presses: Sequence[Press], aside_mm: np.ndarray, residual_px: np.ndarray) -> Iterator[str]:
    off_mm = np.linalg.norm(aside_mm, axis=1)
    aside = np.flatnonzero(off_mm > ASIDE_MM)
    if len(aside):
        names = ", ".join(presses[number].name for number in aside.tolist())
        yield (
            f"{names}: the foot bore up to {off_mm.max():.1f} mm off its named place; a flat foot near the "
            "clamp rests on its edge, since the sheet slopes there: press nearer to the middle, or with "
            "a ball, or correct the place"
        )
    usual_px = float(np.median(residual_px))
    for press, left_px in zip(presses, residual_px, strict=True):
        if left_px > max(MISFIT * usual_px, MISFIT_PX):
            yield (
                f"{press.name} fits badly: {left_px:.2f} px are left over, {usual_px:.2f} px is usual here; "
                "was it held at that time, by one foot of the named radius?"
            )


def _reach(press: Press) -> float:
    """Largest displacement of a marker in deviations."""
    moved = np.linalg.norm(np.where(press.is_seen[:, None], press.displacement_px, 0.0), axis=1)
    return float(moved.max()) / press.noise_px
