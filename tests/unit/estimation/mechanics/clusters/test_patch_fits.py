"""The fit of a patch against its own truth."""

import numpy as np

from manytouch.estimation.mechanics.clusters.patch_fits import Whitened, fit_patches, nodal_slopes
from manytouch.estimation.mechanics.clusters.patch_kernels import add_patch, node_grid
from spline_loads import PATCH, SHAPE

NODES = np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE)
GRID = node_grid(PATCH, NODES)
ELLIPSE = np.array([0.8, 5.1, -3.2, 2.0, 0.7, 1.4])


def nodal(patch: np.ndarray) -> np.ndarray:
    forces = np.zeros(NODES.size)
    add_patch(GRID, patch, forces)
    return forces


def test_a_fit_finds_the_patch_and_its_curvature() -> None:
    likelihood = Whitened(np.eye(NODES.size) / 1e-3, nodal(ELLIPSE) / 1e-3)
    theta = ELLIPSE * np.array([1.2, 1.1, 0.9, 1.2, 0.5, 0.8])
    step = np.array([1e-4, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])
    misfit, curvature = fit_patches(theta, step, GRID, likelihood, 30)
    assert misfit < 0.1
    np.testing.assert_allclose(theta, ELLIPSE, atol=0.02)
    assert (np.linalg.eigvalsh(curvature) > 0.0).all()


def test_slopes_are_those_of_the_nodal_forces() -> None:
    """A parameter without a step has none."""
    slope, step = np.empty((6, NODES.size)), np.array([1e-4, 1e-4, 1e-4, 1e-4, 0.0, 1e-4])
    nodal_slopes(ELLIPSE, step, GRID, nodal(ELLIPSE), slope)
    for number in (0, 2, 5):
        expected = (nodal(ELLIPSE + 1e-4 * np.eye(6)[number]) - nodal(ELLIPSE)) / 1e-4
        np.testing.assert_allclose(slope[number], expected, atol=1e-9)
        assert np.abs(expected).max() > 0.01
    assert not slope[4].any()
