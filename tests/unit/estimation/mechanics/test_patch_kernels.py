"""Nodal forces of patches against scipy, and the fit against its own truth."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from manytouch.estimation.mechanics.patch_kernels import NodeGrid, Whitened, add_patch, fit_patches
from spline_loads import COUNT, LATTICE, knots

SHAPE = (COUNT[0] + 3, COUNT[1] + 3)
NODES = np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE)
GRID = NodeGrid(knots(0), knots(1), NODES)
ELLIPSE = np.array([0.8, 5.1, -3.2, 2.0, 0.7, 1.4])


def reference(patch: np.ndarray) -> np.ndarray:
    """Nodal forces (nodes,) by the same quadrature with scipy's splines."""
    force, x, y, xx, yx, yy = patch
    angle = np.pi * np.arange(1, 6) / 6.0
    place, weight = 2.0 * np.cos(angle), np.sin(angle) ** 2 / 3.0
    first, second = (part.ravel() for part in np.meshgrid(place, place, indexing="ij"))
    along_x = BSpline.design_matrix(x + first * xx, knots(0), 3).toarray()
    along_y = BSpline.design_matrix(y + first * yx + second * yy, knots(1), 3).toarray()
    return force * np.einsum("k,ki,kj->ij", np.outer(weight, weight).ravel(), along_x, along_y).ravel()


@pytest.mark.parametrize("seed", range(4))
def test_the_nodal_forces_of_a_patch(seed: int) -> None:
    patch = ELLIPSE * np.random.default_rng(seed).uniform(0.5, 1.5, 6)
    nodal = np.zeros(NODES.size)
    add_patch(GRID, patch, nodal)
    np.testing.assert_allclose(nodal, reference(patch), atol=1e-12)
    assert nodal.sum() == pytest.approx(patch[0])


def test_the_second_moment_of_a_patch() -> None:
    nodal = reference(ELLIPSE)
    arm = LATTICE.place_mm.T - ELLIPSE[1:3, None]
    second = (nodal * arm) @ arm.T / nodal.sum() - np.diag([4.0**2 / 3.0, 5.0**2 / 3.0])
    root = np.array([[ELLIPSE[3], 0.0], [ELLIPSE[4], ELLIPSE[5]]])
    np.testing.assert_allclose(second, root @ root.T, atol=1e-9)


def test_a_fit_finds_the_patch_and_its_curvature() -> None:
    likelihood = Whitened(np.eye(NODES.size) / 1e-3, reference(ELLIPSE) / 1e-3)
    theta = ELLIPSE * np.array([1.2, 1.1, 0.9, 1.2, 0.5, 0.8])
    step = np.array([1e-4, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])
    misfit, curvature = fit_patches(theta, step, GRID, likelihood, 30)
    assert misfit < 0.1
    np.testing.assert_allclose(theta, ELLIPSE, atol=0.02)
    assert (np.linalg.eigvalsh(curvature) > 0.0).all()
