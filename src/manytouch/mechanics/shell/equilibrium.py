"""The shape of the shell under given loads: the forward problem."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.shell import kernels as shell_kernels
from manytouch.mechanics.shell.shell import Shell
from manytouch.mechanics.solver.band import BandFactor, empty_band, factorise

Load = Nodal | Callable[[Nodal], Nodal]
"""Nodal forces over E (mm^2), or how they follow from the coefficients."""

LARGEST_CHANGE_MM = 4.0
LEAST_SHARE = 1e-4
STIFFENED_BY = 1e-6  # of the largest diagonal entry, where the tangent is not positive definite
ACCEPTED = 0.95  # a step is shortened until the forces out of balance along it fell to this
NOISE_MM2 = 1e-13  # of forces: what rounding leaves


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Equilibrium:
    """Where Newton's method ended.

    Attributes:
        coefficient_mm: the shape.
        imbalance: largest force out of balance over the largest that acts.
        status: "ok" or "not_converged".
    """

    coefficient_mm: Nodal
    imbalance: float
    status: str


def tangent_factor(shell: Shell, tangent: np.ndarray) -> BandFactor:
    """The factor of a tangent; where it is not positive definite, of the least stiffened one that is."""
    patch = shell.patch
    width = 3 * shell_kernels.REACH * (patch.shape[1] + 1) + 2
    stiffened = 0.0
    while True:
        unknowns = 3 * patch.node_count
        flat, front = empty_band(unknowns, width, np.float64)
        band = flat[front:-front].reshape(unknowns, width + 1)
        shell_kernels.band_of(tangent, patch.shape, patch.is_free, band)
        band[:, 0] += stiffened * band[:, 0].max()
        factor = factorise(flat, front=front, unknowns=unknowns, width=width)
        if factor is not None:
            return factor
        stiffened = max(STIFFENED_BY, 10.0 * stiffened)


def equilibrium(
    shell: Shell, load: Load, *, start_mm: Nodal | None = None, tolerance: float = 1e-9, most: int = 60
) -> Equilibrium:
    """Newton's method from a shape (rest when not given) to the one in balance with a load.

    A load that depends on the coefficients is lagged in the tangent, so that it converges linearly.
    """
    here = np.zeros((shell.patch.node_count, 3)) if start_mm is None else start_mm.copy()
    tangent, force = shell.empty_tangent(), np.empty_like(here)
    out, size = np.inf, 1.0
    for _ in range(most):
        acting = (load(here) if callable(load) else load) * shell.patch.is_free
        shell.forces_and_tangent(here, force, tangent)
        size = max(float(np.abs(acting).max()), float(np.abs(force).max()), 1e-300)
        out = float(np.abs(acting - force).max()) / size
        if out * size <= tolerance * size + NOISE_MM2:
            break
        change = tangent_factor(shell, tangent).solve((acting - force).reshape(1, -1))[0].reshape(-1, 3)
        here += _shortened(shell, here, change, acting, force)
    status = "ok" if out * size <= tolerance * size + NOISE_MM2 else "not_converged"
    return Equilibrium(coefficient_mm=here, imbalance=out, status=status)


def _shortened(shell: Shell, here: Nodal, change: Nodal, acting: Nodal, force: Nodal) -> Nodal:
    """The part of a Newton step after which the forces along it are smaller."""
    share = min(1.0, LARGEST_CHANGE_MM / max(float(np.abs(change).max()), 1e-300))
    before = abs(float(((acting - force) * change).sum()))
    while share > LEAST_SHARE:
        after = abs(float(((acting - shell.forces(here + share * change)) * change).sum()))
        if after <= ACCEPTED * before:
            break
        share *= 0.5
    return share * change
