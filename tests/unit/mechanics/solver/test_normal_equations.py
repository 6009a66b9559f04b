"""One Gauss-Newton step against dense matrices, and what a series of steps estimates from marker images."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.mechanics.shell.shell import Shell
from manytouch.mechanics.solver.linearisation import Linearisation
from manytouch.mechanics.solver.normal_equations import NormalEquations
from manytouch.mechanics.solver.posterior import Posterior
from manytouch.values import Camera

H = 1e-5


def problem(dots: MarkerImages) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    count = len(dots.rest_mm)
    root = rng.normal(size=(count, 2, 2)) * 10.0
    information = root @ root.transpose(0, 2, 1)
    information[3] = 0.0
    residual = rng.normal(size=(count, 2))
    residual[3] = np.nan
    return residual, information, rng.uniform(0.1, 1e3, (dots.shell.patch.node_count, 3))


def equations(dots: MarkerImages, precision: type[np.floating] | None = np.float64) -> NormalEquations:
    return NormalEquations(shell=dots.shell, dots=dots, precision=precision)


def dense_jacobians(here: Linearisation) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the marker images (m, 2, n) and of the balance (n, n) by all coefficients."""
    free = here.shell.patch.is_free
    unknowns = np.eye(free.size).reshape(-1, *free.shape) * free
    forces = np.array([here.balance_change(each).ravel() for each in unknowns]).T
    image = np.zeros((len(here.derivative), 2, *free.shape))
    for i, (node, part) in enumerate(zip(here.dots.tips.basis.node, here.derivative, strict=True)):
        image[i][:, node] = part
    return image.reshape(len(image), 2, -1), forces


def test_the_balance_and_its_change(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    linearise = equations(dots).linearise
    way = np.random.default_rng(3).normal(size=bent_mm.shape) * dots.shell.patch.is_free
    change = (linearise(bent_mm + H * way).balance - linearise(bent_mm - H * way).balance) / (2 * H)
    here = linearise(bent_mm)
    np.testing.assert_allclose(here.balance_change(way), change, atol=1e-7 * np.abs(change).max())
    np.testing.assert_allclose(here.force, dots.shell.forces(bent_mm), atol=1e-12)


def covariance(posterior: Posterior, rows: np.ndarray) -> np.ndarray:
    """(k, k) of linear functions (k, nodes, 3) of the coefficients."""
    white = posterior.whiten(rows)
    return white @ white.T


def test_a_step_solves_the_normal_equations(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    residual, information, weight = problem(dots)
    here = equations(dots).linearise(bent_mm)
    posterior = equations(dots).solve(here, residual, information, weight)
    assert posterior.damping == 0.0
    image, forces = dense_jacobians(here)
    free = dots.shell.patch.is_free.ravel()
    matrix = np.einsum("map,mab,mbq->pq", image, information, image, optimize=True)
    matrix += forces.T @ (weight.reshape(-1, 1) * forces)
    gradient = np.einsum("map,mab,mb->p", image, information, np.nan_to_num(residual))
    gradient += forces.T @ (weight * here.balance).ravel()
    inverse = np.linalg.inv(matrix[np.ix_(free, free)])
    expected = np.zeros(len(free))
    expected[free] = -inverse @ gradient[free]
    np.testing.assert_allclose(posterior.change_mm.ravel(), expected, atol=1e-9 * np.abs(expected).max())

    rows = np.random.default_rng(6).normal(size=(3, *bent_mm.shape))
    dense = rows.reshape(3, -1)[:, free]
    np.testing.assert_allclose(covariance(posterior, rows), dense @ inverse @ dense.T, rtol=1e-8)
    solved = posterior.solve(rows * dots.shell.patch.is_free).reshape(3, -1)[:, free]
    np.testing.assert_allclose(solved, dense @ inverse, rtol=1e-7, atol=1e-10)
    local = image[:, 0][:, free]
    np.testing.assert_allclose(
        posterior.variances(dots.tips.basis.node, dots.derivative_px(bent_mm)[:, 0]),
        np.einsum("mp,pq,mq->m", local, inverse, local),
        rtol=1e-8,
    )


def test_samples_have_the_covariance_of_the_posterior(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    residual, information, weight = problem(dots)
    posterior = equations(dots).solve(equations(dots).linearise(bent_mm), residual, information, weight)
    rows = np.random.default_rng(6).normal(size=(3, *bent_mm.shape))
    samples = posterior.colour(np.eye(bent_mm.size))
    values = np.einsum("rnj,snj->rs", rows, samples)
    np.testing.assert_allclose(values @ values.T, covariance(posterior, rows), rtol=1e-7, atol=1e-12)


def test_single_precision_is_enough_for_a_step(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    if dots.shell.patch.boundary == "soft":
        assert equations(dots, None).precision == np.float64
        return
    single, double = (
        equations(dots, precision).solve(equations(dots, precision).linearise(bent_mm), *problem(dots))
        for precision in (np.float32, np.float64)
    )
    size = np.abs(double.change_mm).max()
    np.testing.assert_allclose(single.change_mm, double.change_mm, atol=1e-3 * size)
    node, row = dots.tips.basis.node, dots.derivative_px(bent_mm)[:, 0]
    np.testing.assert_allclose(single.variances(node, row), double.variances(node, row), rtol=1e-3)


def test_force_rows_are_derivatives_of_forces(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    here, free = equations(dots).linearise(bent_mm), dots.shell.patch.is_free
    way = np.random.default_rng(3).normal(size=bent_mm.shape) * free
    share = np.random.default_rng(8).uniform(size=len(bent_mm)) * free[:, 2]
    change = here.force_change(way)[:, 2]
    row = here.force_rows(share[None], np.array([2]))[0]
    assert (row * way).sum() == pytest.approx(share @ change, rel=1e-9)


def test_balance_rows_are_derivatives_of_the_balance(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    here, free = equations(dots).linearise(bent_mm), dots.shell.patch.is_free
    way = np.random.default_rng(3).normal(size=bent_mm.shape) * free
    node, component = np.argwhere(free)[::7].T
    assert set(component) == {0, 1, 2}
    change = here.balance_change(way)[node, component]
    rows = here.balance_rows(node, component)
    np.testing.assert_allclose((rows * way).sum(axis=(1, 2)), change, rtol=1e-7, atol=1e-9)


def test_the_gradient_of_one_tangential_component_is_that_of_the_balance(
    dots: MarkerImages, bent_mm: np.ndarray
) -> None:
    linearisation = equations(dots).linearise(bent_mm)
    few = np.random.default_rng(3).normal(size=len(bent_mm)) * (np.arange(len(bent_mm)) % 7 == 3)
    for component in (0, 1):
        whole = np.zeros_like(bent_mm)
        whole[:, component] = few
        found = linearisation.tangential_gradients(few[None], np.array([component]))[0]
        expected = linearisation.balance_gradients(whole[None])[0]
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_gradients_of_several_residuals(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    residual, information, _ = problem(dots)
    here = equations(dots).linearise(bent_mm)
    residuals, nothing = np.stack([residual, 2.0 - residual]), np.zeros((2, *bent_mm.shape))
    pull = np.einsum("mab,kmb->kma", information, np.nan_to_num(residuals))
    parts, expected = np.einsum("kma,manc->kmnc", pull, here.derivative), np.zeros_like(nothing)
    for gradient, part in zip(expected, parts, strict=True):
        np.add.at(gradient, here.dots.tips.basis.node, part)
    found = here.gradients(residuals, information, nothing)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_a_chord_step_at_its_own_linearisation_is_a_full_step(
    dots: MarkerImages, bent_mm: np.ndarray, precision: type[np.floating]
) -> None:
    if precision is np.float32 and dots.shell.patch.boundary == "soft":
        pytest.skip("patches with a soft outline are ill-conditioned and always solved with float64")
    residual, information, weight = problem(dots)
    here = equations(dots, precision).linearise(bent_mm)
    posterior = equations(dots, precision).solve(here, residual, information, weight)
    again = posterior.chord_step(residual, information, here.balance)
    within = (1e-9 if precision is np.float64 else 1e-4) * np.abs(posterior.change_mm).max()
    np.testing.assert_allclose(again, posterior.change_mm, atol=within)


def test_standard_deviations_of_forces(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    here = equations(dots).linearise(bent_mm)
    posterior = equations(dots).solve(here, *problem(dots))
    share = np.random.default_rng(8).uniform(size=(2, len(bent_mm)))
    rows = here.force_rows(share, np.full(len(share), 2))
    np.testing.assert_allclose(
        posterior.force_std(share, 2) ** 2, np.diag(covariance(posterior, rows)), rtol=1e-9
    )
    assert len(posterior.force_std(share[:0], 2)) == 0


@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_later_calls_change_no_linearisation_and_no_posterior(
    dots: MarkerImages, bent_mm: np.ndarray, precision: type[np.floating]
) -> None:
    residual, information, weight = problem(dots)
    normal = equations(dots, precision)
    here = normal.linearise(bent_mm)
    posterior = normal.solve(here, residual, information, weight)
    node = np.flatnonzero(dots.shell.patch.is_free[:, 2])[:3]
    rows = here.balance_rows(node, np.full(3, 2))
    before = (
        posterior.chord_step(residual, information, here.balance),
        covariance(posterior, rows),
        rows,
    )
    other = normal.linearise(0.5 * bent_mm)
    normal.solve(other, residual + 1.0, 2.0 * information, 0.5 * weight)
    again = here.balance_rows(np.flatnonzero(dots.shell.patch.is_free[:, 2])[:3], np.full(3, 2))
    after = (
        posterior.chord_step(residual, information, here.balance),
        covariance(posterior, again),
        again,
    )
    for one, two in zip(before, after, strict=True):
        np.testing.assert_array_equal(one, two)
    repeated = normal.solve(normal.linearise(bent_mm), residual, information, weight)
    np.testing.assert_array_equal(repeated.change_mm, posterior.change_mm)


def test_a_singular_matrix_is_damped(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    residual, information, weight = problem(dots)
    only_few = np.where(np.arange(len(information))[:, None, None] < 5, information, 0.0)
    posterior = equations(dots).solve(
        equations(dots).linearise(bent_mm), residual, only_few, np.zeros_like(weight)
    )
    assert np.isfinite(posterior.change_mm).all()
    assert posterior.damping > 0.0


def test_steps_recover_a_press_from_marker_images(camera: Camera) -> None:
    """Algebra only (the same shell made the pixels): depth, and the force in the sign of the contract."""
    patch = SplinePatch(size_mm=(60.0, 48.0), elements=(15, 12))
    shell = Shell(patch=patch, thickness_mm=3.0, pretension_over_E_mm=0.02)
    patch = shell.patch
    load = patch.load(np.array([[8.0, -5.0]]), np.array([[0.0, 0.0, -2.0]]))
    truth = equilibrium(shell, load)
    assert truth.status == "ok"
    x, y = np.arange(-26.0, 27.0, 4.0), np.arange(-20.0, 21.0, 4.0)
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rest_mm = np.column_stack([place, np.zeros(len(place))])
    dots = MarkerImages(shell=shell, camera=camera, rest_mm=rest_mm, radius_mm=np.ones(len(place)))
    noise = np.random.default_rng(0).normal(scale=0.02, size=(len(place), 2))
    measured = dots.displacement_px(truth.coefficient_mm) + noise
    normal = NormalEquations(shell=shell, dots=dots)
    information = np.tile(np.eye(2) / 0.04**2, (len(place), 1, 1))
    found = np.zeros((patch.node_count, 3))
    beta = np.full(patch.node_count, 1.0 / 0.03**2)
    for _ in range(14):
        here = normal.linearise(found)
        weight = np.column_stack([np.full((patch.node_count, 2), 1.0 / 2e-3**2), beta])
        residual = dots.displacement_px(found) - measured
        change = normal.solve(here, residual, information, weight).change_mm
        found = found + np.clip(change, -6.0, 6.0)
        push = np.maximum(-(here.force + here.force_change(change))[:, 2], 0.0)
        beta = 1.0 / (push**2 + 1e-3**2)
    depth = -dots.displacement_mm(found)[:, 2]
    expected = -dots.displacement_mm(truth.coefficient_mm)[:, 2]
    assert expected.max() > 3.0
    assert np.sqrt(((depth - expected) ** 2).mean()) < 0.02
    push = -shell.forces(found)[:, 2]
    assert push.sum() == pytest.approx(2.0, rel=0.1)
    np.testing.assert_allclose(push @ patch.place_mm / push.sum(), [8.0, -5.0], atol=0.3)


def test_a_tilt_needs_no_forces_within_a_soft_boundary(camera: Camera) -> None:
    """A tilt of everything in view is a motion of the sheet beyond, not a force within."""
    patch = SplinePatch(size_mm=(64.0, 52.0), elements=(16, 13), boundary="soft")
    shell = Shell(patch=patch, thickness_mm=3.0)
    x, y = np.arange(-24.0, 25.0, 4.0), np.arange(-18.0, 19.0, 4.0)
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rest_mm = np.column_stack([place, np.zeros(len(place))])
    dots = MarkerImages(shell=shell, camera=camera, rest_mm=rest_mm, radius_mm=np.ones(len(place)))
    tilt = np.zeros((patch.node_count, 3))
    tilt[:, 2] = -1.0 + 0.02 * patch.place_mm[:, 0]
    measured = dots.displacement_px(tilt)
    normal = NormalEquations(shell=shell, dots=dots)
    information = np.tile(np.eye(2) / 0.05**2, (len(place), 1, 1))
    weight = np.full((patch.node_count, 3), 1.0 / 2e-3**2)
    weight[patch.is_soft_edge] = 1e-2
    found = np.zeros_like(tilt)
    for _ in range(6):
        residual = dots.displacement_px(found) - measured
        found = found + normal.solve(normal.linearise(found), residual, information, weight).change_mm
    depth = -dots.displacement_mm(found)[:, 2]
    np.testing.assert_allclose(depth, -dots.displacement_mm(tilt)[:, 2], atol=0.05)
    inner = ~replace(patch).is_soft_edge
    assert np.abs(shell.forces(found)[inner, 2]).max() < 2e-3


def test_reweighting_gives_the_posterior_of_the_new_weights(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    residual, information, weight = problem(dots)
    normal, free = equations(dots), dots.shell.patch.is_free
    here = normal.linearise(bent_mm)
    full = normal.solve(here, residual, information, weight)
    asked = 1.3 * weight
    chosen = tuple(np.argwhere(free)[3::11].T)
    asked[chosen] = weight[chosen] * np.where(np.arange(len(chosen[0])) % 2, 30.0, 0.1)
    mixed = weight.copy()
    mixed[chosen] = asked[chosen]

    def reweighted(before: Posterior, weights: np.ndarray, most: int) -> Posterior | None:
        return before.reweighted(
            weights,
            here.force,
            residual_px=residual,
            information_per_px2=information,
            balance=here.balance,
            min_ratio=2.0,
            max_kept_ratio=4.0,
            max_rows=most,
        )

    assert reweighted(full, asked, len(chosen[0]) - 1) is None
    found = reweighted(full, asked, len(chosen[0]))
    assert found is not None
    assert found.reweightings == 1
    again = reweighted(found, asked, len(chosen[0]))
    assert again is not None
    assert again.reweightings == 2
    expected = normal.solve(here, residual, information, mixed)
    rows = np.random.default_rng(6).normal(size=(20, *bent_mm.shape))
    node = np.flatnonzero(free[:, 2])[::5]
    pull = np.random.default_rng(7).normal(size=len(node))
    for each in (found, again):
        np.testing.assert_array_equal(each.weight, mixed)
        size = np.abs(expected.change_mm).max()
        np.testing.assert_allclose(each.change_mm, expected.change_mm, atol=1e-7 * size)
        for part in (rows, rows[:2]):  # by `substitute` and by LAPACK
            ours, theirs = covariance(each, part), covariance(expected, part)
            np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-7 * theirs.max())
        ours, theirs = each.force_covariance(node), expected.force_covariance(node)
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-7 * theirs.max())
        ours, theirs = each.change_by_forces(node, pull), expected.change_by_forces(node, pull)
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-6 * np.abs(theirs).max())
        samples = each.colour(np.eye(bent_mm.size))
        values = np.einsum("pna,kna->kp", samples, rows)
        np.testing.assert_allclose(
            values @ values.T, covariance(expected, rows), rtol=1e-6, atol=1e-7 * values.max() ** 2
        )
    back = reweighted(again, weight, 1)
    assert back is not None
    np.testing.assert_array_equal(back.weight, weight)
    np.testing.assert_allclose(back.change_mm, full.change_mm, atol=1e-12)


def test_a_weight_that_nearly_vanishes_is_not_reweighted(dots: MarkerImages, bent_mm: np.ndarray) -> None:
    residual, information, weight = problem(dots)
    normal = equations(dots)
    here, node = normal.linearise(bent_mm), int(np.flatnonzero(dots.shell.patch.is_free[:, 2])[20])
    weight[node, 2] = 1e9
    full = normal.solve(here, residual, information, weight)
    for least, is_possible in ((1e8, True), (1.0, False)):
        weight = weight.copy()
        weight[node, 2] = least
        found = full.reweighted(
            weight,
            here.force,
            residual_px=residual,
            information_per_px2=information,
            balance=here.balance,
            min_ratio=2.0,
            max_kept_ratio=4.0,
            max_rows=3,
        )
        assert (found is not None) == is_possible
