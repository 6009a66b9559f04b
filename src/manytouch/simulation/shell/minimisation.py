"""Minimisation of an energy in few evaluations, again and again while the loads move.

Limited-memory BFGS (J. Nocedal, Math. Comp. 35 (1980), 773), on top of an approximate inverse of the
stiffness; the steps of earlier calls are used in the next one.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

PAIRS = 12  # steps that are remembered
TOLERANCE = 1e-6  # share of the energy that a further step would gain at convergence
NEGLIGIBLE_N_MM = 1e-12


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Minimum:
    """Where a minimisation ended.

    Attributes:
        value: the unknowns.
        evaluations: of the energy.
        has_converged: whether hardly any energy could still be gained.
    """

    value: np.ndarray
    evaluations: int
    has_converged: bool


class EnergyMinimiser:
    """Finds minima of an energy that changes from call to call; the energy falls in every step."""

    def __init__(self, preconditioner: Callable[[np.ndarray], np.ndarray]) -> None:
        """Args: preconditioner: approximate inverse of the stiffness, symmetric and positive."""
        self._preconditioner = preconditioner
        self._pairs: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=PAIRS)

    def reset(self) -> None:
        """Discard what earlier steps showed of the stiffness."""
        self._pairs.clear()

    def minimise(
        self,
        energy_of: Callable[[np.ndarray], tuple[float, np.ndarray]],
        value: np.ndarray,
        max_evaluations: int,
    ) -> Minimum:
        """Descend from a value.

        Args:
            energy_of: energy above that at rest, and its derivatives; its last call is at the result.
            value: unknowns to begin with.
            max_evaluations: of the energy, at least one.
        """
        energy, slope = energy_of(value)
        evaluations, has_converged = 1, False
        while evaluations < max_evaluations:
            step = -self._scale(slope)
            fall = float(np.vdot(slope, step))
            has_converged = -fall <= TOLERANCE * energy + NEGLIGIBLE_N_MM
            if has_converged:
                break
            share, start = 1.0, energy
            while evaluations < max_evaluations:
                tried = value + share * step
                energy, new_slope = energy_of(tried)
                evaluations += 1
                if energy <= start + 1e-4 * share * fall:
                    break
                above = max(energy - start - share * fall, NEGLIGIBLE_N_MM)
                share *= min(max(-0.5 * fall * share / above, 0.1), 0.5)
            else:
                self.reset()
                energy_of(value)
                break
            self._remember(share * step, new_slope - slope)
            value, slope = tried, new_slope
        return Minimum(value=value, evaluations=evaluations, has_converged=has_converged)

    def _remember(self, moved: np.ndarray, change: np.ndarray) -> None:
        product = float(np.vdot(moved, change))
        if product > 1e-12 * float(np.linalg.norm(moved)) * float(np.linalg.norm(change)):
            self._pairs.append((moved, change, product))

    def _scale(self, slope: np.ndarray) -> np.ndarray:
        """The slope times the approximate inverse of the Hessian (two-loop recursion)."""
        out, shares = slope.copy(), []
        for moved, change, product in reversed(self._pairs):
            shares.append(float(np.vdot(moved, out)) / product)
            out -= shares[-1] * change
        out = self._preconditioner(out)
        for (moved, change, product), share in zip(self._pairs, reversed(shares), strict=True):
            out += (share - float(np.vdot(change, out)) / product) * moved
        return out
