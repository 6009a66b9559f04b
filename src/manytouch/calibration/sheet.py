"""Pretension, bending factor, thickness and stiffness of a sheet from presses at known places.

Each press is a smooth patch of load on the shell of `mechanics`. What the dots outside it show decides
the shape, hence pretension over E, bending factor, thickness and the force over E of every press; readings
of a force scale decide E. All unknowns are fitted together by Gauss-Newton steps with exact
sensitivities. Deviations are those of the normal matrix and those of leaving one press out at a time
(jackknife) together, so that some of what the shell does not explain is in them.

On a sheet that hardly stretches, pretension, bending and E can grow together without a change of any
force: forces are then known much better than each of the three (docs/derivations/calibration.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64

from manytouch.errors import SensorError
from manytouch.mechanics.dots import Dots
from manytouch.mechanics.equilibrium import equilibrium, tangent_factor
from manytouch.mechanics.patch import SplinePatch
from manytouch.mechanics.shell import Shell
from manytouch.values import Sensor, Sheet
from manytouch.values.arrays import Points2

LEAST_PRESSES = 4
PARAMETERS = ("pretension_over_E_mm", "bending_factor", "thickness_mm")
ASSUMED_POISSON = 0.45
THICKNESS_DOUBT = 0.15
"""The thickness of the sensor file is right within this share (one deviation)."""
BENDING_DOUBT = 0.1
PRETENSION_DOUBT = 0.05
"""Strain of the mounted sheet that would not surprise."""
STIFFNESS_DOUBT = 0.3
"""A stiffness in the sensor file is nominal: right within this share."""
PLACE_DOUBT_MM = 0.3
FORCE_DOUBT = 0.03
"""What a force reading and the shell may differ by, beside the reading's own deviation."""
MODEL_PX = 0.05
"""What the shell leaves of a dot's place under a press."""
_CLEAR = 1.3
_STEPS = 25
_FIRST_LOOKS = 20
_NEAR_ENOUGH = 0.2
_CONVERGED = 1e-3
_LEAST_FORCE_MM2 = 1e-4


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Press:
    """A press that is held, as the markers show it.

    Attributes:
        name: for messages.
        place_mm: (2,) where its middle is on the undeformed sheet.
        radius_mm: of the area that touches.
        displacement_px: (m, 2) of the markers from rest.
        is_seen: (m,).
        noise_px: deviation of a displacement.
        force_N: reading of a scale, positive; None when there is none.
    """

    name: str
    place_mm: Float64[np.ndarray, "2"]
    radius_mm: float
    displacement_px: Points2
    is_seen: Bool[np.ndarray, " m"]
    noise_px: float
    force_N: float | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetCalibration:
    """A sheet with what presses tell of it.

    Attributes:
        sheet: calibrated; its stiffness is that of the sensor file where no force was read.
        std: deviation of each of `PARAMETERS`, of pretension_N_per_mm, and of young_MPa where it was fitted.
        not_told: sentences about parameters that the presses cannot tell from what was assumed.
        force_over_E_mm2: (k,) of the presses.
        residual_px: (k,) root mean square of what is left of each press, dots outside the contact.
        left_out: (k,) force that the others predict over the reading, minus 1; NaN without reading.
    """

    sheet: Sheet
    std: dict[str, float]
    not_told: tuple[str, ...]
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
    fit = _Fit.start(sensor, presses)
    best, told = fit.run()
    return _read(sensor, presses, fit, best, told)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Guess:
    """Values of all unknowns: logarithms where they must be positive.

    Attributes:
        common: pretension over E (mm), ln bending factor, ln thickness, ln E (unused without readings).
        single: (k, 3) ln force over E, and where the press is off its place, x and y.
        shape_mm: (k, n, 3) of the shell under each press.
    """

    common: Float64[np.ndarray, "4"]
    single: Float64[np.ndarray, "k 3"]
    shape_mm: Float64[np.ndarray, "k n 3"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Told:
    """What a press tells.

    Attributes:
        residual: (2 m,) predicted minus seen, in deviations.
        derivative: (2 m, 7) by the common values and by its own.
    """

    residual: Float64[np.ndarray, " n"]
    derivative: Float64[np.ndarray, "n 7"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Fit:
    """The problem that stays the same while unknowns change."""

    sensor: Sensor
    presses: tuple[Press, ...]
    patch: SplinePatch
    poisson: float
    prior: Float64[np.ndarray, "4"]
    doubt: Float64[np.ndarray, "4"]
    first: _Guess

    @staticmethod
    def start(sensor: Sensor, presses: Sequence[Press]) -> "_Fit":
        sheet, layout = sensor.sheet, sensor.layout
        assert sheet is not None and layout is not None  # noqa: PT018 - checked before
        size = (float(sheet.size_mm[0]), float(sheet.size_mm[1]))
        elements = tuple(
            max(6, round(side / max(pitch, side / 30)))
            for side, pitch in zip(size, layout.pitch_mm.tolist(), strict=True)
        )
        patch = SplinePatch(size_mm=size, elements=(elements[0], elements[1]), boundary="clamped")
        young = sheet.young_MPa or 1.0
        prior = np.array(
            [
                (sheet.pretension_N_per_mm or 0.0) / young,
                np.log(sheet.bending_factor or 1.0),
                np.log(sheet.thickness_mm),
                np.log(young),
            ]
        )
        doubt = np.array([PRETENSION_DOUBT * sheet.thickness_mm, BENDING_DOUBT, THICKNESS_DOUBT, np.inf])
        if sheet.young_MPa is not None:
            doubt[3] = STIFFNESS_DOUBT
        single = np.zeros((len(presses), 3))
        unit = float(np.sqrt(np.prod(layout.pitch_mm))) * sheet.thickness_mm
        single[:, 0] = np.log(0.01 * unit)
        return _Fit(
            sensor=sensor,
            presses=tuple(presses),
            patch=patch,
            poisson=sheet.poisson if sheet.poisson is not None else ASSUMED_POISSON,
            prior=prior,
            doubt=doubt,
            first=_Guess(
                common=prior.copy(), single=single, shape_mm=np.zeros((len(presses), patch.node_count, 3))
            ),
        )

    def run(self) -> tuple[_Guess, tuple[_Told, ...]]:
        """Gauss-Newton steps; the best values, and what each press tells there."""
        guess = self._loaded(self.first)
        for _ in range(_STEPS):
            told = tuple(self._told(guess, number) for number in range(len(self.presses)))
            change = self.step(guess, told)
            change *= min(1.0, 0.7 / float(np.abs(change[1:]).max()))
            guess = self._moved(guess, change)
            if np.abs(change).max() < _CONVERGED:
                break
        return guess, tuple(self._told(guess, number) for number in range(len(self.presses)))

    def step(self, guess: _Guess, told: Sequence[_Told], left_out: int | None = None) -> np.ndarray:
        """(4 + 3 k,) the next Gauss-Newton step, with all presses or without one."""
        normal, slope = self.normal(guess, told, left_out)
        return -np.linalg.solve(normal, slope)

    def _loaded(self, guess: _Guess) -> _Guess:
        """Forces from a first look: each press grows until the dots move as far as they do."""
        shell, dots = self.model(guess.common)
        single, shapes = guess.single.copy(), guess.shape_mm.copy()
        for number, press in enumerate(self.presses):
            wanted, shape = _size(press, press.displacement_px), shapes[number]
            for _ in range(_FIRST_LOOKS):
                load = np.exp(single[number, 0]) * self._share(press, single[number], shape)
                shape = equilibrium(shell, load, start_mm=shape, tolerance=1e-4).coefficient_mm
                short = float(np.log(wanted / max(_size(press, dots.displacement_px(shape)), 1e-9)))
                if abs(short) < _NEAR_ENOUGH:
                    break
                single[number, 0] += float(np.clip(short, -1.0, 1.0))
            shapes[number] = shape
        return replace(guess, single=single, shape_mm=shapes)

    def model(self, common: Float64[np.ndarray, "4"]) -> tuple[Shell, Dots]:
        """Shell and dots at some values."""
        layout = self.sensor.layout
        assert layout is not None
        shell = Shell(
            patch=self.patch,
            thickness_mm=float(np.exp(common[2])),
            poisson=self.poisson,
            pretension_over_E_mm=float(common[0]),
            bending_factor=float(np.exp(common[1])),
        )
        dots = Dots(
            shell=shell,
            camera=self.sensor.camera,
            rest_mm=layout.rest_mm,
            radius_mm=layout.radius_mm,
            height_mm=layout.height_mm,
        )
        return shell, dots

    def _share(self, press: Press, single: Float64[np.ndarray, "3"], shape_mm: np.ndarray) -> np.ndarray:
        """(n, 3) nodal load of unit force, normal to the sheet as it is bent, per unit of its z part."""
        place, weight = _disc(press.place_mm + single[1:], press.radius_mm)
        basis = self.patch.at(place)
        w_mm = shape_mm[basis.node, 2]
        slope = np.column_stack([(basis.dx * w_mm).sum(axis=1), (basis.dy * w_mm).sum(axis=1)])
        push = np.column_stack([slope, -np.ones(len(place))])
        return np.column_stack([self.patch.load(place, weight * part) for part in push.T])

    def normal(
        self, guess: _Guess, told: Sequence[_Told], left_out: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrix and slope of half the sum of squares; unknowns: common, then three per press."""
        count = 4 + 3 * len(self.presses)
        normal, slope = np.zeros((count, count)), np.zeros(count)
        normal[:4, :4] += np.diag(1.0 / self.doubt**2)
        slope[:4] += (guess.common - self.prior) / self.doubt**2
        has_force = False
        for number, (press, part) in enumerate(zip(self.presses, told, strict=True)):
            own = slice(4 + 3 * number, 7 + 3 * number)
            if number == left_out:
                normal[own, own] += np.eye(3)
                continue
            columns = np.r_[0:4, own]
            normal[np.ix_(columns, columns)] += part.derivative.T @ part.derivative
            slope[columns] += part.derivative.T @ part.residual
            at = 5 + 3 * number
            normal[[at, at + 1], [at, at + 1]] += 1.0 / PLACE_DOUBT_MM**2
            slope[[at, at + 1]] += guess.single[number, 1:] / PLACE_DOUBT_MM**2
            if press.force_N is not None:
                has_force = True
                row = np.zeros(count)
                row[[3, at - 1]] = 1.0 / FORCE_DOUBT
                off = (guess.common[3] + guess.single[number, 0] - np.log(press.force_N)) / FORCE_DOUBT
                normal += np.outer(row, row)
                slope += row * off
        if not has_force and not np.isfinite(self.doubt[3]):
            normal[3, 3] += 1.0  # E is not asked for
        return normal, slope

    def _told(self, guess: _Guess, number: int) -> _Told:
        """What a press tells at some values."""
        press, shape = self.presses[number], guess.shape_mm[number]
        shell, dots = self.model(guess.common)
        force = np.empty_like(shape)
        tangent = shell.empty_tangent()
        shell.forces_and_tangent(shape, force, tangent)
        factor = tangent_factor(shell, tangent)
        size = float(np.exp(guess.single[number, 0]))
        load = size * self._share(press, guess.single[number], shape)
        pushes, seen = [], []
        here_px = dots.displacement_px(shape)
        for place in range(3):
            step = 1e-4
            other = guess.common.copy()
            other[place] += step
            stiffer, shifted = self.model(other)
            pushes.append(-(stiffer.forces(shape) - force) / step)
            seen.append((shifted.displacement_px(shape) - here_px) / step)
        pushes.append(np.zeros_like(shape))
        seen.append(np.zeros_like(here_px))
        pushes.append(load)
        seen.append(np.zeros_like(here_px))
        for axis in (1, 2):
            moved = guess.single[number].copy()
            moved[axis] += 0.05
            pushes.append((size * self._share(press, moved, shape) - load) / 0.05)
            seen.append(np.zeros_like(here_px))
        flat = np.array(pushes).reshape(7, -1) * self.patch.is_free.ravel()
        bent = factor.solve(flat).reshape(7, *shape.shape)
        # towards balance first: the shape lags behind the unknowns
        behind = factor.solve(((load - force) * self.patch.is_free).reshape(1, -1)).reshape(shape.shape)
        shape = shape + behind
        here_px = dots.displacement_px(shape)
        for place in range(7):
            change = bent[place]
            step = 1e-3 / max(float(np.abs(change).max()), 1e-12)
            seen[place] = seen[place] + (dots.displacement_px(shape + step * change) - here_px) / step
        weight = self._weight(press)
        residual = (
            weight[:, None] * np.where(press.is_seen[:, None], here_px - press.displacement_px, 0.0)
        ).ravel()
        slope = np.column_stack([(weight[:, None] * part).ravel() for part in seen])
        return _Told(residual=residual, derivative=slope)

    def _weight(self, press: Press) -> np.ndarray:
        """(m,) one over the deviation of a dot; 0 under the contact, where a patch is not what touches."""
        layout = self.sensor.layout
        assert layout is not None
        away = np.linalg.norm(layout.rest_mm[:, :2] - press.place_mm, axis=1)
        clear = away > _CLEAR * press.radius_mm
        return np.where(press.is_seen & clear, 1.0 / np.hypot(press.noise_px, MODEL_PX), 0.0)

    def _moved(self, guess: _Guess, change: np.ndarray) -> _Guess:
        """New values, and the shapes in balance with them."""
        common = guess.common + change[:4]
        common[0] = max(common[0], 0.0)
        single = guess.single + change[4:].reshape(-1, 3)
        single[:, 0] = np.maximum(single[:, 0], np.log(_LEAST_FORCE_MM2))
        shell, _ = self.model(common)
        shapes = guess.shape_mm.copy()
        for number in range(len(self.presses)):
            load = np.exp(single[number, 0]) * self._share(
                self.presses[number], single[number], shapes[number]
            )
            shapes[number] = equilibrium(shell, load, start_mm=shapes[number], tolerance=1e-7).coefficient_mm
        return _Guess(common=common, single=single, shape_mm=shapes)

    def left_px(self, guess: _Guess, number: int) -> float:
        """Root mean square of what is left of the dots outside a contact, along an axis."""
        press = self.presses[number]
        _, dots = self.model(guess.common)
        there = self._weight(press) > 0
        left = (dots.displacement_px(guess.shape_mm[number]) - press.displacement_px)[there]
        return float(np.sqrt(np.mean(left**2)))

    def off_without(self, guess: _Guess, told: Sequence[_Told], number: int, common: np.ndarray) -> float:
        """ln of the force that a press has on the sheet that the others tell, over its reading.

        Args:
            common: (4,) change of the common values when this press is left out.
        """
        press, part = self.presses[number], told[number]
        assert press.force_N is not None
        own = part.derivative[:, 4:]
        normal = own.T @ own + np.diag([0.0, 1.0, 1.0]) / PLACE_DOUBT_MM**2
        slope = own.T @ (part.residual + part.derivative[:, :4] @ common)
        slope[1:] += guess.single[number, 1:] / PLACE_DOUBT_MM**2
        change = -np.linalg.solve(normal, slope)[0]
        force = guess.single[number, 0] + change + guess.common[3] + common[3]
        return float(force - np.log(press.force_N))


def _read(
    sensor: Sensor, presses: Sequence[Press], fit: _Fit, best: _Guess, told: tuple[_Told, ...]
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
    std = np.sqrt(jackknife + np.diag(np.linalg.inv(normal))[:4])
    bending, thickness = float(np.exp(best.common[1])), float(np.exp(best.common[2]))
    deviations = {
        "pretension_over_E_mm": float(std[0]),
        "bending_factor": bending * float(std[1]),
        "thickness_mm": thickness * float(std[2]),
    }
    if young is not None:
        deviations["pretension_N_per_mm"] = young * float(std[0])
    if any(has_force) and young is not None:
        deviations["young_MPa"] = young * float(std[3])
    left_out = np.full(count, np.nan)
    for number in [number for number in range(count) if has_force[number] and sum(has_force) > 1]:
        left_out[number] = np.exp(fit.off_without(best, told, number, spread[number])) - 1.0
    calibrated = replace(
        sheet,
        thickness_mm=thickness,
        bending_factor=bending,
        young_MPa=young,
        poisson=fit.poisson,
        pretension_N_per_mm=None if young is None else float(best.common[0]) * young,
    )
    return SheetCalibration(
        sheet=calibrated,
        std=deviations,
        not_told=tuple(_not_told(fit, std, any_force=any(has_force))),
        force_over_E_mm2=np.exp(best.single[:, 0]),
        residual_px=np.array([fit.left_px(best, number) for number in range(count)]),
        left_out=left_out,
    )


def _not_told(fit: _Fit, std: np.ndarray, *, any_force: bool) -> list[str]:
    found = []
    for place, name in enumerate(PARAMETERS):
        if std[place] > 0.7 * fit.doubt[place]:
            found.append(
                f"the presses do not tell {name} better than it was assumed: add deeper ones, and some "
                "near the clamp"
            )
    if not any_force:
        found.append("no force was read, so stiffness is as in the sensor file: give at least one force in N")
    return found


def _disc(place_mm: np.ndarray, radius_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Points of equal weight in a disc; the weights sum to 1."""
    number = np.arange(48) + 0.5
    angle = np.pi * (1 + np.sqrt(5)) * number
    around = np.sqrt(number / 48)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return place_mm + radius_mm * around, np.full(48, 1 / 48)


def _size(press: Press, displacement_px: Points2) -> float:
    """How far the markers moved, root of the sum of squares."""
    return float(np.sqrt((displacement_px[press.is_seen] ** 2).sum()))


def _reach(press: Press) -> float:
    """Largest displacement of a marker in deviations."""
    moved = np.linalg.norm(np.where(press.is_seen[:, None], press.displacement_px, 0.0), axis=1)
    return float(moved.max()) / press.noise_px
