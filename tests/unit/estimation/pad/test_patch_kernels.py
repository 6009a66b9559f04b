"""Nodal forces and marker images of patches against plain numpy."""

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

from bonded_pad import gaussian_on_layer
from manytouch.estimation.pad.estimator import PadState
from manytouch.estimation.pad.patch_fit import forced, tractions
from manytouch.estimation.pad.patch_kernels import (
    DENSE_DOME,
    DENSEST_DOME,
    DOME,
    Markers,
    add_dome,
    add_layer_images,
)
from manytouch.geometry.spline.patch import SplinePatch

SHAPE = np.array([9.3, -2.0, 1.0, 0.3, 0.8])
ROOT = np.array([[1.0, 0.0], [0.3, 0.8]])


@pytest.mark.parametrize("points", [DOME, DENSE_DOME, DENSEST_DOME])
def test_the_quadrature_has_unit_moments(points: np.ndarray) -> None:
    x, y, weight = points.T
    assert np.isclose(weight.sum(), 1.0)
    np.testing.assert_allclose([weight @ x, weight @ y, weight @ (x * y)], 0.0, atol=1e-12)
    np.testing.assert_allclose([weight @ x**2, weight @ y**2], 1.0)


def test_nodal_forces_are_those_of_the_patch(pad_state: PadState) -> None:
    model = pad_state.model
    nodal = np.zeros((3, model.grid.count_x + 3, model.grid.count_y + 3))
    add_dome(SHAPE, model.grid, DOME, nodal)
    away_mm, weight = DOME[:, :2] @ ROOT.T, DOME[:, 2]
    force = weight[:, None] * np.column_stack([np.ones(len(weight)), away_mm])
    expected = model.patch.load(SHAPE[:2] + away_mm, force)
    np.testing.assert_allclose(model.by_node(np.moveaxis(nodal, 0, -1)), expected, atol=1e-12)


def test_nodes_are_counted_along_x_and_y_whichever_side_is_longer(pad_state: PadState) -> None:
    tall = SplinePatch(size_mm=(8.0, 10.0), elements=(5, 7), boundary="soft")
    assert not tall.is_x_slow
    grid = pad_state.model.grid._replace(
        corner_x=-4.0, corner_y=-5.0, step_x=1.6, step_y=10.0 / 7.0, count_x=5, count_y=7
    )
    nodal = np.zeros((3, 8, 10))
    shape = np.array([0.5, -1.0, 0.9, 0.1, 0.7])
    add_dome(shape, grid, DOME, nodal)
    away_mm = DOME[:, :2] @ np.array([[0.9, 0.0], [0.1, 0.7]]).T
    expected = tall.load(shape[:2] + away_mm, DOME[:, 2:] * np.ones(3))[:, 0]
    np.testing.assert_allclose(nodal[0].swapaxes(0, 1).ravel(), expected, atol=1e-12)


def test_images_on_a_layer_are_fourier_sums() -> None:
    """Against Gaussians with the second moments of the patch: beyond it the profile hardly matters."""
    from manytouch.estimation.pad.pad_model import layer_table

    place_mm = np.array([[5.0, 1.0], [-4.0, 3.0], [3.0, -5.0]])
    slope = np.tile(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (3, 1, 1))
    upright = np.tile(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), (3, 1, 1))
    table, shape = layer_table(4.0, 0.48, 0.0), np.array([0.5, -0.5, 0.8, 0.0, 0.8])
    image, lifted = np.zeros((5, 6)), np.zeros((5, 6))
    add_layer_images(shape, table, DOME, Markers(place_mm, slope), image)
    add_layer_images(shape, table, DOME, Markers(place_mm, upright), lifted)
    for load, is_shear, sign in ((0, False, -1.0), (1, True, 1.0)):
        expected = sign * gaussian_on_layer(place_mm - shape[:2], 0.8, is_shear=is_shear)
        found = np.column_stack([image[load].reshape(-1, 2), lifted[load].reshape(-1, 2)[:, 0]])
        np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())


def test_turn_and_growth_are_shear_in_proportion_to_the_arm() -> None:
    from manytouch.estimation.pad.pad_model import layer_table

    place_mm = np.array([[1.0, 0.5], [-2.0, 1.0], [0.2, -3.0]])
    slope = np.tile(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (3, 1, 1))
    table, markers = layer_table(4.0, 0.48, 0.3), Markers(place_mm, slope)
    shape = np.array([0.3, -0.2, 1.2, 0.4, 0.9])
    whole, expected = np.zeros((5, 6)), np.zeros((5, 6))
    add_layer_images(shape, table, DOME, markers, whole)
    # the same points, one at a time: unit weight, as even shear with their arms
    root = np.array([[1.2, 0.0], [0.4, 0.9]])
    blob = min(0.65 * np.sqrt(1.2 * 0.9), 0.9 * np.sqrt(np.linalg.eigvalsh(root @ root.T)[0]))
    rest = np.linalg.cholesky(root @ root.T - blob**2 * np.eye(2))
    for x, y, weight in DOME:
        away_mm = rest @ (x, y)
        one = np.zeros((5, 6))
        point = np.array([[0.0, 0.0, 1.0]])
        narrow = np.array([*(shape[:2] + away_mm), blob / 0.65, 0.0, blob / 0.65])
        add_layer_images(narrow, table, point, markers, one)
        expected[3] += weight * (away_mm[0] * one[2] - away_mm[1] * one[1])
        expected[4] += weight * (away_mm[0] * one[1] + away_mm[1] * one[2])
    np.testing.assert_allclose(whole[3:], expected[3:], atol=1e-9)


def test_a_wide_patch_presses_one_hollow(pad_state: PadState) -> None:
    """The points of its quadrature are no separate loads."""
    model = pad_state.model
    wide = np.array([[0.5, -0.5, 3.6, 0.3, 3.2, 40.0, 0.0, 0.0, 0.0, -0.1]])
    face_mm = forced(model.by_node(tractions(model, wide)), model.face)
    x_mm, y_mm = (np.linspace(-0.49, 0.49, 61) * size for size in model.patch.size_mm)
    place_mm = np.stack(np.meshgrid(x_mm, y_mm, indexing="ij"), axis=-1)
    depth_mm = -model.patch.at(place_mm.reshape(-1, 2)).displacement(face_mm)[:, 2].reshape(61, 61)
    is_peak = (depth_mm == maximum_filter(depth_mm, 9)) & (depth_mm > 0.2 * depth_mm.max())
    assert is_peak.sum() == 1
    deepest_mm = place_mm.reshape(-1, 2)[depth_mm.argmax()]
    assert np.linalg.norm(deepest_mm - wide[0, :2]) < 1.5


def test_both_quadratures_load_narrow_patches_the_same(pad_state: PadState) -> None:
    """So the misfit does not jump where the one takes over from the other."""
    model = pad_state.model
    shape = np.array([0.5, -1.0, 0.75 * model.grid.step_x, 0.1, 0.7 * model.grid.step_y])
    few, many = np.zeros((2, 3, model.grid.count_x + 3, model.grid.count_y + 3))
    add_dome(shape, model.grid, DOME, few)
    add_dome(shape, model.grid, DENSE_DOME, many)
    rows = model.by_sides.shape[-1]
    for axis in range(3):
        sides = model.by_sides[axis].reshape(-1, rows)
        found, expected = few[0].ravel() @ sides, many[0].ravel() @ sides
        np.testing.assert_allclose(found, expected, atol=0.01 * np.abs(expected).max())
