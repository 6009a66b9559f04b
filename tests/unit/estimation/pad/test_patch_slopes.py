"""Images of contacts under their loads and their slopes, against those by unit loads and differences."""

from functools import cache

import numpy as np
import pytest

from manytouch.estimation.pad.estimator import PadEstimator, PadState
from manytouch.estimation.pad.patch_forces import (
    FORCE,
    PARAMETER_COUNT,
    RADIAL_SHEAR,
    add_answers,
    add_tractions,
    fill_effects,
    fill_force_slopes,
)
from manytouch.estimation.pad.patch_kernels import FAR_POINTS, POINTS, Profile, density
from manytouch.estimation.pad.patch_slopes import PatchPad, add_image, fill_slopes
from manytouch.estimation.pad.patch_steps import prior_terms

CONTACT = np.array([2.1, -1.0, 1.1, 0.2, 0.9, 0.3, 0.1, -0.05, 0.02, -0.1])
FITTER = PadEstimator().fitter


def pad_of(state: PadState) -> PatchPad:
    model = state.model
    return PatchPad(model.grid, model.table, model.markers, model.by_sides)


def image_px(state: PadState, parameters: np.ndarray, profile: Profile) -> np.ndarray:
    """By the images of unit loads, with all points for every marker."""
    load = np.array([*parameters[5:9], parameters[FORCE] * parameters[RADIAL_SHEAR]])
    return np.asarray(load @ unit_images_px(state, profile, *parameters[:5]))


@cache
def unit_images_px(state: PadState, profile: Profile, *shape: float) -> np.ndarray:
    return FITTER.images(state.model, np.array([shape]), profile).column[0]


@pytest.mark.parametrize("profile", Profile)
def test_few_points_have_the_moments_of_many(profile: Profile) -> None:
    for x_power, y_power in ((0, 0), (1, 0), (2, 0), (1, 1), (0, 2), (3, 0), (4, 0), (2, 2), (1, 3), (3, 2)):
        few, many = (
            p[:, 2] @ (p[:, 0] ** x_power * p[:, 1] ** y_power)
            for p in (FAR_POINTS[profile], POINTS[profile])
        )
        np.testing.assert_allclose(few, many, atol=1e-9)


@pytest.mark.parametrize("profile", Profile)
def test_images_are_those_of_all_points(pad_state: PadState, profile: Profile) -> None:
    found = np.zeros(2 * len(pad_state.model.rest_px))
    add_image(CONTACT, int(profile), pad_of(pad_state), found)
    expected = image_px(pad_state, CONTACT, profile)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("profile", Profile)
def test_slopes_are_those_of_differences(pad_state: PadState, profile: Profile) -> None:
    slope = np.empty((PARAMETER_COUNT, 2 * len(pad_state.model.rest_px)))
    fill_slopes(CONTACT, int(profile), pad_of(pad_state), slope)
    slope[5] += CONTACT[9] * slope[9]
    slope[9] *= CONTACT[5]
    for parameter in range(PARAMETER_COUNT):
        step = 1e-4 * np.eye(PARAMETER_COUNT)[parameter]
        above, below = (image_px(pad_state, CONTACT + sign * step, profile) for sign in (1.0, -1.0))
        expected = (above - below) / 2e-4
        np.testing.assert_allclose(slope[parameter], expected, atol=0.01 * np.abs(expected).max())


def test_slopes_of_the_prior_are_those_of_differences(pad_state: PadState) -> None:
    numbers = FITTER.prior.numbers(pad_state.model)
    value, slope = np.empty(9), np.empty((9, PARAMETER_COUNT))
    prior_terms(CONTACT, numbers, value, slope)
    above, below, unused = np.empty(9), np.empty(9), np.empty((9, PARAMETER_COUNT))
    for parameter in range(PARAMETER_COUNT):
        step = 1e-6 * np.eye(PARAMETER_COUNT)[parameter]
        prior_terms(CONTACT + step, numbers, above, unused)
        prior_terms(CONTACT - step, numbers, below, unused)
        np.testing.assert_allclose(slope[:, parameter], (above - below) / 2e-6, rtol=1e-5, atol=1e-6)


def test_responses_are_sums_over_nodes(pad_state: PadState) -> None:
    model, random = pad_state.model, np.random.default_rng(1)
    nodal_mm2 = random.normal(size=(model.patch.node_count, 3))
    nodal_mm2[::2] = 0.0
    found = np.zeros((len(model.rest_px), 3))
    add_answers(nodal_mm2, model.marker, found)
    np.testing.assert_allclose(found, np.tensordot(nodal_mm2, model.marker, axes=2), atol=1e-12)


@pytest.mark.parametrize("profile", Profile)
@pytest.mark.parametrize(
    "shape", [(2.1, -1.0, 0.6, 0.2, 0.5), (2.1, -1.0, 2.1, 0.4, 1.9), (9.0, -7.0, 4.5, 0, 4)]
)
def test_slopes_of_nodal_forces_are_those_of_differences(
    pad_state: PadState, profile: Profile, shape: tuple[float, ...]
) -> None:
    """With few, more and most points; the last contact reaches beyond two sides of the pad."""
    grid, contact = pad_state.model.grid, np.array([*shape, *CONTACT[5:]])
    level = density(contact, grid)
    size = (grid.count_x + 3, grid.count_y + 3)
    slope = np.empty((PARAMETER_COUNT, 3, *size))
    fill_force_slopes(contact, int(profile), grid, slope)
    slope[FORCE] += contact[RADIAL_SHEAR] * slope[RADIAL_SHEAR]
    slope[RADIAL_SHEAR] *= contact[FORCE]
    for parameter in range(PARAMETER_COUNT):
        step = 1e-5 * np.eye(PARAMETER_COUNT)[parameter]
        moved = np.zeros((2, 3, *size))
        for sign, nodal in zip((1.0, -1.0), moved, strict=True):
            add_tractions(contact + sign * step, int(profile), grid, level, np.empty((3, *size)), nodal)
        expected = (moved[0] - moved[1]) / 2e-5
        np.testing.assert_allclose(slope[parameter], expected, atol=1e-4 * np.abs(expected).max())


def test_effects_of_unit_weight_are_the_loads(pad_state: PadState) -> None:
    """With effects of 1 along one axis, the sum is the force along it: its slopes are those of the loads."""
    grid = pad_state.model.grid
    effect = np.zeros((grid.count_x + 3, grid.count_y + 3, 3))
    effect[:, :, 2] = 1.0
    slope = np.empty(PARAMETER_COUNT)
    fill_effects(CONTACT, int(Profile.DOME), grid, effect, slope)
    np.testing.assert_allclose(slope, -np.eye(PARAMETER_COUNT)[FORCE], atol=1e-9)
