"""Nodal forces of patches against scipy."""

import numpy as np
import pytest

from manytouch.estimation.mechanics.clusters.patch_kernels import NodeGrid, add_patch, node_grid
from manytouch.geometry.spline.patch import SplinePatch
from spline_loads import PATCH, SHAPE, SHEAR_MM2, SHEARED, nodal_press

NODES = np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE)
END = (-0.1, -0.7, 0.1)
GRID = node_grid(PATCH, NODES)
ELLIPSE = np.array([0.8, 5.1, -3.2, 2.0, 0.7, 1.4])


def quadrature(patch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (25, 2) and forces (25,) of a patch."""
    force, x, y, xx, yx, yy = patch
    angle = np.pi * np.arange(1, 6) / 6.0
    place, weight = 2.0 * np.cos(angle), np.sin(angle) ** 2 / 3.0
    first, second = (part.ravel() for part in np.meshgrid(place, place, indexing="ij"))
    places_mm = np.column_stack([x + first * xx, y + first * yx + second * yy])
    return places_mm, force * np.outer(weight, weight).ravel()


def reference(patch: np.ndarray) -> np.ndarray:
    """Nodal forces (nodes,) by the same quadrature with scipy's splines."""
    return nodal_press(*quadrature(patch), SHEAR_MM2).ravel()


def added(grid: NodeGrid, patch: np.ndarray, count: int = NODES.size) -> np.ndarray:
    nodal = np.zeros(count)
    add_patch(grid, patch, nodal)
    return nodal


@pytest.mark.parametrize("seed", range(4))
def test_the_nodal_forces_of_a_patch(seed: int) -> None:
    patch = ELLIPSE * np.random.default_rng(seed).uniform(0.5, 1.5, 6)
    np.testing.assert_allclose(added(GRID, patch), reference(patch), atol=1e-12)
    assert added(GRID, patch).sum() == pytest.approx(patch[0])


@pytest.mark.parametrize("x", [-43.9, -41.0, -37.0, 35.2, 42.5])
@pytest.mark.parametrize("y", [-37.0, 20.0, 33.3])
def test_a_point_near_the_outline(x: float, y: float) -> None:
    """The splines of unequal knots next to the outline, and their second derivatives."""
    point = np.array([0.7, x, y, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(added(GRID, point), reference(point), atol=1e-12)


@pytest.mark.parametrize("centre_mm", [(-21.5, 3.0), (20.0, 15.5), (0.0, -16.8), (1.0, 2.0)])
def test_a_patch_near_the_clamp(centre_mm: tuple[float, float]) -> None:
    """Its forces are those of the patch of the sheet, whose outer functions belong to nodes within."""
    sheet = SplinePatch(size_mm=(48.0, 36.0), elements=(12, 9), shear_mm2=SHEAR_MM2, clamped_end=END)
    local = np.pad(np.arange(sheet.node_count).reshape(sheet.shape), 1, constant_values=-1)
    grid = node_grid(sheet, local)
    patch = np.array([0.8, *centre_mm, 1.0, 0.3, 0.6])
    places_mm, force = quadrature(patch)
    expected = sheet.load(places_mm, np.outer(force, [0.0, 0.0, 1.0]))[:, 2]
    free = sheet.is_free[:, 2]
    found = added(grid, patch, sheet.node_count)
    np.testing.assert_allclose(found[free], expected[free], atol=1e-12)
    assert np.abs(expected[free]).max() > 0.01


def test_the_second_moment_of_a_patch() -> None:
    nodal = reference(ELLIPSE)
    arm = SHEARED.place_mm.T - ELLIPSE[1:3, None]
    second = (nodal * arm) @ arm.T / nodal.sum() - np.diag(SHEARED.own_spread_mm2)
    root = np.array([[ELLIPSE[3], 0.0], [ELLIPSE[4], ELLIPSE[5]]])
    np.testing.assert_allclose(second, root @ root.T, atol=1e-9)
