"""Downhill to an equilibrium in few steps, over and over while the loads move.

Limited-memory BFGS (J. Nocedal, Math. Comp. 35 (1980), 773), on top of an approximate inverse of the
stiffness; what it has learned of the stiffness is kept from one call to the next.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

PAIRS = 12  # steps that are remembered
ENOUGH = 1e-6  # share of the energy that may be left to gain
NOTHING = 1e-12  # N mm


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Minimum:
    """Where the descent ended.

    Attributes:
        value: the unknowns.
        looks: how often the energy was asked for.
        is_settled: is there next to nothing left to gain?
    """

    value: np.ndarray
    looks: int
    is_settled: bool


class EnergyMinimiser:
    """Finds minima of an energy; the energy falls in every step, so it cannot run away."""

    def __init__(self, softness: Callable[[np.ndarray], np.ndarray]) -> None:
        """Args: softness: approximate inverse of the stiffness, symmetric and positive."""
        self._softness = softness
        self._pairs: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=PAIRS)

    def forget(self) -> None:
        """The next call begins with what is known at rest."""
        self._pairs.clear()

    def __call__(
        self, energy_of: Callable[[np.ndarray], tuple[float, np.ndarray]], value: np.ndarray, most: int
    ) -> Minimum:
        """Go down from a value, looking at the energy at most so many times.

        Args:
            energy_of: energy above that at rest, and its derivatives; asked last at the value that is found.
            value: unknowns to begin with.
            most: looks, one at least.
        """
        energy, slope = energy_of(value)
        looks, is_settled = 1, False
        while looks < most:
            step = -self._eased(slope)
            fall = float(np.vdot(slope, step))
            is_settled = -fall <= ENOUGH * energy + NOTHING
            if is_settled:
                break
            share, start = 1.0, energy
            while looks < most:
                tried = value + share * step
                energy, turned = energy_of(tried)
                looks += 1
                if energy <= start + 1e-4 * share * fall:
                    break
                above = max(energy - start - share * fall, NOTHING)
                share *= min(max(-0.5 * fall * share / above, 0.1), 0.5)
            else:
                self.forget()
                energy_of(value)
                break
            self._remember(share * step, turned - slope)
            value, slope = tried, turned
        return Minimum(value=value, looks=looks, is_settled=is_settled)

    def _remember(self, moved: np.ndarray, turned: np.ndarray) -> None:
        product = float(np.vdot(moved, turned))
        if product > 1e-12 * float(np.linalg.norm(moved)) * float(np.linalg.norm(turned)):
            self._pairs.append((moved, turned, product))

    def _eased(self, slope: np.ndarray) -> np.ndarray:
        """The step that would end the slope, by all that is known."""
        out, shares = slope.copy(), []
        for moved, turned, product in reversed(self._pairs):
            shares.append(float(np.vdot(moved, out)) / product)
            out -= shares[-1] * turned
        out = self._softness(out)
        for (moved, turned, product), share in zip(self._pairs, reversed(shares), strict=True):
            out += (share - float(np.vdot(turned, out)) / product) * moved
        return out
