"""One Gauss-Newton step against the same with dense matrices, and what it finds from pixels."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Dots
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.mechanics.shell.shell import Shell
from manytouch.mechanics.solver.normal_equations import NormalEquations
from manytouch.values import Camera

H = 1e-5


def problem(dots: Dots) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    count = len(dots.rest_mm)
    root = rng.normal(size=(count, 2, 2)) * 10.0
    information = root @ root.transpose(0, 2, 1)
    information[3] = 0.0
    residual = rng.normal(size=(count, 2))
    residual[3] = np.nan
    return residual, information, rng.uniform(0.1, 1e3, (dots.shell.patch.node_count, 3))


def dense_jacobians(
    dots: Dots, normal: NormalEquations, bent_mm: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    free = dots.shell.patch.is_free
    unknowns = np.eye(free.size).reshape(-1, *free.shape) * free
    forces = np.array([normal.balance_change(each).ravel() for each in unknowns]).T
    image = np.zeros((len(dots.rest_mm), 2, *free.shape))
    for i, (node, part) in enumerate(zip(dots.tips.basis.node, dots.derivative_px(bent_mm), strict=True)):
        image[i][:, node] = part
    return (image * free).reshape(len(image), 2, -1), forces


def test_balance_and_its_change(dots: Dots, bent_mm: np.ndarray) -> None:
    normal = NormalEquations(shell=dots.shell, dots=dots, precision=np.float64)
    way = np.random.default_rng(3).normal(size=bent_mm.shape) * dots.shell.patch.is_free
    change = (normal.linearise(bent_mm + H * way).balance - normal.linearise(bent_mm - H * way).balance) / (
        2 * H
    )
    here = normal.linearise(bent_mm)
    np.testing.assert_allclose(normal.balance_change(way), change, atol=1e-7 * np.abs(change).max())
    np.testing.assert_allclose(here.force, dots.shell.forces(bent_mm), atol=1e-12)
    np.testing.assert_array_equal(here.displacement_px, dots.displacement_px(bent_mm))


def test_a_step_solves_the_normal_equations(dots: Dots, bent_mm: np.ndarray) -> None:
    residual, information, weight = problem(dots)
    normal = NormalEquations(shell=dots.shell, dots=dots, precision=np.float64)
    here = normal.linearise(bent_mm)
    found = normal.step(residual, information, weight)
    assert normal.damping == 0.0
    image, forces = dense_jacobians(dots, normal, bent_mm)
    free = dots.shell.patch.is_free.ravel()
    matrix = np.einsum("map,mab,mbq->pq", image, information, image, optimize=True)
    matrix += forces.T @ (weight.reshape(-1, 1) * forces)
    gradient = np.einsum("map,mab,mb->p", image, information, np.nan_to_num(residual))
    gradient += forces.T @ (weight * here.balance).ravel()
    inverse = np.linalg.inv(matrix[np.ix_(free, free)])
    expected = np.zeros(len(free))
    expected[free] = -inverse @ gradient[free]
    np.testing.assert_allclose(found.ravel(), expected, atol=1e-9 * np.abs(expected).max())

    rows = np.random.default_rng(6).normal(size=(3, *bent_mm.shape))
    dense = rows.reshape(3, -1)[:, free]
    np.testing.assert_allclose(normal.covariance(rows), dense @ inverse @ dense.T, rtol=1e-8)
    solved = normal.solve(rows * dots.shell.patch.is_free).reshape(3, -1)[:, free]
    np.testing.assert_allclose(solved, dense @ inverse, rtol=1e-7, atol=1e-10)
    node, part = dots.tips.basis.node, dots.derivative_px(bent_mm)[:, 0]
    local = image[:, 0][:, free]
    np.testing.assert_allclose(
        normal.variances(node, part), np.einsum("mp,pq,mq->m", local, inverse, local), rtol=1e-8
    )


def test_single_precision_is_enough_for_a_step(dots: Dots, bent_mm: np.ndarray) -> None:
    if dots.shell.patch.boundary == "soft":
        assert NormalEquations(shell=dots.shell, dots=dots).precision == np.float64
        return
    residual, information, weight = problem(dots)
    steps, variances = [], []
    for precision in (np.float32, np.float64):
        normal = NormalEquations(shell=dots.shell, dots=dots, precision=precision)
        normal.linearise(bent_mm)
        steps.append(normal.step(residual, information, weight))
        variances.append(normal.variances(dots.tips.basis.node, dots.derivative_px(bent_mm)[:, 0]))
    np.testing.assert_allclose(steps[0], steps[1], atol=1e-3 * np.abs(steps[1]).max())
    np.testing.assert_allclose(variances[0], variances[1], rtol=1e-3)


def test_a_force_row_reads_forces(dots: Dots, bent_mm: np.ndarray) -> None:
    normal = NormalEquations(shell=dots.shell, dots=dots, precision=np.float64)
    normal.linearise(bent_mm)
    way = np.random.default_rng(3).normal(size=bent_mm.shape) * dots.shell.patch.is_free
    share = np.random.default_rng(8).uniform(size=len(bent_mm)) * dots.shell.patch.is_free[:, 2]
    expected = share @ normal.force_change(way)[:, 2]
    assert (normal.force_row(share, 2) * way).sum() == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_a_chord_step_where_its_curvature_is_from_is_a_step(
    dots: Dots, bent_mm: np.ndarray, precision: type[np.floating]
) -> None:
    residual, information, weight = problem(dots)
    normal = NormalEquations(shell=dots.shell, dots=dots, precision=precision)
    balance = normal.linearise(bent_mm).balance
    change = normal.step(residual, information, weight)
    near = normal.kept()
    other = normal.linearise(0.5 * bent_mm)
    normal.step(2.0 * residual, information, weight)
    assert np.abs(other.balance - balance).max() > 0.0
    normal.recall(near)
    again = normal.chord_step(residual, information, balance)
    size = np.abs(change).max()
    np.testing.assert_allclose(again, change, atol=(1e-9 if precision is np.float64 else 1e-4) * size)


def test_deviations_of_forces_are_those_of_their_rows(dots: Dots, bent_mm: np.ndarray) -> None:
    normal = NormalEquations(shell=dots.shell, dots=dots, precision=np.float64)
    normal.linearise(bent_mm)
    normal.step(*problem(dots))
    share = np.random.default_rng(8).uniform(size=(2, len(bent_mm)))
    rows = np.stack([normal.force_row(each, 2) for each in share])
    np.testing.assert_allclose(normal.force_std(share, 2) ** 2, np.diag(normal.covariance(rows)), rtol=1e-9)
    assert len(normal.force_std(share[:0], 2)) == 0


def test_steps_depend_on_their_arguments_only(dots: Dots, bent_mm: np.ndarray) -> None:
    residual, information, weight = problem(dots)
    used, fresh = (NormalEquations(shell=dots.shell, dots=dots, precision=np.float64) for _ in range(2))
    used.linearise(0.3 * bent_mm)
    used.step(residual + 1.0, information, 2.0 * weight)
    results = []
    for normal in (used, fresh):
        normal.linearise(bent_mm)
        results.append(normal.step(residual, information, weight))
    np.testing.assert_array_equal(results[0], results[1])


def test_a_matrix_without_any_weight_is_damped(dots: Dots, bent_mm: np.ndarray) -> None:
    residual, information, weight = problem(dots)
    normal = NormalEquations(shell=dots.shell, dots=dots, precision=np.float64)
    normal.linearise(bent_mm)
    nothing = np.zeros_like(weight)
    only_few = np.where(np.arange(len(information))[:, None, None] < 5, information, 0.0)
    assert np.isfinite(normal.step(residual, only_few, nothing)).all()
    assert normal.damping > 0.0


def test_a_read_out_before_the_first_step_is_refused(dots: Dots) -> None:
    normal = NormalEquations(shell=dots.shell, dots=dots, precision=np.float64)
    with pytest.raises(ValueError, match="call `step` first"):
        normal.covariance(np.zeros((1, dots.shell.patch.node_count, 3)))


def test_pixels_give_a_press_back(camera: Camera) -> None:
    """Algebra only (the same shell made the pixels): depth, and the force in the sign of the contract."""
    patch = SplinePatch(size_mm=(60.0, 48.0), elements=(15, 12))
    shell = Shell(patch=patch, thickness_mm=3.0, pretension_over_E_mm=0.02)
    load = np.zeros((patch.node_count, 3))
    load[:, 2] = -2.0 * patch.load(np.array([[8.0, -5.0]]), np.ones(1))
    truth = equilibrium(shell, load)
    assert truth.status == "ok"
    x, y = np.arange(-26.0, 27.0, 4.0), np.arange(-20.0, 21.0, 4.0)
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rest_mm = np.column_stack([place, np.zeros(len(place))])
    dots = Dots(shell=shell, camera=camera, rest_mm=rest_mm, radius_mm=np.ones(len(place)))
    noise = np.random.default_rng(0).normal(scale=0.02, size=(len(place), 2))
    measured = dots.displacement_px(truth.coefficient_mm) + noise
    normal = NormalEquations(shell=shell, dots=dots)
    information = np.tile(np.eye(2) / 0.04**2, (len(place), 1, 1))
    found = np.zeros((patch.node_count, 3))
    beta = np.full(patch.node_count, 1.0 / 0.03**2)
    for _ in range(14):
        here = normal.linearise(found)
        weight = np.column_stack([np.full((patch.node_count, 2), 1.0 / 2e-3**2), beta])
        change = normal.step(here.displacement_px - measured, information, weight)
        found = found + np.clip(change, -6.0, 6.0)
        push = np.maximum(-(here.force + normal.force_change(change))[:, 2], 0.0)
        beta = 1.0 / (push**2 + 1e-3**2)
    depth = -dots.displacement_mm(found)[:, 2]
    expected = -dots.displacement_mm(truth.coefficient_mm)[:, 2]
    assert expected.max() > 3.0
    assert np.sqrt(((depth - expected) ** 2).mean()) < 0.02
    push = -shell.forces(found)[:, 2]
    assert push.sum() == pytest.approx(2.0, rel=0.1)
    np.testing.assert_allclose(push @ patch.place_mm / push.sum(), [8.0, -5.0], atol=0.3)


def test_a_soft_boundary_lets_the_sheet_lean(camera: Camera) -> None:
    """A tilt of everything in view is a motion of the sheet beyond, not a force within."""
    patch = SplinePatch(size_mm=(64.0, 52.0), elements=(16, 13), boundary="soft")
    shell = Shell(patch=patch, thickness_mm=3.0)
    x, y = np.arange(-24.0, 25.0, 4.0), np.arange(-18.0, 19.0, 4.0)
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rest_mm = np.column_stack([place, np.zeros(len(place))])
    dots = Dots(shell=shell, camera=camera, rest_mm=rest_mm, radius_mm=np.ones(len(place)))
    tilt = np.zeros((patch.node_count, 3))
    tilt[:, 2] = -1.0 + 0.02 * patch.place_mm[:, 0]
    measured = dots.displacement_px(tilt)
    normal = NormalEquations(shell=shell, dots=dots)
    information = np.tile(np.eye(2) / 0.05**2, (len(place), 1, 1))
    weight = np.full((patch.node_count, 3), 1.0 / 2e-3**2)
    weight[patch.is_rim] = 1e-2
    found = np.zeros_like(tilt)
    for _ in range(6):
        here = normal.linearise(found)
        found = found + normal.step(here.displacement_px - measured, information, weight)
    depth = -dots.displacement_mm(found)[:, 2]
    np.testing.assert_allclose(depth, -dots.displacement_mm(tilt)[:, 2], atol=0.05)
    inner = ~replace(patch).is_rim
    assert np.abs(shell.forces(found)[inner, 2]).max() < 2e-3
