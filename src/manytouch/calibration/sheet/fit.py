"""Fit of a sheet to presses by Gauss-Newton steps, with the sensitivities of the predictions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64

from manytouch.estimation.mechanics.inversion.sheet_parameters import CLAMP_STD_THICKNESSES
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell.equilibrium import equilibrium, tangent_factor
from manytouch.mechanics.shell.shell import Shell
from manytouch.values import Sensor, Sheet
from manytouch.values.arrays import Points2
from manytouch.values.sensor_file.assumed_sheet import ASSUMED_POISSON
from manytouch.values.sensor_file.default_std import sheet_std

TENSION, BENDING, THICKNESS, OUTLINE, YOUNG = range(5)
"""Places of the common unknowns in `FitParameters.common`."""
COMMON = 5
THICKNESS_PRIOR_STD = 0.15
"""Relative standard deviation of the thickness in the sensor file."""
BENDING_PRIOR_STD = 0.03
"""Relative standard deviation of the bending factor where the sensor file states none: it is 1 for a
homogeneous sheet."""
EXACT_STD = 1e-6
PRETENSION_PRIOR_STRAIN = 0.05
"""Standard deviation of the strain of a mounted sheet."""
STIFFNESS_PRIOR_STD = 0.3
"""Relative standard deviation of a nominal E in the sensor file."""
PLACE_PRIOR_STD_MM = 1.0
"""Standard deviation of the centre of force from the stated place: a flat foot on a slope presses with its
edge."""
FORCE_MODEL_STD = 0.03
"""Relative model error between a force reading and the shell, in addition to the deviation of the reading."""
MODEL_SHARE = 0.01
"""Model error of the shell in the displacement of a dot, over the largest displacement by the press.
Fitted: shells have residuals of up to 0.008 on 3-D solids of 3 mm, slack and with 2 % of strain, under a ball
of 16 mm to 3 mm deep; eight other sheets of 1.5 to 6 mm confirm it (ADR 111)."""
INDEPENDENT_ERRORS = 10.0
"""Number of independent model errors of a press, chosen on the same two sheets. Those of neighbouring dots
are alike: if each dot counted, hundreds of them would outweigh the readings of the scale and what the sensor
file states."""
_STEP = 1e-4  # of the common unknowns, for differences
_CLEAR_RADII = 1.3
_MAX_STEPS = 25
_INITIAL_FORCE_STEPS = 20
_INITIAL_FORCE_TOLERANCE = 0.2
_CONVERGED = 1e-3
_LEAST_FORCE_MM2 = 1e-4


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KnownPress:
    """A press that is held, as measured by the markers.

    Attributes:
        name: for messages.
        place_mm: (2,) its centre on the undeformed sheet.
        radius_mm: of the contact area.
        displacement_px: (m, 2) of the markers from rest.
        is_seen: (m,).
        noise_px: standard deviation of a displacement.
        force_N: reading of a scale, positive; None without reading.
        shear_N: (2,) force along x and y, of a weight on a tilted sensor; None if not known.
    """

    name: str
    place_mm: Float64[np.ndarray, "2"]
    radius_mm: float
    displacement_px: Points2
    is_seen: Bool[np.ndarray, " m"]
    noise_px: float
    force_N: float | None = None
    shear_N: Float64[np.ndarray, "2"] | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FitParameters:
    """Values of all unknowns; logarithms of those that must be positive.

    Attributes:
        common: pretension over E (mm), ln bending factor, ln thickness, distance of each side of the clamp
            outwards from the outline in the sensor file (mm), ln E (unused without readings).
        single: (k, 3) ln force over E, and offset of the press from its stated place, x and y (mm).
        shape_mm: (k, n, 3) of the shell under each press.
    """

    common: Float64[np.ndarray, "5"]
    single: Float64[np.ndarray, "k 3"]
    shape_mm: Float64[np.ndarray, "k n 3"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PressLinearisation:
    """Residual and derivative of one press.

    Attributes:
        residual: (2 m,) predicted minus measured, in standard deviations.
        derivative: (2 m, 8) with respect to the common unknowns and its own three.
    """

    residual: Float64[np.ndarray, " n"]
    derivative: Float64[np.ndarray, "n 8"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PressFit:
    """The least-squares problem: presses, prior and start values.

    Attributes:
        sensor, presses: given.
        patch: of the sheet with the outline in the sensor file.
        poisson: assumed or from the sensor file.
        prior, prior_std: (5,) of the common unknowns.
        first: start values.
    """

    sensor: Sensor
    presses: tuple[KnownPress, ...]
    patch: SplinePatch
    poisson: float
    prior: Float64[np.ndarray, "5"]
    prior_std: Float64[np.ndarray, "5"]
    first: FitParameters

    @staticmethod
    def start(sensor: Sensor, presses: Sequence[KnownPress]) -> "PressFit":
        """The fit of a sensor with sheet and layout, at the values of its file."""
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
                0.0,
                np.log(young),
            ]
        )
        outline_mm = np.hypot(sheet_std(sheet).outline_mm, CLAMP_STD_THICKNESSES * sheet.thickness_mm)
        prior_std = np.array(
            [
                PRETENSION_PRIOR_STRAIN * sheet.thickness_mm,
                _bending_prior_std(sheet),
                THICKNESS_PRIOR_STD,
                outline_mm,
                np.inf if sheet.young_MPa is None else STIFFNESS_PRIOR_STD,
            ]
        )
        single = np.zeros((len(presses), 3))
        unit = float(np.sqrt(np.prod(layout.pitch_mm))) * sheet.thickness_mm
        single[:, 0] = np.log(0.01 * unit)
        return PressFit(
            sensor=sensor,
            presses=tuple(presses),
            patch=patch,
            poisson=sheet.poisson if sheet.poisson is not None else ASSUMED_POISSON,
            prior=prior,
            prior_std=prior_std,
            first=FitParameters(
                common=prior.copy(), single=single, shape_mm=np.zeros((len(presses), patch.node_count, 3))
            ),
        )

    def run(self) -> tuple[FitParameters, tuple[PressLinearisation, ...]]:
        """Iterate Gauss-Newton steps; returns the best values and the linearisation of each press there."""
        guess = self._initial_forces(self.first)
        for _ in range(_MAX_STEPS):
            change = self.step(guess, self._linearise(guess))
            change *= min(1.0, 0.7 / float(np.abs(change[1:]).max()))
            guess = self._apply(guess, change)
            if np.abs(change).max() < _CONVERGED:
                break
        return guess, self._linearise(guess)

    def step(
        self, guess: FitParameters, linear: Sequence[PressLinearisation], left_out: int | None = None
    ) -> np.ndarray:
        """(5 + 3 k,) the next Gauss-Newton step, with all presses or without one."""
        normal, slope = self.normal(guess, linear, left_out)
        return -np.linalg.solve(normal, slope)

    def _initial_forces(self, guess: FitParameters) -> FitParameters:
        """Initial forces: each press is scaled until its dots move as far as measured."""
        shell, dots = self.model(guess.common)
        single, shapes = guess.single.copy(), guess.shape_mm.copy()
        for number, press in enumerate(self.presses):
            wanted, shape = _norm_px(press, press.displacement_px), shapes[number]
            for _ in range(_INITIAL_FORCE_STEPS):
                load = np.exp(single[number, 0]) * _unit_load(shell.patch, press, single[number], shape)
                shape = equilibrium(shell, load, start_mm=shape, tolerance=1e-4).coefficient_mm
                short = float(np.log(wanted / max(_norm_px(press, dots.displacement_px(shape)), 1e-9)))
                if abs(short) < _INITIAL_FORCE_TOLERANCE:
                    break
                single[number, 0] += float(np.clip(short, -1.0, 1.0))
            shapes[number] = shape
        return replace(guess, single=single, shape_mm=shapes)

    def model(self, common: Float64[np.ndarray, "5"]) -> tuple[Shell, MarkerImages]:
        """Shell and dots at given common unknowns."""
        layout = self.sensor.layout
        assert layout is not None
        width_mm, height_mm = (side + 2.0 * float(common[OUTLINE]) for side in self.patch.size_mm)
        shell = Shell(
            patch=replace(self.patch, size_mm=(width_mm, height_mm)),
            thickness_mm=float(np.exp(common[THICKNESS])),
            poisson=self.poisson,
            pretension_over_E_mm=float(common[TENSION]),
            bending_factor=float(np.exp(common[BENDING])),
        )
        dots = MarkerImages(
            shell=shell,
            camera=self.sensor.camera,
            rest_mm=layout.rest_mm,
            radius_mm=layout.radius_mm,
            height_mm=layout.height_mm,
        )
        return shell, dots

    def normal(
        self, guess: FitParameters, linear: Sequence[PressLinearisation], left_out: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrix and gradient of half the sum of squares; unknowns: the common ones, then three
        per press."""
        count = COMMON + 3 * len(self.presses)
        normal, slope = np.zeros((count, count)), np.zeros(count)
        normal[:COMMON, :COMMON] += np.diag(1.0 / self.prior_std**2)
        slope[:COMMON] += (guess.common - self.prior) / self.prior_std**2
        has_force = False
        for number, (press, part) in enumerate(zip(self.presses, linear, strict=True)):
            own = slice(COMMON + 3 * number, COMMON + 3 + 3 * number)
            if number == left_out:
                normal[own, own] += np.eye(3)
                continue
            columns = np.r_[0:COMMON, own]
            normal[np.ix_(columns, columns)] += part.derivative.T @ part.derivative
            slope[columns] += part.derivative.T @ part.residual
            x, y = own.start + 1, own.start + 2
            normal[[x, y], [x, y]] += 1.0 / PLACE_PRIOR_STD_MM**2
            slope[[x, y]] += guess.single[number, 1:] / PLACE_PRIOR_STD_MM**2
            if press.force_N is not None:
                has_force = True
                row = np.zeros(count)
                row[[YOUNG, own.start]] = 1.0 / FORCE_MODEL_STD
                off = (
                    guess.common[YOUNG] + guess.single[number, 0] - np.log(press.force_N)
                ) / FORCE_MODEL_STD
                normal += np.outer(row, row)
                slope += row * off
        if not has_force and not np.isfinite(self.prior_std[YOUNG]):
            normal[YOUNG, YOUNG] += 1.0  # E is not fitted
        return normal, slope

    def _linearise(self, guess: FitParameters) -> tuple[PressLinearisation, ...]:
        """Linearise all presses at given values."""
        steps = _STEP * np.eye(COMMON + 1)[[COMMON, TENSION, BENDING, THICKNESS, OUTLINE], :COMMON]
        models = [self.model(guess.common + step) for step in steps]
        return tuple(self._linearise_press(guess, number, models) for number in range(len(self.presses)))

    def _linearise_press(
        self, guess: FitParameters, number: int, models: Sequence[tuple[Shell, MarkerImages]]
    ) -> PressLinearisation:
        """Linearise one press; `models` are those of the values, and of one after the other increased."""
        press, shape = self.presses[number], guess.shape_mm[number]
        (shell, dots), *changed = models
        force = np.empty_like(shape)
        tangent = shell.empty_tangent()
        shell.forces_and_tangent(shape, force, tangent)
        factor = tangent_factor(shell, tangent)
        size = float(np.exp(guess.single[number, 0]))
        load = size * _unit_load(shell.patch, press, guess.single[number], shape)
        loads, seen = [], []
        here_px = dots.displacement_px(shape)
        for other_shell, other_dots in changed:
            other_load = size * _unit_load(other_shell.patch, press, guess.single[number], shape)
            loads.append((other_load - load - other_shell.forces(shape) + force) / _STEP)
            seen.append((other_dots.displacement_px(shape) - here_px) / _STEP)
        loads.append(np.zeros_like(shape))
        seen.append(np.zeros_like(here_px))
        loads.append(load)
        seen.append(np.zeros_like(here_px))
        for axis in (1, 2):
            moved = guess.single[number].copy()
            moved[axis] += 0.05
            loads.append((size * _unit_load(shell.patch, press, moved, shape) - load) / 0.05)
            seen.append(np.zeros_like(here_px))
        flat = np.array(loads).reshape(len(loads), -1) * self.patch.is_free.ravel()
        response = factor.solve(flat).reshape(len(loads), *shape.shape)
        # One step towards equilibrium first, since the shape lags behind the unknowns.
        behind = factor.solve(((load - force) * self.patch.is_free).reshape(1, -1)).reshape(shape.shape)
        shape = shape + behind
        here_px = dots.displacement_px(shape)
        for place, change in enumerate(response):
            step = 1e-3 / max(float(np.abs(change).max()), 1e-12)
            seen[place] = seen[place] + (dots.displacement_px(shape + step * change) - here_px) / step
        weight = self._weight(press)
        residual = (
            weight[:, None] * np.where(press.is_seen[:, None], here_px - press.displacement_px, 0.0)
        ).ravel()
        slope = np.column_stack([(weight[:, None] * part).ravel() for part in seen])
        return PressLinearisation(residual=residual, derivative=slope)

    def _weight(self, press: KnownPress) -> np.ndarray:
        """(m,) one over the standard deviation of a dot; 0 under the contact, where the patch is not valid.

        The model error is so much larger than that of a dot as makes all dots together count like
        `INDEPENDENT_ERRORS` of them.
        """
        layout = self.sensor.layout
        assert layout is not None
        away = np.linalg.norm(layout.rest_mm[:, :2] - press.place_mm, axis=1)
        clear = away > _CLEAR_RADII * press.radius_mm
        is_used = press.is_seen & clear
        moved_px = np.linalg.norm(press.displacement_px[is_used], axis=1).max(initial=0.0)
        alike = np.sqrt(max(is_used.sum() / INDEPENDENT_ERRORS, 1.0))
        return np.where(is_used, 1.0 / np.hypot(press.noise_px, MODEL_SHARE * moved_px * alike), 0.0)

    def _apply(self, guess: FitParameters, change: np.ndarray) -> FitParameters:
        """Updated values with the shapes in equilibrium."""
        common = guess.common + change[:COMMON]
        common[TENSION] = max(common[TENSION], 0.0)
        single = guess.single + change[COMMON:].reshape(-1, 3)
        single[:, 0] = np.maximum(single[:, 0], np.log(_LEAST_FORCE_MM2))
        shell, _ = self.model(common)
        shapes = guess.shape_mm.copy()
        for number in range(len(self.presses)):
            load = np.exp(single[number, 0]) * _unit_load(
                shell.patch, self.presses[number], single[number], shapes[number]
            )
            shapes[number] = equilibrium(shell, load, start_mm=shapes[number], tolerance=1e-7).coefficient_mm
        return FitParameters(common=common, single=single, shape_mm=shapes)

    def residual_rms_px(self, guess: FitParameters, number: int) -> float:
        """RMS residual of the dots outside the contact, along an axis."""
        press = self.presses[number]
        _, dots = self.model(guess.common)
        there = self._weight(press) > 0
        left = (dots.displacement_px(guess.shape_mm[number]) - press.displacement_px)[there]
        return float(np.sqrt(np.mean(left**2)))

    def leave_one_out_error(
        self, guess: FitParameters, linear: Sequence[PressLinearisation], number: int, common: np.ndarray
    ) -> float:
        """ln of the force that a press has on the sheet fitted to the others, over its reading.

        Args:
            common: (5,) change of the common unknowns when this press is left out.
        """
        press, part = self.presses[number], linear[number]
        assert press.force_N is not None
        own = part.derivative[:, COMMON:]
        normal = own.T @ own + np.diag([0.0, 1.0, 1.0]) / PLACE_PRIOR_STD_MM**2
        slope = own.T @ (part.residual + part.derivative[:, :COMMON] @ common)
        slope[1:] += guess.single[number, 1:] / PLACE_PRIOR_STD_MM**2
        change = -np.linalg.solve(normal, slope)[0]
        force = guess.single[number, 0] + change + guess.common[YOUNG] + common[YOUNG]
        return float(force - np.log(press.force_N))


def _bending_prior_std(sheet: Sheet) -> float:
    """Relative standard deviation of the bending factor; that of a factor which the file states exactly is
    tiny, since 0 has no inverse."""
    if sheet.bending_factor_std is None:
        return BENDING_PRIOR_STD
    return max(sheet.bending_factor_std / (sheet.bending_factor or 1.0), EXACT_STD)


def disc(place_mm: np.ndarray, radius_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Points of equal weight in a disc; the weights sum to 1."""
    number = np.arange(48) + 0.5
    angle = np.pi * (1 + np.sqrt(5)) * number
    around = np.sqrt(number / 48)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return place_mm + radius_mm * around, np.full(48, 1 / 48)


def _norm_px(press: KnownPress, displacement_px: Points2) -> float:
    """Root of the sum of squared displacements of the markers, px."""
    return float(np.sqrt((displacement_px[press.is_seen] ** 2).sum()))


def _unit_load(
    patch: SplinePatch, press: KnownPress, single: Float64[np.ndarray, "3"], shape_mm: np.ndarray
) -> np.ndarray:
    """(n, 3) nodal load of unit z force along the normal of the deformed sheet."""
    place, weight = disc(press.place_mm + single[1:], press.radius_mm)
    basis = patch.at(place)
    w_mm = shape_mm[basis.node, 2]
    push = np.column_stack(
        [(basis.slope_x * w_mm).sum(axis=1), (basis.slope_y * w_mm).sum(axis=1), -np.ones(len(place))]
    )
    return patch.load(place, weight[:, None] * push)
