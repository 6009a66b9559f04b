"""The depth of a contact on a pad against that of an exact layer."""

from dataclasses import replace

import numpy as np
import pytest

from bonded_pad import POISSON, THICKNESS_MM
from layouts import grid_at
from manytouch.estimation.pad.contacts.contact_depth import ContactDepth, contact_depth
from manytouch.estimation.pad.contacts.pad_shape import pad_shape
from manytouch.estimation.pad.estimator import PadEstimator, PadState
from manytouch.estimation.pad.patch_kernels import ROOT_XX, ROOT_YX, ROOT_YY, Profile
from manytouch.estimation.pad.patches import Patches
from manytouch.mechanics.pad.patch_depth import patch_depth, patch_depth_table

FORCE_MM2 = 1e-3


def _depth(state: PadState, parameters: np.ndarray, profile: Profile) -> ContactDepth:
    """Of a patch that presses alone."""
    fit = PadEstimator().fit_frame(state, grid_at(state.model.rest_px, noise_px=0.01, seed=0))
    patches = Patches(parameters=parameters[None], profile=np.array([int(profile)]))
    fit = replace(fit, patches=patches, sheet=np.zeros_like(state.model.by_parameter[:, 0, 0, 0, 0]))
    return contact_depth(state.model, fit, pad_shape(state.model, fit), 0)


def _patch(width: float, place: float, step_mm: float) -> np.ndarray:
    """A round patch with a root in thicknesses, at a place in elements."""
    root_mm = width * THICKNESS_MM
    return np.array([place * step_mm, 0.0, root_mm, 0.0, root_mm, FORCE_MM2, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("profile", [Profile.DOME, Profile.FLAT])
@pytest.mark.parametrize("width", [0.05, 0.1, 0.2, 0.4])
@pytest.mark.parametrize("place", [0.0, 0.5])
def test_a_contact_is_as_deep_as_on_the_layer(
    pad_state: PadState, profile: Profile, width: float, place: float
) -> None:
    """Wherever the nodes are; the pad has sides three thicknesses away."""
    parameters = _patch(width, place, pad_state.model.grid.step_x)
    found = _depth(pad_state, parameters, profile)
    root_mm = parameters[ROOT_XX]
    per_force = patch_depth(root_mm, 0.0, root_mm, int(profile), patch_depth_table(THICKNESS_MM, POISSON))
    assert found.depth_mm == pytest.approx(FORCE_MM2 * per_force, rel=0.015)


@pytest.mark.parametrize("profile", [Profile.DOME, Profile.FLAT])
@pytest.mark.parametrize("parameter", [ROOT_XX, ROOT_YX, ROOT_YY])
def test_the_slopes_of_the_depth_are_those_of_differences(
    pad_state: PadState, profile: Profile, parameter: int
) -> None:
    parameters = np.array([1.2, -0.7, 1.3, 0.4, 0.8, FORCE_MM2, 0.0, 0.0, 0.0, 0.0])
    found = _depth(pad_state, parameters, profile).by_parameter[parameter]
    step = np.where(np.arange(10) == parameter, 1e-3, 0.0)
    less, more = (_depth(pad_state, parameters + sign * step, profile).depth_mm for sign in (-1.0, 1.0))
    assert found == pytest.approx((more - less) / 2e-3, rel=0.02, abs=1e-6 * FORCE_MM2)
