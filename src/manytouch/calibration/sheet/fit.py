"""The fit of a sheet to presses: predictions with their sensitivities, and Gauss-Newton steps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Dots
from manytouch.mechanics.shell.equilibrium import equilibrium, tangent_factor
from manytouch.mechanics.shell.shell import THICK_BENDING, Shell
from manytouch.values import Sensor
from manytouch.values.arrays import Points2

ASSUMED_POISSON = 0.45
THICKNESS_DOUBT = 0.15
"""The thickness of the sensor file is right within this share (one deviation)."""
BENDING_DOUBT = 0.1
PRETENSION_DOUBT = 0.05
"""Strain of the mounted sheet that would not surprise."""
STIFFNESS_DOUBT = 0.3
"""A stiffness in the sensor file is nominal: right within this share."""
PLACE_DOUBT_MM = 1.0
"""Where a press bears, from its named place: a flat foot on a slope rests on its edge."""
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
class Guess:
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
class Told:
    """What a press tells.

    Attributes:
        residual: (2 m,) predicted minus seen, in deviations.
        derivative: (2 m, 7) by the common values and by its own.
    """

    residual: Float64[np.ndarray, " n"]
    derivative: Float64[np.ndarray, "n 7"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PressFit:
    """The problem that stays the same while unknowns change."""

    sensor: Sensor
    presses: tuple[Press, ...]
    patch: SplinePatch
    poisson: float
    prior: Float64[np.ndarray, "4"]
    doubt: Float64[np.ndarray, "4"]
    first: Guess

    @staticmethod
    def start(sensor: Sensor, presses: Sequence[Press]) -> "PressFit":
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
        return PressFit(
            sensor=sensor,
            presses=tuple(presses),
            patch=patch,
            poisson=sheet.poisson if sheet.poisson is not None else ASSUMED_POISSON,
            prior=prior,
            doubt=doubt,
            first=Guess(
                common=prior.copy(), single=single, shape_mm=np.zeros((len(presses), patch.node_count, 3))
            ),
        )

    def run(self) -> tuple[Guess, tuple[Told, ...]]:
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

    def step(self, guess: Guess, told: Sequence[Told], left_out: int | None = None) -> np.ndarray:
        """(4 + 3 k,) the next Gauss-Newton step, with all presses or without one."""
        normal, slope = self.normal(guess, told, left_out)
        return -np.linalg.solve(normal, slope)

    def _loaded(self, guess: Guess) -> Guess:
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
            bending_factor=THICK_BENDING * float(np.exp(common[1])),
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
        place, weight = disc(press.place_mm + single[1:], press.radius_mm)
        basis = self.patch.at(place)
        w_mm = shape_mm[basis.node, 2]
        slope = np.column_stack([(basis.dx * w_mm).sum(axis=1), (basis.dy * w_mm).sum(axis=1)])
        push = np.column_stack([slope, -np.ones(len(place))])
        return np.column_stack([self.patch.load(place, weight * part) for part in push.T])

    def normal(
        self, guess: Guess, told: Sequence[Told], left_out: int | None = None
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

    def _told(self, guess: Guess, number: int) -> Told:
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
        return Told(residual=residual, derivative=slope)

    def _weight(self, press: Press) -> np.ndarray:
        """(m,) one over the deviation of a dot; 0 under the contact, where a patch is not what touches."""
        layout = self.sensor.layout
        assert layout is not None
        away = np.linalg.norm(layout.rest_mm[:, :2] - press.place_mm, axis=1)
        clear = away > _CLEAR * press.radius_mm
        return np.where(press.is_seen & clear, 1.0 / np.hypot(press.noise_px, MODEL_PX), 0.0)

    def _moved(self, guess: Guess, change: np.ndarray) -> Guess:
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
        return Guess(common=common, single=single, shape_mm=shapes)

    def left_px(self, guess: Guess, number: int) -> float:
        """Root mean square of what is left of the dots outside a contact, along an axis."""
        press = self.presses[number]
        _, dots = self.model(guess.common)
        there = self._weight(press) > 0
        left = (dots.displacement_px(guess.shape_mm[number]) - press.displacement_px)[there]
        return float(np.sqrt(np.mean(left**2)))

    def off_without(self, guess: Guess, told: Sequence[Told], number: int, common: np.ndarray) -> float:
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


def disc(place_mm: np.ndarray, radius_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Points of equal weight in a disc; the weights sum to 1."""
    number = np.arange(48) + 0.5
    angle = np.pi * (1 + np.sqrt(5)) * number
    around = np.sqrt(number / 48)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return place_mm + radius_mm * around, np.full(48, 1 / 48)


def _size(press: Press, displacement_px: Points2) -> float:
    """How far the markers moved, root of the sum of squares."""
    return float(np.sqrt((displacement_px[press.is_seen] ** 2).sum()))
