"""Gauss-Newton steps of patches on a pad, damped as by D. W. Marquardt 1963 (doi:10.1137/0111030)."""

# ruff: noqa: PLR0912, PLR0917 - compiled functions, called with positional arguments

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.estimation.pad.patch_forces import OWN
from manytouch.estimation.pad.patch_kernels import SHAPE
from manytouch.estimation.pad.patch_slopes import PatchPad, add_image, fill_slopes

_TRIALS = 12  # of the damping in a step, each ten times the one before
_MOST_STRETCH = 1.0 - 1e-9  # of the squared difference of the principal moments over their sum
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

    And those of an iteration: the number of its steps, and the reduction of the misfit below which it ends.
    """

    least_mm: float
    most_x_mm: float
    most_y_mm: float
    half_x_mm: float
    half_y_mm: float
    step_mm: float
    max_steps: int
    least_gain: float


class Common(NamedTuple):
    """What all contacts have in common.

    Attributes:
        motion: (4, 2 m) marker images by the motion of the image.
        sheet: (c, k, 5, 2 m) by unit loads of each contact, for one standard deviation of each parameter of
            the pad; c = 0 where these are known.
        std: (4 + k,) standard deviations of both.
    """

    motion: Float64[np.ndarray, "4 r"]
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
    own: Float64[np.ndarray, "10"],
    prior: PriorNumbers,
    value: Float64[np.ndarray, "9"],
    slope: Float64[np.ndarray, "9 10"],
) -> None:
    """Differences of the parameters of a contact from those expected, in deviations, and their slopes."""
    xx, yx, yy = own[2], own[3], own[4]
    press, sign = max(abs(own[5]), 1e-9), -1.0 if own[5] < 0.0 else 1.0
    hertz = (0.75 * press * (1.0 - prior.poisson**2) * prior.usual_radius_mm) ** (1.0 / 3.0) / np.sqrt(5.0)
    usual = min(max(hertz, prior.least_mm), prior.most_mm)
    trace = xx * xx + yx * yx + yy * yy
    slope[:] = 0.0
    value[0] = np.log(np.sqrt(abs(xx * yy)) / usual) / prior.root_spread
    slope[0, 2], slope[0, 4] = 0.5 / (prior.root_spread * xx), 0.5 / (prior.root_spread * yy)
    if prior.least_mm < hertz < prior.most_mm:
        slope[0, 5] = -sign / (3.0 * press * prior.root_spread)
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
        by_trace = 2.0 * own[2 + j] / trace
        by_even = (2.0 * xx if j == 0 else -2.0 * own[2 + j]) / trace - even * by_trace
        by_odd = (2.0 * yx if j == 0 else 2.0 * xx if j == 1 else 0.0) / trace - odd * by_trace
        along = bend * (even * by_even + odd * by_odd)
        slope[1, 2 + j] = (grow * by_even + along * even) / spread
        slope[2, 2 + j] = (grow * by_odd + along * odd) / spread
    for j in range(3):
        std = prior.friction * press * (np.sqrt(trace) if j == 2 else 1.0)
        value[3 + j] = own[6 + j] / std
        slope[3 + j, 6 + j] = 1.0 / std
        slope[3 + j, 5] = -sign * value[3 + j] / press
    for j in range(3):
        slope[5, 2 + j] = -value[5] * own[2 + j] / trace
    widened = prior.radial_growth_per_mm * prior.radial_growth_per_mm * abs(xx * yy)
    radial_std = np.sqrt(prior.radial_friction * prior.radial_friction + widened)
    value[6] = (own[9] - prior.radial_mean) / radial_std
    slope[6, 9] = 1.0 / radial_std
    by_root = -0.5 * value[6] * widened / (radial_std * radial_std)
    slope[6, 2], slope[6, 4] = by_root / xx, by_root / yy
    value[7], value[8] = own[0] / prior.size_x_mm, own[1] / prior.size_y_mm
    slope[7, 0], slope[8, 1] = 1.0 / prior.size_x_mm, 1.0 / prior.size_y_mm


@kernel(fastmath=REORDER)
@no_type_check
def _add_scaled(factor: float, values: Float64[np.ndarray, " r"], total: Float64[np.ndarray, " r"]) -> None:
    for k in range(len(total)):
        total[k] += factor * values[k]


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
    first, misfit = OWN * count, 0.0
    residual[:] = 0.0
    for j in range(len(common.std)):
        misfit += (theta[first + j] / common.std[j]) ** 2
    value, slope = np.empty(9), np.empty((9, OWN))
    for number in range(count):
        own = theta[OWN * number : OWN * (number + 1)]
        add_image(own, profile[number], pad, residual)
        if len(common.sheet) > 0:
            for k in range(common.sheet.shape[1]):
                share = theta[first + 4 + k]
                for load in range(5):
                    factor = own[5] * own[9] if load == 4 else own[SHAPE + load]
                    _add_scaled(share * factor, common.sheet[number, k, load], residual)
        prior_terms(own, prior, value, slope)
        for j in range(9):
            misfit += value[j] * value[j]
    for j in range(4):
        _add_scaled(theta[first + j], common.motion[j], residual)
    for k in range(len(residual)):
        residual[k] = measured.moved_px[k] - residual[k]
    return misfit + _weighted(residual, residual, measured.weight)


@kernel()
@no_type_check
def _slopes(theta: Float64[np.ndarray, " p"], count: int, problem: Problem, work: Work) -> None:
    """Pull towards smaller misfits and its curvature at parameters whose residual is known."""
    profile, pad, prior, common, measured = problem
    first, parameters = OWN * count, len(theta)
    slope, curved, pull = work.slope, work.curved, work.pull
    curved[:] = 0.0
    slope[first + 4 :] = 0.0
    for j in range(4):
        slope[first + j] = common.motion[j]
    value, jacobian = np.empty(9), np.empty((9, OWN))
    for j in range(len(common.std)):
        stiffness = 1.0 / common.std[j] ** 2
        curved[first + j, first + j] = stiffness
        pull[first + j] = -stiffness * theta[first + j]
    for number in range(count):
        at = OWN * number
        own = theta[at : at + OWN]
        part = slope[at : at + OWN]
        fill_slopes(own, profile[number], pad, part)
        if len(common.sheet) > 0:
            for k in range(common.sheet.shape[1]):
                for load in range(5):
                    column = common.sheet[number, k, load]
                    _add_scaled(theta[first + 4 + k], column, part[SHAPE + load])
                    factor = own[5] * own[9] if load == 4 else own[SHAPE + load]
                    _add_scaled(factor, column, slope[first + 4 + k])
        _add_scaled(own[9], part[9], part[5])
        part[9] *= own[5]
        prior_terms(own, prior, value, jacobian)
        for i in range(OWN):
            total = 0.0
            for k in range(9):
                total -= jacobian[k, i] * value[k]
            pull[at + i] = total
            for j in range(OWN):
                total = 0.0
                for k in range(9):
                    total += jacobian[k, i] * jacobian[k, j]
                curved[at + i, at + j] = total
    used = parameters if len(common.sheet) > 0 else first + 4
    for i in range(used):
        pull[i] += _weighted(slope[i], work.residual, measured.weight)
        for j in range(i + 1):
            total = _weighted(slope[i], slope[j], measured.weight)
            curved[i, j] += total
            if j != i:
                curved[j, i] += total


@kernel()
@no_type_check
def _solve_damped(
    curved: Float64[np.ndarray, "p p"], damping: float, pull: Float64[np.ndarray, " p"]
) -> Float64[np.ndarray, " p"]:
    """Solution of the damped equations by Cholesky's factor; NaN where they are not positive definite."""
    count = len(pull)
    factor, step = np.empty((count, count)), pull.copy()
    for i in range(count):
        for j in range(i + 1):
            total = curved[i, j] * (1.0 + damping) if i == j else curved[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = np.sqrt(total) if i == j else total / factor[j, j]
    for i in range(count):
        for k in range(i):
            step[i] -= factor[i, k] * step[k]
        step[i] /= factor[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            step[i] -= factor[k, i] * step[k]
        step[i] /= factor[i, i]
    return step


@kernel()
@no_type_check
def _limit(
    theta: Float64[np.ndarray, " p"], moved: Float64[np.ndarray, " p"], count: int, limits: Limits
) -> None:
    """Keep contacts near the old ones, their moments above 0, their centres on the pad."""
    for number in range(count):
        old = theta[OWN * number : OWN * (number + 1)]
        new = moved[OWN * number : OWN * (number + 1)]
        for axis in range(2):
            half_mm = limits.half_x_mm if axis == 0 else limits.half_y_mm
            near_mm = min(max(new[axis], old[axis] - limits.step_mm), old[axis] + limits.step_mm)
            new[axis] = min(max(near_mm, -half_mm), half_mm)
        for j in (2, 4):
            near_mm = min(max(new[j], 0.5 * old[j]), 2.0 * old[j])
            new[j] = min(max(near_mm, limits.least_mm), limits.most_x_mm if j == 2 else limits.most_y_mm)
        new[3] = min(max(new[3], -limits.most_y_mm), limits.most_y_mm)
        new[9] = min(max(new[9], -1.0), 1.0)


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
    """Move parameters to the least misfit, which is returned.

    Args:
        theta: parameters of the contacts, of the motion of the image and of the pad; overwritten.
        count: number of contacts.
        problem, limits: see their classes.
        work: gets the residual, and with `with_curvature` the curvature, of the result.
        with_curvature: whether the curvature of the result is wanted.
    """
    now, damping = _misfit(theta, count, problem, work.residual), 1e-4
    for _ in range(limits.max_steps):
        _slopes(theta, count, problem, work)
        before = now
        for _ in range(_TRIALS):
            step = _solve_damped(work.curved, damping, work.pull)
            if step @ work.pull < limits.least_gain:  # no smaller step reduces the misfit by as much
                break
            moved = theta + step
            _limit(theta, moved, count, limits)
            tried = _misfit(moved, count, problem, work.tried)
            if tried <= now:
                theta[:] = moved
                work.residual[:] = work.tried
                now, damping = tried, 0.1 * damping
                break
            damping = max(10.0 * damping, 1e-3)
        if before - now < _LEAST_SHARE * before + limits.least_gain:
            break
    if with_curvature:
        _slopes(theta, count, problem, work)
    return now
