"""Equilibrium of the sheet under bodies and dead loads as one compiled function.

The minimisation is that of `shell.minimisation` with the preconditioner of `shell.preconditioner`; compiled,
it takes half of the time, since the arrays are small.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import NamedTuple

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.simulation.contacts.ball_kernels import Balls, ball_contact_energy
from manytouch.simulation.shell import body_kernels, kernels

PAIRS = 12  # steps that are remembered
NEGLIGIBLE_N_MM = 1e-12


class SheetArrays(NamedTuple):
    """The sheet on its grid of a x b nodes, which no call changes.

    Attributes:
        spacing: (2,) of the grid, mm.
        law: of the sheet.
        bed: of the touched face.
        sines_x, sines_y: (a', a'), (b', b') sine transforms of the inner nodes.
        soft: (5, a', b') compliance of their waves.
        coupling: (2,) of the tilts with the depth.
    """

    spacing: np.ndarray
    law: kernels.ShellLaw
    bed: body_kernels.Bed
    sines_x: np.ndarray
    sines_y: np.ndarray
    soft: np.ndarray
    coupling: np.ndarray


class DescentWorkspace(NamedTuple):
    """Arrays of `descend` that are kept between calls to save time.

    Attributes:
        slope, new_slope, tried, step, left: (5, a, b).
        moved, change, product: (p, n), (p, n), (p,) latest steps, changes of the slope, their products.
    """

    slope: np.ndarray
    new_slope: np.ndarray
    tried: np.ndarray
    step: np.ndarray
    left: np.ndarray
    moved: np.ndarray
    change: np.ndarray
    product: np.ndarray


class Load(NamedTuple):
    """What acts on the sheet.

    Attributes:
        balls: that press.
        ball_loads: what they do to the sheet, filled.
        dead_N: (3, a, b) forces on the touched face that keep their direction.
    """

    balls: Balls
    ball_loads: body_kernels.BodyLoads
    dead_N: np.ndarray


@kernel()
@no_type_check
def energy(
    value: np.ndarray,
    stretch: np.ndarray,
    sheet: SheetArrays,
    load: Load,
    buffers: kernels.ElasticBuffers,
    out: np.ndarray,
) -> float:
    """Energy of sheet and loads in N mm above that at rest; fills out (5, a, b) with its derivatives."""
    half = sheet.bed.half_mm
    total = kernels.elastic(value, stretch, sheet.spacing, sheet.law, buffers, out)
    total += ball_contact_energy(value, sheet.spacing, sheet.bed, load.balls, buffers, out, load.ball_loads)
    for k in range(3):
        rest = 1.0 if k == 2 else 0.0
        for i in range(value.shape[1]):
            for j in range(value.shape[2]):
                force = load.dead_N[k, i, j]
                if force != 0.0:
                    total -= force * (value[k, i, j] + half * (buffers.fibre[k, i, j] - rest))
                    out[k, i, j] -= force
                    buffers.by_fibre[k, i, j] -= half * force
    kernels.finish_slope(value, stretch, out, buffers.by_fibre)
    return total


@kernel()
@no_type_check
def _soften(force: np.ndarray, field: int, sheet: SheetArrays, share: float, out: np.ndarray) -> None:
    """Add a share of what one field (a', b') moves under forces at the inner nodes to out (5, a, b)."""
    waves = np.dot(np.dot(sheet.sines_x, force), sheet.sines_y)
    for i in range(waves.shape[0]):
        for j in range(waves.shape[1]):
            waves[i, j] *= sheet.soft[field, i, j]
    moved = np.dot(np.dot(sheet.sines_x, waves), sheet.sines_y)
    for i in range(moved.shape[0]):
        for j in range(moved.shape[1]):
            out[field, i + 1, j + 1] += share * moved[i, j]


@kernel()
@no_type_check
def precondition(force: np.ndarray, sheet: SheetArrays, out: np.ndarray) -> None:
    """Fill out (5, a, b) with the displacements of the sheet at rest under forces, as `Preconditioner`."""
    x, y = sheet.coupling[0], sheet.coupling[1]
    rows, columns = force.shape[1] - 2, force.shape[2] - 2
    here = np.empty((rows, columns), dtype=np.float32)
    out[:] = 0.0
    for field in (0, 1, 3, 4, 2):
        for i in range(rows):
            for j in range(columns):
                pull = force[field, i + 1, j + 1]
                if field == 2:
                    pull += x * (out[3, i + 2, j + 1] - out[3, i, j + 1])
                    pull += y * (out[4, i + 1, j + 2] - out[4, i + 1, j])
                here[i, j] = pull
        _soften(here, field, sheet, 1.0, out)
    for field in (3, 4):
        for i in range(rows):
            for j in range(columns):
                along = x * (out[2, i + 2, j + 1] - out[2, i, j + 1])
                across = y * (out[2, i + 1, j + 2] - out[2, i + 1, j])
                here[i, j] = along if field == 3 else across
        _soften(here, field, sheet, -1.0, out)


@kernel()
@no_type_check
def _newton_step(
    slope: np.ndarray, work: DescentWorkspace, number: int, sheet: SheetArrays, out: np.ndarray
) -> None:
    """Fill out (5, a, b) with minus the slope times the approximate inverse Hessian (two-loop recursion)."""
    kept = min(number, PAIRS)
    share = np.empty(PAIRS)
    left = work.left
    left[:] = slope
    flat_left, flat_out = left.reshape(-1), out.reshape(-1)
    for back in range(kept):
        at = (number - 1 - back) % PAIRS
        share[at] = np.dot(work.moved[at], flat_left) / work.product[at]
        change, factor = work.change[at], share[at]
        for n in range(flat_left.size):
            flat_left[n] -= factor * change[n]
    precondition(left, sheet, out)
    for ahead in range(kept):
        at = (number - kept + ahead) % PAIRS
        factor = share[at] - np.dot(work.change[at], flat_out) / work.product[at]
        moved = work.moved[at]
        for n in range(flat_out.size):
            flat_out[n] += factor * moved[n]
    for n in range(flat_out.size):
        flat_out[n] = -flat_out[n]


@kernel()
@no_type_check
def descend(
    value: np.ndarray,
    stretch: np.ndarray,
    plain_sheet: SheetArrays,
    plain_load: Load,
    plain_buffers: kernels.ElasticBuffers,
    plain_work: DescentWorkspace,
    tolerance: float,
    max_evaluations: int,
) -> int:
    """Bring a sheet (5, a, b) to equilibrium; the loads of the balls are then those in equilibrium.

    Args:
        value: displacements and tilts, replaced by those in equilibrium.
        stretch: (a, b) thickness over that at rest.
        plain_sheet, plain_load, plain_buffers, plain_work: the sheet, what acts on it, buffers of
            `elastic` and own ones, each as a plain tuple, whose type is recognised faster.
        tolerance: share of the energy that a further step would gain at convergence.
        max_evaluations: of the energy.

    Returns:
        Evaluations of the energy; minus their number without convergence.
    """
    law, bed = kernels.ShellLaw(*plain_sheet[1]), body_kernels.Bed(*plain_sheet[2])
    sheet = SheetArrays(plain_sheet[0], law, bed, *plain_sheet[3:])
    load = Load(Balls(*plain_load[0]), body_kernels.BodyLoads(*plain_load[1]), plain_load[2])
    buffers = kernels.ElasticBuffers(*plain_buffers)
    work = DescentWorkspace(*plain_work)
    slope, tried, new_slope, step = work.slope, work.tried, work.new_slope, work.step
    flat_step, flat_slope, flat_new = step.reshape(-1), slope.reshape(-1), new_slope.reshape(-1)
    evaluations, number = 0, 0
    at_value, fall, share = np.inf, 0.0, 1.0
    tried[:] = value
    while True:
        at_tried = energy(tried, stretch, sheet, load, buffers, new_slope)
        evaluations += 1
        if evaluations == 1 or at_tried <= at_value + 1e-4 * share * fall:
            if evaluations > 1:
                at, product = number % PAIRS, 0.0
                for n in range(flat_step.size):
                    moved, change = share * flat_step[n], flat_new[n] - flat_slope[n]
                    work.moved[at, n], work.change[at, n] = moved, change
                    product += moved * change
                if product > 0.0:
                    work.product[at] = product
                    number += 1
            value[:] = tried
            slope[:] = new_slope
            at_value, share = at_tried, 1.0
            _newton_step(slope, work, number, sheet, step)
            fall = np.dot(flat_slope, flat_step)
            if -fall <= tolerance * abs(at_value) + NEGLIGIBLE_N_MM:
                return evaluations
        else:
            above = max(at_tried - at_value - share * fall, NEGLIGIBLE_N_MM)
            share *= min(max(-0.5 * fall * share / above, 0.1), 0.5)
        if evaluations >= max_evaluations:
            return -evaluations
        for k in range(5):
            for i in range(value.shape[1]):
                for j in range(value.shape[2]):
                    tried[k, i, j] = value[k, i, j] + share * step[k, i, j]
