"""Steps of the fit of a pad against plain numpy and against scipy's least squares."""

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
MOTION_STD = np.array([FITTER.shift_px, FITTER.shift_px, FITTER.growth, FITTER.turn_rad])


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
