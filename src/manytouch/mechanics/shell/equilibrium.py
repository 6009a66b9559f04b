"""The shape of the shell under given loads: the forward problem."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.banded.band import BandFactor, band_rows, factorise, new_band
from manytouch.mechanics.shell import tangent_kernels
from manytouch.mechanics.shell.shell import Shell

Load = Nodal | Callable[[Nodal], Nodal]
"""Nodal forces over E (nodes, 3), mm^2, or a function of the coefficients that returns them."""

MAX_CHANGE_MM = 4.0  # of a coefficient in a step
MIN_SHARE = 1e-4  # of a step
MIN_STIFFENING = 1e-6  # added to the diagonal of an indefinite tangent, over its largest entry
ACCEPTED = 0.95  # a step is shortened until it reduces the imbalance along it to this share
NOISE_MM2 = 1e-13  # rounding error of forces


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Equilibrium:
    """Result of Newton's method.

    Attributes:
        coefficient_mm: (nodes, 3) of the shape.
        imbalance: largest difference of external and internal nodal forces over the largest force.
        status: "ok" or "not_converged".
    """

    coefficient_mm: Nodal
    imbalance: float
    status: str


def tangent_factor(shell: Shell, tangent: np.ndarray) -> BandFactor:
    """The factor of a tangent (nodes, 3, 3, 7, 8); of the least stiffened one if it is indefinite."""
    patch = shell.patch
    width = 3 * tangent_kernels.REACH * (patch.shape[1] + 1) + 2
    stiffening = 0.0
    while True:
        band = new_band(3 * patch.node_count, width, np.float64)
        rows = band_rows(band)
        tangent_kernels.copy_to_band(tangent, patch.shape, patch.is_free, rows)
        rows[:, 0] += stiffening * rows[:, 0].max()
        factor = factorise(band)
        if factor is not None:
            return factor
        stiffening = max(MIN_STIFFENING, 10.0 * stiffening)


def compliances_at_rest(shell: Shell, tangent: np.ndarray) -> Float64[np.ndarray, " nodes"]:
    """Deflection at each node by a normal force over E of 1 mm^2 there, per mm; 0 at a clamped outline.

    Args:
        shell: the sheet.
        tangent: (nodes, 3, 3, 7, 8) at rest, where in-plane displacements do not change deflections.
    """
    patch, reach = shell.patch, tangent_kernels.REACH
    fast = patch.shape[1]
    band = new_band(patch.node_count, reach * (fast + 1), np.float64)
    rows = band_rows(band)
    for slow_step, fast_step in np.ndindex(reach + 1, tangent_kernels.ROW):
        away = slow_step * fast + fast_step - reach
        if away >= 0:
            rows[:, away] = tangent[:, 2, 2, reach + slow_step, fast_step]
    rows[~patch.is_free[:, 2], 0] = 1.0
    factor = factorise(band)
    if factor is None:
        raise ValueError("the sheet at rest is not stable")
    # a quarter of the sheet; the others are as compliant
    along_slow, along_fast = (np.minimum(np.arange(count), np.arange(count)[::-1]) for count in patch.shape)
    quarter = np.arange(along_slow.max() + 1)[:, None] * fast + np.arange(along_fast.max() + 1)
    points = patch.at(patch.place_mm[quarter.ravel()])
    load = np.zeros((quarter.size, patch.node_count))
    load[np.arange(quarter.size)[:, None], points.node] = points.deflection
    found_per_mm = (factor.whiten(load * patch.is_free[:, 2]) ** 2).sum(axis=1).reshape(quarter.shape)
    return np.asarray(found_per_mm[np.ix_(along_slow, along_fast)].ravel())


def equilibrium(
    shell: Shell, load: Load, *, start_mm: Nodal | None = None, tolerance: float = 1e-9, most: int = 60
) -> Equilibrium:
    """The shape in equilibrium with a load, by Newton's method.

    Args:
        shell: the sheet.
        load: nodal forces over E. The tangent of a load that depends on the coefficients is left out, so that
            it converges linearly.
        start_mm: (nodes, 3) initial coefficients; rest if None.
        tolerance: of the imbalance.
        most: number of steps.
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
        here += _shorten(shell, here, change, acting, force)
    status = "ok" if out * size <= tolerance * size + NOISE_MM2 else "not_converged"
    return Equilibrium(coefficient_mm=here, imbalance=out, status=status)


def _shorten(shell: Shell, here: Nodal, change: Nodal, acting: Nodal, force: Nodal) -> Nodal:
    """The part of a Newton step that reduces the imbalance along it."""
    share = min(1.0, MAX_CHANGE_MM / max(float(np.abs(change).max()), 1e-300))
    before = abs(float(((acting - force) * change).sum()))
    while share > MIN_SHARE:
        after = abs(float(((acting - shell.forces(here + share * change)) * change).sum()))
        if after <= ACCEPTED * before:
            break
        share *= 0.5
    return share * change
