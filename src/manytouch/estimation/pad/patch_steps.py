"""Gauss-Newton steps of patches on a pad, damped as by D. W. Marquardt 1963 (doi:10.1137/0111030)."""

# ruff: noqa: PLR0917 - compiled functions, called with positional arguments

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.estimation.kernels import solve_damped
from manytouch.estimation.pad.patch_forces import FORCE, PARAMETER_COUNT, RADIAL_SHEAR, SHEAR_X, add_scaled
from manytouch.estimation.pad.patch_kernels import CENTRE_X, CENTRE_Y, ROOT_XX, ROOT_YX, ROOT_YY
from manytouch.estimation.pad.patch_slopes import PatchPad, add_image, fill_slopes

_TRIALS = 12  # of the damping in a step, each ten times the one before
_MOST_STRETCH = 1.0 - 1e-9  # of the squared difference of the principal moments over their sum
_SMALL = 2e-4  # damping that hardly shortens a step
_MOST_GAIN, _MORE = 10.0, 0.1
"""By how much all further steps may reduce the misfit: over what the next one promises, and in addition over
the misfit. The largest ratios to the former were 3.1 in fits of other profiles and 7.8 in those of new
contacts, in 801 frames of 25 scenes; with errors far beyond those stated, steps gained 4 % unannounced."""
_LEAST_PRESS = 0.1  # share of the normal force of a contact that a step leaves: a choice
_LEAST_SHARE = 1e-6  # of the misfit by which a step reduces it, below which the iteration ends


class PriorNumbers(NamedTuple):
    """Numbers of `PatchPrior` on a pad, lengths in mm."""

    usual_radius_mm: float
    poisson: float
    least_mm: float
    most_mm: float
    root_spread: float
    stretch_spread: float
    friction: float
    radial_mean: float
    radial_friction: float
    radial_growth_per_mm: float
    size_x_mm: float
    size_y_mm: float


class Limits(NamedTuple):
    """Limits of a contact, mm: roots of its moments, half the size of the pad, largest motion in a step.

    And those of an iteration: the number of its steps, the reduction of the misfit below which it ends, and
    the misfit above which its result is not used.
    """

    least_mm: float
    most_x_mm: float
    most_y_mm: float
    half_x_mm: float
    half_y_mm: float
    step_mm: float
    max_steps: int
    least_gain: float
    needed: float


class Common(NamedTuple):
    """What all contacts have in common.

    Attributes:
        motion: (v, 2 m) marker images by the motion of the image.
        sheet: (c, k, 5, 2 m) by unit loads of each contact, for one standard deviation of each parameter of
            the pad; c = 0 where these are known.
        std: (v + k,) standard deviations of both.
    """

    motion: Float64[np.ndarray, "v r"]
    sheet: Float64[np.ndarray, "c k 5 r"]
    std: Float64[np.ndarray, " s"]


class Measured(NamedTuple):
    """(2 m,) displacements of marker images, px, and their inverse variances, 0 where not seen."""

    moved_px: Float64[np.ndarray, " r"]
    weight: Float64[np.ndarray, " r"]


class Problem(NamedTuple):
    """What decides the misfit of parameters: see the classes of its parts.

    `profile` (c,) are those of the pressures of the contacts.
    """

    profile: Int64[np.ndarray, " c"]
    pad: PatchPad
    prior: PriorNumbers
    common: Common
    measured: Measured


class Work(NamedTuple):
    """Results of an iteration, and what it overwrites: p parameters, r images."""

    residual: Float64[np.ndarray, " r"]
    tried: Float64[np.ndarray, " r"]
    slope: Float64[np.ndarray, "p r"]
    curved: Float64[np.ndarray, "p p"]
    pull: Float64[np.ndarray, " p"]


@kernel()
@no_type_check
def prior_terms(
    parameters: Float64[np.ndarray, "10"],
    prior: PriorNumbers,
    value: Float64[np.ndarray, "9"],
    slope: Float64[np.ndarray, "9 10"],
) -> None:
    """Differences of the parameters of a contact from those expected, in deviations, and their slopes."""
    xx, yx, yy = parameters[ROOT_XX], parameters[ROOT_YX], parameters[ROOT_YY]
    press, sign = max(abs(parameters[FORCE]), 1e-9), -1.0 if parameters[FORCE] < 0.0 else 1.0
    hertz = (0.75 * press * (1.0 - prior.poisson**2) * prior.usual_radius_mm) ** (1.0 / 3.0) / np.sqrt(5.0)
    usual = min(max(hertz, prior.least_mm), prior.most_mm)
    trace = xx * xx + yx * yx + yy * yy
    slope[:] = 0.0
    value[0] = np.log(np.sqrt(abs(xx * yy)) / usual) / prior.root_spread
    slope[0, ROOT_XX], slope[0, ROOT_YY] = 0.5 / (prior.root_spread * xx), 0.5 / (prior.root_spread * yy)
    if prior.least_mm < hertz < prior.most_mm:
        slope[0, FORCE] = -sign / (3.0 * press * prior.root_spread)
    # half the logarithm of the ratio of the principal roots' squares, along twice the angle of the longer one
    even, odd = (xx * xx - yx * yx - yy * yy) / trace, 2.0 * xx * yx / trace
    square = min(even * even + odd * odd, _MOST_STRETCH)
    stretch = np.sqrt(square)
    grow, bend = 1.0 + square / 3.0, 2.0 / 3.0 + 0.8 * square
    if square > 1e-4:
        grow = np.arctanh(stretch) / stretch
        bend = (1.0 / (1.0 - square) - grow) / square
    spread = prior.stretch_spread
    value[1], value[2] = grow * even / spread, grow * odd / spread
    for j in range(3):
        by_trace = 2.0 * parameters[ROOT_XX + j] / trace
        by_even = (2.0 * xx if j == 0 else -2.0 * parameters[ROOT_XX + j]) / trace - even * by_trace
        by_odd = (2.0 * yx if j == 0 else 2.0 * xx if j == 1 else 0.0) / trace - odd * by_trace
        along = bend * (even * by_even + odd * by_odd)
        slope[1, ROOT_XX + j] = (grow * by_even + along * even) / spread
        slope[2, ROOT_XX + j] = (grow * by_odd + along * odd) / spread
    for j in range(3):
        std = prior.friction * press * (np.sqrt(trace) if j == 2 else 1.0)
        value[3 + j] = parameters[SHEAR_X + j] / std
        slope[3 + j, SHEAR_X + j] = 1.0 / std
        slope[3 + j, FORCE] = -sign * value[3 + j] / press
    for j in range(3):
        slope[5, ROOT_XX + j] = -value[5] * parameters[ROOT_XX + j] / trace
    widened = prior.radial_growth_per_mm * prior.radial_growth_per_mm * abs(xx * yy)
    radial_std = np.sqrt(prior.radial_friction * prior.radial_friction + widened)
    value[6] = (parameters[RADIAL_SHEAR] - prior.radial_mean) / radial_std
    slope[6, RADIAL_SHEAR] = 1.0 / radial_std
    by_root = -0.5 * value[6] * widened / (radial_std * radial_std)
    slope[6, ROOT_XX], slope[6, ROOT_YY] = by_root / xx, by_root / yy
    value[7], value[8] = parameters[CENTRE_X] / prior.size_x_mm, parameters[CENTRE_Y] / prior.size_y_mm
    slope[7, CENTRE_X], slope[8, CENTRE_Y] = 1.0 / prior.size_x_mm, 1.0 / prior.size_y_mm


@kernel(fastmath=REORDER)
@no_type_check
def _weighted(
    first: Float64[np.ndarray, " r"], second: Float64[np.ndarray, " r"], weight: Float64[np.ndarray, " r"]
) -> float:
    total = 0.0
    for k in range(len(weight)):
        total += weight[k] * first[k] * second[k]
    return total


@kernel()
@no_type_check
def _misfit(
    theta: Float64[np.ndarray, " p"], count: int, problem: Problem, residual: Float64[np.ndarray, " r"]
) -> float:
    """Misfit of parameters, and what they leave of the images."""
    profile, pad, prior, common, measured = problem
    first, motions, misfit = PARAMETER_COUNT * count, len(common.motion), 0.0
    residual[:] = 0.0
    for j in range(len(common.std)):
        misfit += (theta[first + j] / common.std[j]) ** 2
    value, slope = np.empty(9), np.empty((9, PARAMETER_COUNT))
    for number in range(count):
        parameters = theta[PARAMETER_COUNT * number : PARAMETER_COUNT * (number + 1)]
        add_image(parameters, profile[number], pad, residual)
        if len(common.sheet) > 0:
            for k in range(common.sheet.shape[1]):
                share = theta[first + motions + k]
                for load in range(5):
                    factor = (
                        parameters[FORCE] * parameters[RADIAL_SHEAR]
                        if load == 4
                        else parameters[FORCE + load]
                    )
                    add_scaled(share * factor, common.sheet[number, k, load], residual)
        prior_terms(parameters, prior, value, slope)
        for j in range(9):
            misfit += value[j] * value[j]
    for j in range(motions):
        add_scaled(theta[first + j], common.motion[j], residual)
    for k in range(len(residual)):
        residual[k] = measured.moved_px[k] - residual[k]
    return misfit + _weighted(residual, residual, measured.weight)


@kernel()
@no_type_check
def _slopes(theta: Float64[np.ndarray, " p"], count: int, problem: Problem, work: Work) -> None:
    """Pull towards smaller misfits and its curvature at parameters whose residual is known."""
    profile, pad, prior, common, measured = problem
    first, motions, unknowns = PARAMETER_COUNT * count, len(common.motion), len(theta)
    slope, curved, pull = work.slope, work.curved, work.pull
    curved[:] = 0.0
    slope[first : first + motions] = common.motion
    slope[first + motions :] = 0.0
    value, jacobian = np.empty(9), np.empty((9, PARAMETER_COUNT))
    for j in range(len(common.std)):
        stiffness = 1.0 / common.std[j] ** 2
        curved[first + j, first + j] = stiffness
        pull[first + j] = -stiffness * theta[first + j]
    for number in range(count):
        at = PARAMETER_COUNT * number
        parameters = theta[at : at + PARAMETER_COUNT]
        part = slope[at : at + PARAMETER_COUNT]
        fill_slopes(parameters, profile[number], pad, part)
        if len(common.sheet) > 0:
            for k in range(common.sheet.shape[1]):
                for load in range(5):
                    column = common.sheet[number, k, load]
                    add_scaled(theta[first + motions + k], column, part[FORCE + load])
                    factor = (
                        parameters[FORCE] * parameters[RADIAL_SHEAR]
                        if load == 4
                        else parameters[FORCE + load]
                    )
                    add_scaled(factor, column, slope[first + motions + k])
        add_scaled(parameters[RADIAL_SHEAR], part[RADIAL_SHEAR], part[FORCE])
        part[RADIAL_SHEAR] *= parameters[FORCE]
        prior_terms(parameters, prior, value, jacobian)
        for i in range(PARAMETER_COUNT):
            total = 0.0
            for k in range(9):
                total -= jacobian[k, i] * value[k]
            pull[at + i] = total
            for j in range(PARAMETER_COUNT):
                total = 0.0
                for k in range(9):
                    total += jacobian[k, i] * jacobian[k, j]
                curved[at + i, at + j] = total
    used = slope[: unknowns if len(common.sheet) > 0 else first + motions]
    weighted = np.empty(used.shape)
    for i in range(len(used)):
        for k in range(len(measured.weight)):
            weighted[i, k] = measured.weight[k] * used[i, k]
    pull[: len(used)] += weighted @ work.residual
    curved[: len(used), : len(used)] += weighted @ used.T


@kernel()
@no_type_check
def _limit(
    theta: Float64[np.ndarray, " p"], moved: Float64[np.ndarray, " p"], count: int, limits: Limits
) -> None:
    """Keep contacts near the old ones, pressing, their moments above 0, their centres on the pad."""
    for number in range(count):
        old = theta[PARAMETER_COUNT * number : PARAMETER_COUNT * (number + 1)]
        new = moved[PARAMETER_COUNT * number : PARAMETER_COUNT * (number + 1)]
        for axis in range(2):
            half_mm = limits.half_x_mm if axis == 0 else limits.half_y_mm
            near_mm = min(max(new[axis], old[axis] - limits.step_mm), old[axis] + limits.step_mm)
            new[axis] = min(max(near_mm, -half_mm), half_mm)
        for j in (ROOT_XX, ROOT_YY):
            near_mm = min(max(new[j], 0.5 * old[j]), 2.0 * old[j])
            new[j] = min(
                max(near_mm, limits.least_mm), limits.most_x_mm if j == ROOT_XX else limits.most_y_mm
            )
        new[ROOT_YX] = min(max(new[ROOT_YX], -limits.most_y_mm), limits.most_y_mm)
        new[RADIAL_SHEAR] = min(max(new[RADIAL_SHEAR], -1.0), 1.0)
        if old[FORCE] > 0.0:  # an object presses and does not pull
            new[FORCE] = max(new[FORCE], _LEAST_PRESS * old[FORCE])


@kernel()
@no_type_check
def iterate(
    theta: Float64[np.ndarray, " p"],
    count: int,
    problem: Problem,
    limits: Limits,
    work: Work,
    with_curvature: bool,
) -> float:
    """Move parameters to the least misfit, which is returned; a larger one if that is not below `needed`.

    Args:
        theta: parameters of the contacts, of the motion of the image and of the pad; overwritten.
        count: number of contacts.
        problem, limits: see their classes.
        work: gets the residual, and with `with_curvature` the curvature, of the result.
        with_curvature: whether the curvature of the result is wanted.
    """
    now, damping = _misfit(theta, count, problem, work.residual), 1e-4
    is_known, is_quadratic = False, False  # slopes of the result, and that no step would gain more
    for _ in range(limits.max_steps):
        _slopes(theta, count, problem, work)
        before, is_known = now, True
        for _ in range(_TRIALS):
            step = solve_damped(work.curved, damping, work.pull)
            expected = step @ work.pull
            if expected < limits.least_gain:  # no smaller step reduces the misfit by as much
                break
            if (1.0 - _MORE) * now - _MOST_GAIN * expected > limits.needed:
                return now
            moved = theta + step
            _limit(theta, moved, count, limits)
            tried = _misfit(moved, count, problem, work.tried)
            if tried <= now:
                theta[:] = moved
                work.residual[:] = work.tried
                is_quadratic = damping < _SMALL and abs(now - tried - expected) < limits.least_gain
                now, damping, is_known = tried, 0.1 * damping, False
                break
            damping = max(10.0 * damping, 1e-3)
        if is_quadratic or before - now < _LEAST_SHARE * before + limits.least_gain:
            break
    if with_curvature and not is_known:
        _slopes(theta, count, problem, work)
    return now
