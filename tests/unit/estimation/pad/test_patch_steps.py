"""Steps of the fit of a pad against plain numpy and against scipy's least squares."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from manytouch.estimation.pad.estimator import PadEstimator, PadState
from manytouch.estimation.pad.pad_model import MOTIONS
from manytouch.estimation.pad.patch_forces import PARAMETER_COUNT
from manytouch.estimation.pad.patch_kernels import Profile
from manytouch.estimation.pad.patch_slopes import PatchPad, add_image
from manytouch.estimation.pad.patch_steps import prior_terms
from manytouch.estimation.pad.patches import Patches

FITTER = PadEstimator().fitter
TRUE = np.array([1.3, -0.7, 0.9, 0.1, 0.8, 2.0, 0.3, -0.1, 0.2, 0.05])
MOTION_STD = np.repeat([FITTER.shift_px, FITTER.growth, FITTER.turn_rad, FITTER.tilt_rad], [2, 1, 1, 2])


def residuals(theta: np.ndarray, state: PadState, measured_px: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """What parameters of a contact and of the motion of the image leave, whitened, and their priors."""
    model = state.model
    parameters, motion = theta[:PARAMETER_COUNT], theta[PARAMETER_COUNT:]
    image = np.zeros(len(measured_px))
    add_image(
        parameters, int(Profile.DOME), PatchPad(model.grid, model.table, model.markers, model.by_sides), image
    )
    image += motion @ model.motion
    value, slope = np.empty(9), np.empty((9, PARAMETER_COUNT))
    prior_terms(parameters, FITTER.prior.numbers(model), value, slope)
    return np.concatenate([np.sqrt(weight) * (measured_px - image), value, motion / MOTION_STD])


def prior_values(parameters: np.ndarray, state: PadState) -> np.ndarray:
    """Differences of the parameters of a contact from those expected, in deviations, as `PatchPrior` says."""
    prior, thickness_mm = FITTER.prior, state.model.thickness_mm
    x, y, xx, yx, yy, press, shear_x, shear_y, torque, radial = parameters
    root = np.array([[xx, 0.0], [yx, yy]])
    size, axes = np.linalg.eigh(root @ root.T)
    mean = (size[0] * size[1]) ** 0.25
    radius_mm = np.cbrt(
        0.75 * press * (1.0 - state.model.poisson**2) * prior.usual_radius * thickness_mm
    )  # H. Hertz 1882; the root of the second moment is that over the root of 5
    usual = np.clip(radius_mm / np.sqrt(5.0), *(limit * thickness_mm for limit in prior.root_limits))
    stretch = 0.5 * np.log(size[1] / size[0]) / prior.stretch_spread
    twice = 2.0 * np.arctan2(axes[1, 1], axes[0, 1])
    friction = prior.friction * press
    radial_std = np.hypot(prior.radial_friction, prior.radial_growth * mean / thickness_mm)
    wide_mm, high_mm = state.model.patch.size_mm
    return np.array(
        [
            np.log(mean / usual) / prior.root_spread,
            stretch * np.cos(twice),
            stretch * np.sin(twice),
            shear_x / friction,
            shear_y / friction,
            torque / (friction * np.sqrt(size.sum())),
            (radial - prior.radial_mean) / radial_std,
            x / wide_mm,
            y / high_mm,
        ]
    )


@pytest.mark.parametrize("seed", range(6))
def test_the_prior_is_that_of_its_description(pad_state: PadState, seed: int) -> None:
    parameters = TRUE * np.random.default_rng(seed).uniform(0.6, 1.4, PARAMETER_COUNT)
    parameters[3] *= 3.0  # an oblong contact
    numbers = FITTER.prior.numbers(pad_state.model)
    value, slope = np.empty(9), np.empty((9, PARAMETER_COUNT))
    prior_terms(parameters, numbers, value, slope)
    np.testing.assert_allclose(value, prior_values(parameters, pad_state), rtol=1e-9)
    for number in range(PARAMETER_COUNT):
        step = np.zeros(PARAMETER_COUNT)
        step[number] = 1e-6
        up, down = (prior_values(parameters + sign * step, pad_state) for sign in (1.0, -1.0))
        np.testing.assert_allclose(slope[:, number], (up - down) / 2e-6, atol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_the_fit_is_the_least_squares_of_scipy(pad_state: PadState, seed: int) -> None:
    chance = np.random.default_rng(seed)
    model = pad_state.model
    measured_px = np.zeros(2 * len(model.rest_px))
    true = TRUE * chance.uniform(0.8, 1.2, PARAMETER_COUNT)
    add_image(
        true, int(Profile.DOME), PatchPad(model.grid, model.table, model.markers, model.by_sides), measured_px
    )
    measured_px += chance.normal(0.0, 0.02, len(measured_px))
    weight = np.full(len(measured_px), 0.02**-2)
    weight[::17] = 0.0
    start = TRUE.copy()
    found = FITTER(
        model,
        Patches(parameters=start[None], profile=np.zeros(1, dtype=np.int64)),
        measured_px,
        weight,
        is_sheet_known=True,
    )
    theta = np.concatenate([found.patches.parameters[0], found.motion])
    left = residuals(theta, pad_state, measured_px, weight)
    assert found.misfit == pytest.approx(left @ left, rel=1e-9)
    is_seen = weight > 0.0
    np.testing.assert_allclose(found.residual_px[is_seen], 0.02 * left[: len(weight)][is_seen], atol=1e-9)
    begin = np.concatenate([start, np.zeros(MOTIONS)])
    best = least_squares(residuals, begin, args=(pad_state, measured_px, weight), x_scale="jac")
    assert found.misfit == pytest.approx(2.0 * best.cost, rel=1e-4)
    deviations = np.sqrt(np.diag(found.covariance))[: PARAMETER_COUNT + MOTIONS]
    assert (np.abs(theta - best.x) < 0.1 * deviations).all()


def images_of(state: PadState) -> tuple[np.ndarray, np.ndarray]:
    """(2 m,) images of a contact with their errors, and their weights."""
    model = state.model
    measured_px = np.zeros(2 * len(model.rest_px))
    pad = PatchPad(model.grid, model.table, model.markers, model.by_sides)
    add_image(TRUE, int(Profile.DOME), pad, measured_px)
    measured_px += np.random.default_rng(0).normal(0.0, 0.02, len(measured_px))
    return measured_px, np.full(len(measured_px), 0.02**-2)


def guess(factor: float) -> Patches:
    return Patches(parameters=factor * TRUE[None], profile=np.zeros(1, dtype=np.int64))


@pytest.mark.parametrize("factor", [1.05, 1.15, 1.3])
def test_covariances_are_those_of_the_result(pad_state: PadState, factor: float) -> None:
    """Without a step, a fit that begins where another one ended has the same."""
    images = images_of(pad_state)
    found = FITTER(pad_state.model, guess(factor), *images, is_sheet_known=True)
    there = replace(FITTER, max_steps=0)(pad_state.model, found.patches, *images, is_sheet_known=True)
    np.testing.assert_allclose(
        np.sqrt(np.diag(there.covariance)), np.sqrt(np.diag(found.covariance)), rtol=1e-9
    )


def test_a_fit_ends_early_only_where_it_cannot_reach_the_misfit_that_is_needed(pad_state: PadState) -> None:
    images = images_of(pad_state)

    def misfit(needed: float) -> float:
        found = FITTER(
            pad_state.model,
            guess(1.3),
            *images,
            is_sheet_known=True,
            with_covariance=False,
            needed=needed,
        )
        return found.misfit

    least = misfit(np.inf)
    assert misfit(1.001 * least) == least
    assert misfit(0.5 * least) > least


@pytest.mark.parametrize("profile", list(Profile))
def test_a_fit_that_begins_with_a_press_ends_with_a_press(pad_state: PadState, profile: Profile) -> None:
    """From a rim that is too wide, the images of a pull with an inward shear are those that fit next."""
    model, true = pad_state.model, TRUE.copy()
    true[:6], true[6:] = (0.3, -0.2, 2.0, 0.0, 2.0, 5.0), 0.0
    measured_px = np.zeros(2 * len(model.rest_px))
    pad = PatchPad(model.grid, model.table, model.markers, model.by_sides)
    add_image(true, int(profile), pad, measured_px)
    guess = true.copy()
    guess[[2, 4]] *= 4.0
    patches = Patches(parameters=guess[None], profile=np.array([int(Profile.RIM)]))
    weight = np.full(len(measured_px), 1e5)
    fit = FITTER(model, patches, measured_px, weight, is_sheet_known=True, with_covariance=False)
    assert fit.force_mm2[0] > 0.0
