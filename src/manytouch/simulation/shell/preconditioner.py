"""Approximate displacements of the sheet at rest under nodal forces: the preconditioner of the live sheet."""

from dataclasses import dataclass, field

import numpy as np

EXTRA_TENSION = 0.5  # of a sheet that is pressed, in N/mm


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Preconditioner:
    """An approximate inverse of the stiffness at rest, symmetric and positive, by sine transforms.

    Attributes:
        nodes: inner nodes along x and y.
        spacing_mm: of the grid.
        stretching: E t / (1 - nu^2), N/mm.
        bending: D, N mm.
        shear: N/mm.
        poisson: nu.
        tension: N/mm.
    """

    nodes: tuple[int, int]
    spacing_mm: tuple[float, float]
    stretching: float
    bending: float
    shear: float
    poisson: float
    tension: float
    _sines: tuple[np.ndarray, np.ndarray] = field(init=False, repr=False)
    _soft: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        sines, square, mean = [], [], []
        for count, spacing in zip(self.nodes, self.spacing_mm, strict=True):
            number = np.arange(1, count + 1)
            angle = np.pi * number / (count + 1)
            sines.append(np.sqrt(2.0 / (count + 1)) * np.sin(np.outer(number, angle)))
            square.append((2.0 - 2.0 * np.cos(angle)) / spacing**2)
            mean.append(0.5 * (1.0 + np.cos(angle)))
        x2, y2 = square[0][:, None], square[1][None, :]
        mean_x, mean_y = mean[0][:, None], mean[1][None, :]
        side = 0.5 * (1.0 - self.poisson)
        along, across = x2 + side * y2, y2 + side * x2
        tilt_x = self.shear * mean_x + self.bending * along
        tilt_y = self.shear * mean_y + self.bending * across
        deep = (self.tension + EXTRA_TENSION) * (x2 + y2)
        deep = deep + self.shear * x2 * (1.0 - self.shear * mean_x / tilt_x)
        deep = deep + self.shear * y2 * (1.0 - self.shear * mean_y / tilt_y)
        stiff = np.stack([self.stretching * along, self.stretching * across, deep, tilt_x, tilt_y])
        area = self.spacing_mm[0] * self.spacing_mm[1]
        object.__setattr__(self, "_sines", (sines[0].astype(np.float32), sines[1].astype(np.float32)))
        object.__setattr__(self, "_soft", (1.0 / (area * stiff)).astype(np.float32))

    @property
    def sines(self) -> tuple[np.ndarray, np.ndarray]:
        """Sine transforms (a', a') and (b', b') of the inner nodes along x and y."""
        return self._sines

    @property
    def soft(self) -> np.ndarray:
        """(5, a', b') compliance of the waves of displacements and tilts."""
        return self._soft

    @property
    def coupling(self) -> np.ndarray:
        """(2,) coupling of the tilts to the difference of depth of their neighbours along x and y."""
        return np.array([self._coupling(0), self._coupling(1)])

    def __call__(self, force: np.ndarray) -> np.ndarray:
        """Displacements and tilts (5, a, b) under forces and moments (5, a, b); zero on the outline."""
        out = np.zeros_like(force)
        inner = out[:, 1:-1, 1:-1]
        inner[[0, 1, 3, 4]] = self._compliance(force[[0, 1, 3, 4], 1:-1, 1:-1], [0, 1, 3, 4])
        pull = force[2, 1:-1, 1:-1] + self._coupling(0) * (out[3, 2:, 1:-1] - out[3, :-2, 1:-1])
        pull += self._coupling(1) * (out[4, 1:-1, 2:] - out[4, 1:-1, :-2])
        inner[2] = self._compliance(pull[None], [2])[0]
        turn = np.stack(
            [
                self._coupling(0) * (out[2, 2:, 1:-1] - out[2, :-2, 1:-1]),
                self._coupling(1) * (out[2, 1:-1, 2:] - out[2, 1:-1, :-2]),
            ]
        )
        inner[3:] -= self._compliance(turn, [3, 4])
        return out

    def _coupling(self, axis: int) -> float:
        """Coupling of a tilt to the difference of depth of its neighbours along an axis."""
        return self.shear * self.spacing_mm[0] * self.spacing_mm[1] / (2.0 * self.spacing_mm[axis])

    def _compliance(self, force: np.ndarray, fields: list[int]) -> np.ndarray:
        along_x, along_y = self._sines
        force = force.astype(np.float32)
        return np.asarray(along_x @ ((along_x @ force @ along_y) * self._soft[fields]) @ along_y)
