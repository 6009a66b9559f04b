"""Friction of contacts on sheets that are deformed by the model's own mechanics."""

from dataclasses import replace

import numpy as np
import pytest

from bent_sheets import YOUNG_MPA, bent, grid_of, sensor_of
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.clusters.friction_fits import Friction, FrictionFits
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.values import Contact, Status

PRESSES = ((-12.0, -6.0, 0.6), (10.0, 5.0, 0.9))
RATIOS = ((0.5, -0.2), (-0.3, 0.4))
ESTIMATE = MechanicsEstimator()


@pytest.fixture(scope="module")
def start() -> MechanicsState:
    return ESTIMATE.start(sensor_of())


@pytest.fixture(scope="module")
def coefficient_mm(start: MechanicsState) -> np.ndarray:
    return bent(start.model, *PRESSES, friction=RATIOS)


class Kept(FrictionFits):
    """Friction fits whose last call is kept, or that find nothing."""

    def __init__(self, *, is_on: bool = True) -> None:
        super().__init__()
        object.__setattr__(self, "is_on", is_on)
        object.__setattr__(self, "calls", [])

    def __call__(self, *arguments):
        found = super().__call__(*arguments)
        self.calls.append((arguments, found))
        return found if self.is_on else None


def contacts_of(
    start, coefficient_mm, fits: FrictionFits, *, seed: int = 0, noise_px: float = 0.02
) -> list[Contact]:
    estimate, state = replace(ESTIMATE, friction_fits=fits), start
    for k in range(4):
        grid = grid_of(start.model, coefficient_mm, noise_px, seed=10 * seed + k)
        state, _, contacts = estimate.step(state, grid)
    return sorted(contacts.touching, key=lambda contact: float(contact.centre_mm[0]))


def shears_N() -> np.ndarray:
    """(2, 2) true shear of each press."""
    return np.array(
        [press * YOUNG_MPA * np.array(ratio) for (*_, press), ratio in zip(PRESSES, RATIOS, strict=True)]
    )


def test_the_prior_does_not_reduce_shear(start, coefficient_mm) -> None:
    true_N = shears_N()
    share = {}
    for is_on in (True, False):
        found = contacts_of(start, coefficient_mm, Kept(is_on=is_on), noise_px=0.06)
        pairs = zip(found, true_N, strict=True)
        share[is_on] = [float(contact.force_N[:2] @ true / (true @ true)) for contact, true in pairs]
    np.testing.assert_allclose(share[True], 1.0, atol=0.06)
    assert min(share[False]) < 0.85, "the fit itself does not reduce them: the line before could not fail"


def test_deviations_of_shear_contain_its_errors(start, coefficient_mm) -> None:
    true_N = shears_N()
    white = [
        (contact.force_N[axis] - true[axis]) / contact.std(f"shear_{'xy'[axis]}")
        for seed in range(6)
        for contact, true in zip(
            contacts_of(start, coefficient_mm, FrictionFits(), seed=seed), true_N, strict=True
        )
        for axis in range(2)
    ]
    assert np.abs(white).max() < 3.0
    assert np.mean(np.square(white)) < 1.5


def test_it_solves_the_normal_equations_of_coefficients_and_ratios(start, coefficient_mm) -> None:
    fits = Kept()
    contacts_of(start, coefficient_mm, fits)
    (fit, clusters, force_mm2), friction = fits.calls[-1]
    assert isinstance(friction, Friction)
    linearisation, weight = fit.posterior.linearisation, fit.posterior.weight.ravel()
    free = np.flatnonzero(linearisation.shell.patch.is_free)
    by_balance = linearisation.balance_rows(free // 3, free % 3).reshape(len(free), -1)[:, free]
    by_marker = np.zeros((2 * len(fit.residual_px), force_mm2.size))
    for m, (nodes, rows) in enumerate(
        zip(linearisation.dots.tips.basis.node, linearisation.derivative, strict=True)
    ):
        for axis in range(2):
            by_marker[2 * m + axis].reshape(-1, 3)[nodes] += rows[axis]
    information = np.einsum("mii->mi", fit.posterior.information).ravel()
    by_marker = by_marker[:, free]
    hessian = by_marker.T @ (information[:, None] * by_marker)
    hessian += by_balance.T @ (weight[free, None] * by_balance)
    mean = np.zeros((2 * len(clusters), *force_mm2.shape))
    for k in range(len(clusters)):
        of_it = clusters.label == k
        for axis in range(2):
            mean[2 * k + axis, of_it, axis] = np.maximum(-force_mm2[of_it, 2], 0.0)
    mean = mean.reshape(len(mean), -1)[:, free]
    residual = np.where(information > 0.0, np.nan_to_num(fit.residual_px).ravel(), 0.0)
    gradient = by_marker.T @ (information * residual)
    gradient += by_balance.T @ (weight[free] * fit.balance_mm2.ravel()[free])
    pull = (mean * weight[free]) @ by_balance
    response = np.linalg.solve(hessian, pull.T)
    curvature = (mean * weight[free]) @ mean.T - pull @ response
    known = (mean * weight[free]) @ fit.balance_mm2.ravel()[free] - gradient @ response
    wide = np.linalg.inv(curvature + np.eye(len(mean)) / FrictionFits().ratio_std ** 2)
    first, noise = (wide @ known).reshape(-1, 2), np.diag(wide).reshape(-1, 2)
    variance = np.clip(((first**2).sum(axis=1) - noise.sum(axis=1)) / 2.0, 1e-12, 0.25)
    ratio = np.linalg.solve(curvature + np.diag(np.repeat(1.0 / variance, 2)), known)
    np.testing.assert_allclose(friction.ratio.ravel(), ratio, atol=0.01)
    assert np.abs(ratio).max() > 0.3
    change_mm = response @ ratio
    found_mm = friction.change_mm.ravel()[free]
    np.testing.assert_allclose(found_mm, change_mm, atol=0.02 * np.abs(change_mm).max())
    place_mm = linearisation.shell.patch.place_mm
    press_mm2 = np.zeros(force_mm2.size)
    press_mm2[free] = -by_balance @ change_mm
    for k in range(len(clusters)):
        of_it = clusters.label == k
        moment = press_mm2[2::3][of_it] @ (place_mm[of_it] - clusters.centre_mm[k])
        expected_mm = moment / clusters.normal_mm2[k]
        np.testing.assert_allclose(friction.centre_change_mm[k], expected_mm, atol=0.01)


def test_noise_is_no_friction(start) -> None:
    coefficient_mm = bent(start.model, *PRESSES)
    fits = Kept()
    contacts_of(start, coefficient_mm, fits, noise_px=0.1)
    ratios = np.array([friction.ratio for _, friction in fits.calls if friction is not None])
    assert len(ratios) > 2
    assert np.median(np.abs(ratios)) < 0.02
    assert np.abs(ratios).max() < 0.2


def test_more_is_uncertain_with_friction(start, coefficient_mm) -> None:
    fits = Kept()
    contacts_of(start, coefficient_mm, fits)
    (fit, *_), friction = fits.calls[-1]
    rows = fit.posterior.linearisation.force_rows(np.ones((1, len(fit.balance_mm2))), np.array([0]))
    added = friction.covariance(fit.posterior.whiten(rows)[None])[0, 0, 0]
    assert added > 0.0
    changes_mm = fit.posterior.colour(friction.white)
    assert added == pytest.approx(sum(float((rows[0] * each).sum()) ** 2 for each in changes_mm), rel=1e-3)


def test_there_is_none_without_contacts_and_for_a_fit_that_failed(start, coefficient_mm) -> None:
    fits = Kept()
    contacts_of(start, coefficient_mm, fits)
    (fit, clusters, force_mm2), _ = fits.calls[-1]
    failed: Fit = replace(fit, status=Status.NOT_CONVERGED)
    assert FrictionFits()(failed, clusters, force_mm2) is None
    assert FrictionFits()(fit, clusters.select(np.zeros(0, dtype=np.int64)), force_mm2) is None
