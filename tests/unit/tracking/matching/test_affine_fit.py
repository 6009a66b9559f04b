"""Affine fits to neighbours, against numpy's least squares."""

import numpy as np
import pytest

from manytouch.tracking.matching.affine_fit import (
    NO_FIT,
    RIDGE,
    ROBUST_SCALE,
    AffineFit,
    fit_affine,
    least_stretch,
    rms_residual,
    solve_affine,
    sum_neighbours,
)


def known_neighbours(graph, assignment, k):
    """Offsets (j, 2) in px, displacements (j, 2) and weights (j,) of the neighbours with a dot."""
    used = slice(graph.start[k], graph.start[k + 1])
    near = graph.neighbour[used]
    is_known = assignment.dot[near] >= 0
    near = near[is_known]
    weight = graph.weight[used][is_known].astype(np.float64)
    return graph.rest_px[near] - graph.rest_px[k], assignment.displacement_px[near], weight


def reference_fit(offset, displacement, weight, ridge):
    """Weighted least squares with a ridge on the gradient, centred on the weighted means."""
    mean, mean_displacement = (np.average(each, axis=0, weights=weight) for each in (offset, displacement))
    centred = offset - mean
    normal = (centred * weight[:, None]).T @ centred + ridge * np.eye(2)
    right = (centred * weight[:, None]).T @ (displacement - mean_displacement)
    gradient = np.linalg.solve(normal, right).T
    return mean_displacement - gradient @ mean, gradient


def residuals(offset, displacement, shift, gradient):
    return ((displacement - shift - offset @ gradient.T) ** 2).sum(axis=1)


def test_fits_and_residuals_equal_least_squares(scene):
    graph, assignment = scene.graph.arrays, scene.assignment(0.6)
    compared = 0
    for k in range(len(graph.rest_px)):
        offset, displacement, weight = known_neighbours(graph, assignment, k)
        fit, used = fit_affine(k, graph, assignment, NO_FIT, False)
        assert used == len(weight)
        if used == 0:
            assert fit == NO_FIT
            continue
        ridge = RIDGE * graph.spacing_px[k] ** 2
        shift, gradient = reference_fit(offset, displacement, weight, ridge)
        np.testing.assert_allclose(fit, [*shift, *gradient.ravel()], atol=1e-9)
        squared = residuals(offset, displacement, shift, gradient)
        rms = np.sqrt(np.average(squared, weights=weight))
        assert rms_residual(k, graph, assignment, fit, False) == pytest.approx(rms, abs=1e-9)
        compared += 1
    assert compared > 100


def test_robust_fits_reduce_the_weight_of_large_residuals(scene):
    graph, assignment = scene.graph.arrays, scene.assignment(0.8)
    k = int(np.flatnonzero(assignment.dot >= 0)[20])
    assignment.displacement_px[graph.neighbour[graph.start[k]]] += 15.0
    offset, displacement, weight = known_neighbours(graph, assignment, k)
    spacing2 = graph.spacing_px[k] ** 2
    shift, gradient = reference_fit(offset, displacement, weight, RIDGE * spacing2)
    robust = (
        weight / (1.0 + residuals(offset, displacement, shift, gradient) / (ROBUST_SCALE * spacing2)) ** 2
    )
    plain, _ = fit_affine(k, graph, assignment, NO_FIT, False)
    fit, _ = fit_affine(k, graph, assignment, plain, True)
    shift, gradient = reference_fit(offset, displacement, robust, RIDGE * spacing2)
    np.testing.assert_allclose(fit, [*shift, *gradient.ravel()], atol=1e-8)
    squared = residuals(offset, displacement, shift, gradient)
    robust = weight / (1.0 + squared / (ROBUST_SCALE * spacing2)) ** 2
    rms = np.sqrt(np.average(squared, weights=robust))
    assert rms_residual(k, graph, assignment, fit, True) == pytest.approx(rms, rel=1e-9)


def test_the_residual_of_the_sums_is_that_of_the_fit_without_ridge(scene):
    graph, assignment = scene.graph.arrays, scene.assignment(0.9)
    for k in np.flatnonzero(assignment.dot >= 0)[::5].tolist():
        sums = sum_neighbours(k, graph, assignment, NO_FIT, False)
        fit, residual = solve_affine(sums, 1e-9)
        rms = rms_residual(k, graph, assignment, fit, False)
        assert np.sqrt(max(0.0, residual) / sums.w) == pytest.approx(rms, abs=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_least_stretch_is_the_smaller_singular_value_within_limits(seed):
    chance = np.random.default_rng(seed)
    for scale in (0.05, 0.3, 1.0):
        gradient = scale * chance.standard_normal((2, 2))
        expected = np.linalg.svd(np.eye(2) + gradient, compute_uv=False).min()
        found = least_stretch(AffineFit(0.0, 0.0, *gradient.ravel().tolist()))
        assert found == pytest.approx(np.clip(expected, 0.35, 1.2), abs=1e-6)
