"""Nodal forces and marker images of patches against plain numpy."""

from functools import cache

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.ndimage import maximum_filter

from bonded_pad import RigidFace, ball_on_layer, gaussian_on_layer
from manytouch.estimation.pad.estimator import PadState
from manytouch.estimation.pad.pad_model import layer_table
from manytouch.estimation.pad.patch_fit import forced, tractions
from manytouch.estimation.pad.patch_kernels import (
    DENSE_POINTS,
    DENSEST_POINTS,
    POINTS,
    ROOT_XX,
    LayerTable,
    Markers,
    Profile,
    add_layer_images,
    add_pressure,
    cubic,
    radial_arm_slopes,
    radial_arms,
)
from manytouch.estimation.pad.patches import Patches
from manytouch.geometry.spline.patch import SplinePatch

SHAPE = np.array([9.3, -2.0, 1.0, 0.3, 0.8])
ROOT = np.array([[1.0, 0.0], [0.3, 0.8]])


@cache
def layer_at(depth_mm: float) -> LayerTable:
    """The response of a layer of 4 mm at a depth; each is computed once."""
    return layer_table(4.0, 0.48, depth_mm)


@pytest.mark.parametrize("profile", Profile)
@pytest.mark.parametrize("points", [POINTS, DENSE_POINTS, DENSEST_POINTS])
def test_the_quadrature_has_unit_moments(points: np.ndarray, profile: Profile) -> None:
    x, y, weight = points[profile].T
    assert np.isclose(weight.sum(), 1.0)
    np.testing.assert_allclose([weight @ x, weight @ y, weight @ (x * y)], 0.0, atol=1e-12)
    np.testing.assert_allclose([weight @ x**2, weight @ y**2], 1.0)


@pytest.mark.parametrize(
    ("profile", "fourth"), [(Profile.DOME, 6.0), (Profile.FLAT, 56.0 / 11.0), (Profile.RIM, 4.0)]
)
def test_the_quadrature_is_that_of_its_profile(profile: Profile, fourth: float) -> None:
    """Mean of r^4 where (1 - r^2)^k has unit second moments: 8 (k + 2) / (k + 3), k = 1, -1/4, -1."""
    for points in (POINTS, DENSE_POINTS, DENSEST_POINTS):
        x, y, weight = points[profile].T
        assert weight @ (x**2 + y**2) ** 2 == pytest.approx(fourth)


@pytest.mark.parametrize(("radius", "error"), [(0.5, 0.05), (1.0, 0.04), (2.0, 0.015), (3.0, 0.01)])
def test_a_dome_is_the_pressure_under_a_ball_on_a_pad(radius: float, error: float) -> None:
    """Errors of the mean of r^4, which is 5 % from that of a half-space; radii in thicknesses."""
    x, y, weight = DENSEST_POINTS[Profile.DOME].T
    ours = weight @ (x**2 + y**2) ** 2
    assert ours == pytest.approx(ball_on_layer(radius, 0.48)[2], rel=error)


@pytest.mark.parametrize("sticks", [False, True])
@pytest.mark.parametrize("radius", [0.5, 0.75, 1.0, 1.25, 1.5])
def test_a_flat_profile_is_the_pressure_under_a_rigid_face_on_a_pad(radius: float, sticks: bool) -> None:
    """The mean of r^4, which is 4.8 on a half-space and 16 / 3 for an even pressure."""
    x, y, weight = DENSEST_POINTS[Profile.FLAT].T
    _, _, fourth, _ = RigidFace(radius, 1.0, 0.48, sticks).moments
    assert weight @ (x**2 + y**2) ** 2 == pytest.approx(fourth, rel=0.05)


def test_nodal_forces_are_those_of_the_patch(pad_state: PadState) -> None:
    model = pad_state.model
    nodal = np.zeros((3, model.grid.count_x + 3, model.grid.count_y + 3))
    points = POINTS[Profile.DOME]
    add_pressure(SHAPE, model.grid, points, nodal)
    away_mm, weight = points[:, :2] @ ROOT.T, points[:, 2]
    force = weight[:, None] * np.column_stack([np.ones(len(weight)), away_mm])
    expected = model.patch.load(SHAPE[:2] + away_mm, force)
    np.testing.assert_allclose(model.by_node(np.moveaxis(nodal, 0, -1)), expected, atol=1e-12)


@pytest.mark.parametrize("count", [5, 6, 12])
def test_splines_are_those_of_their_knots_and_have_their_slopes(count: int) -> None:
    knots = np.concatenate([np.zeros(3), np.arange(count + 1.0), np.full(3, float(count))])
    for place in np.linspace(0.01, count - 0.01, 97):
        value, slope = np.empty(4), np.empty(4)
        first = cubic(place, count, value, slope)
        for k in range(4):
            spline = BSpline(knots, np.eye(count + 3)[first + k], 3)
            assert value[k] == pytest.approx(float(spline(place)), abs=1e-12)
            assert slope[k] == pytest.approx(float(spline.derivative()(place)), abs=1e-11)


def test_splines_beyond_the_ends_are_those_of_the_end() -> None:
    for beyond, end in ((-0.3, 0.0), (8.2, 8.0)):
        value, slope, expected = np.empty(4), np.empty(4), np.empty(4)
        assert cubic(beyond, 8, value, slope) == cubic(end, 8, expected, np.empty(4))
        np.testing.assert_array_equal(value, expected)
        np.testing.assert_array_equal(slope, np.zeros(4))


def test_nodes_are_counted_along_x_and_y_whichever_side_is_longer(pad_state: PadState) -> None:
    tall = SplinePatch(size_mm=(8.0, 10.0), elements=(5, 7), boundary="soft")
    assert not tall.is_x_slow
    grid = pad_state.model.grid._replace(
        corner_x=-4.0, corner_y=-5.0, step_x=1.6, step_y=10.0 / 7.0, count_x=5, count_y=7
    )
    nodal = np.zeros((3, 8, 10))
    shape = np.array([0.5, -1.0, 0.9, 0.1, 0.7])
    points = POINTS[Profile.DOME]
    add_pressure(shape, grid, points, nodal)
    away_mm = points[:, :2] @ np.array([[0.9, 0.0], [0.1, 0.7]]).T
    expected = tall.load(shape[:2] + away_mm, points[:, 2:] * np.ones(3))[:, 0]
    np.testing.assert_allclose(nodal[0].swapaxes(0, 1).ravel(), expected, atol=1e-12)


def test_images_on_a_layer_are_fourier_sums() -> None:
    """Against Gaussians with the second moments of the patch: beyond it the profile hardly matters."""
    place_mm = np.array([[5.0, 1.0], [-4.0, 3.0], [3.0, -5.0]])
    slope = np.tile(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (3, 1, 1))
    upright = np.tile(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), (3, 1, 1))
    table, shape = layer_at(0.0), np.array([0.5, -0.5, 0.8, 0.0, 0.8])
    image, lifted = np.zeros((5, 6)), np.zeros((5, 6))
    add_layer_images(shape, int(Profile.DOME), table, Markers(place_mm, slope), image)
    add_layer_images(shape, int(Profile.DOME), table, Markers(place_mm, upright), lifted)
    for load, is_shear, sign in ((0, False, -1.0), (1, True, 1.0)):
        expected = sign * gaussian_on_layer(place_mm - shape[:2], 0.8, is_shear=is_shear)
        found = np.column_stack([image[load].reshape(-1, 2), lifted[load].reshape(-1, 2)[:, 0]])
        np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())


def gaussian_images(centre_mm: np.ndarray, root_mm: float, place_mm: np.ndarray) -> np.ndarray:
    """(5, 2 m) motion of markers along x and y by unit shear along x and y (rows 1 and 2) in a Gaussian."""
    table = layer_at(0.3)
    rate = np.log(root_mm / table.root[0]) / np.log(table.root[1] / table.root[0])
    low = int(rate)
    value = (1.0 + low - rate) * table.value[low] + (rate - low) * table.value[low + 1]
    away_mm = place_mm - centre_mm
    distance_mm = np.linalg.norm(away_mm, axis=1)
    c, s = away_mm.T / distance_mm
    even, turned = (
        np.interp(distance_mm, table.step * np.arange(len(value)), value[:, column]) for column in (2, 3)
    )
    found = np.zeros((5, 2 * len(place_mm)))
    found[1] = np.column_stack([even + turned * (c**2 - s**2), 2.0 * turned * s * c]).ravel()
    found[2] = np.column_stack([2.0 * turned * s * c, even - turned * (c**2 - s**2)]).ravel()
    return found


@pytest.mark.parametrize(
    ("profile", "error", "of_another"),
    [(Profile.DOME, 0.08, 0.16), (Profile.FLAT, 0.05, 0.1), (Profile.RIM, 0.03, 0.12)],
)
def test_images_are_those_of_the_pressure_of_a_profile(
    profile: Profile, error: float, of_another: float
) -> None:
    """Against narrow Gaussians at many points, for a root of .55 and a depth of .3 thicknesses."""
    random = np.random.default_rng(5)
    place_mm = random.uniform(-5.0, 5.0, (60, 2))
    slope = np.tile(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (60, 1, 1))
    table, markers = layer_at(1.2), Markers(place_mm, slope)
    found = np.zeros((5, 120))
    add_layer_images(np.array([0.0, 0.0, 2.2, 0.0, 2.2]), int(profile), table, markers, found)
    expected, wide_mm = np.zeros((5, 120)), np.sqrt(2.2**2 - 0.3**2)
    for x, y, weight in DENSE_POINTS[profile]:
        one = np.zeros((5, 120))
        narrow = np.array([wide_mm * x, wide_mm * y, 0.3, 0.0, 0.3])
        add_layer_images(narrow, int(Profile.DOME), table, markers, one)
        expected += weight * one
    assert np.linalg.norm(found[0] - expected[0]) < error * np.linalg.norm(expected[0])
    other, image = Profile.FLAT if profile is Profile.RIM else Profile.RIM, np.zeros((5, 120))
    add_layer_images(np.array([0.0, 0.0, 2.2, 0.0, 2.2]), int(other), table, markers, image)
    assert np.linalg.norm(image[0] - expected[0]) > of_another * np.linalg.norm(expected[0])


@pytest.mark.parametrize("profile", Profile)
@pytest.mark.parametrize("root", [np.array([[2.2, 0.0], [0.0, 2.2]]), np.array([[2.6, 0.0], [0.6, 1.6]])])
def test_the_image_of_a_turn_is_that_of_its_torque(root: np.ndarray, profile: Profile) -> None:
    """Against narrow Gaussians at many points: as strong within 4 %, at a depth of .3 thicknesses."""
    place_mm = np.random.default_rng(5).uniform(-5.0, 5.0, (60, 2))
    slope = np.tile(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (60, 1, 1))
    table, markers = layer_at(1.2), Markers(place_mm, slope)
    found, expected, torque = np.zeros((5, 120)), np.zeros(120), 0.0
    shape = np.array([0.0, 0.0, root[0, 0], root[1, 0], root[1, 1]])
    add_layer_images(shape, int(profile), table, markers, found)
    for x, y, weight in DENSE_POINTS[profile]:
        away_mm, one = root @ (x, y), np.zeros((5, 120))
        add_layer_images(np.array([*away_mm, 0.25, 0.0, 0.25]), int(Profile.DOME), table, markers, one)
        expected += weight * (away_mm[0] * one[2] - away_mm[1] * one[1])
        torque += weight * away_mm @ away_mm
    assert torque == pytest.approx(np.trace(root @ root.T))
    assert found[3] @ expected == pytest.approx(expected @ expected, rel=0.04)


def test_radial_shear_is_the_place_over_the_root_on_a_round_patch() -> None:
    np.testing.assert_allclose(radial_arms(np.array([3.0, 1.0, 1.6, 0.0, 1.6])), [1 / 1.6, 0.0, 1 / 1.6])


@pytest.mark.parametrize("profile", Profile)
def test_radial_shear_is_along_the_gradient_of_the_pressure(profile: Profile) -> None:
    """Across a long patch, and as strong as on a round one; normal to the ellipses of equal pressure."""
    root = np.array([[0.6, 0.0], [2.1, 0.5]])
    xx, yx, yy = radial_arms(np.array([0.0, 0.0, root[0, 0], root[1, 0], root[1, 1]]))
    place_mm = POINTS[profile][:, :2] @ root.T
    shear = place_mm @ [[xx, yx], [yx, yy]]
    assert POINTS[profile][:, 2] @ (shear**2).sum(axis=1) == pytest.approx(2.0)
    gradient = place_mm @ np.linalg.inv(root @ root.T)
    np.testing.assert_allclose(shear / np.linalg.norm(shear), gradient / np.linalg.norm(gradient), atol=1e-12)


def test_slopes_of_the_radial_shear_are_those_of_differences() -> None:
    shape, slope = np.array([0.0, 0.0, 1.1, -0.4, 0.7]), np.empty((3, 3))
    radial_arm_slopes(shape, slope)
    for root in range(3):
        step = 1e-6 * np.eye(5)[ROOT_XX + root]
        above, below = (np.array(radial_arms(shape + sign * step)) for sign in (1.0, -1.0))
        np.testing.assert_allclose(slope[root], (above - below) / 2e-6, rtol=1e-6)


def test_turn_and_radial_shear_are_in_proportion_to_the_arm() -> None:
    place_mm = np.array([[1.0, 0.5], [-2.0, 1.0], [0.2, -3.0]])
    slope = np.tile(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (3, 1, 1))
    table, markers = layer_at(0.3), Markers(place_mm, slope)
    shape = np.array([0.3, -0.2, 1.2, 0.4, 0.9])
    whole, expected = np.zeros((5, 6)), np.zeros((5, 6))
    add_layer_images(shape, int(Profile.FLAT), table, markers, whole)
    # Gaussians at the same points, with their arms; those of the turn have its torque
    root = np.array([[1.2, 0.0], [0.4, 0.9]])
    blob = min(0.25 * np.sqrt(1.2 * 0.9), 0.9 * np.sqrt(np.linalg.eigvalsh(root @ root.T)[0]))
    rest = np.linalg.cholesky(root @ root.T - blob**2 * np.eye(2))
    moment = root @ root.T
    shear = np.sqrt(2.0 * np.linalg.det(moment) / np.trace(moment)) * np.linalg.inv(moment)
    for x, y, weight in POINTS[Profile.FLAT]:
        away_mm = rest @ (x, y)
        one = gaussian_images(shape[:2] + away_mm, blob, place_mm)
        expected[3] += weight * (away_mm[0] * one[2] - away_mm[1] * one[1])
        arm = shear @ away_mm
        expected[4] += weight * (arm[0] * one[1] + arm[1] * one[2])
    expected[3] *= np.trace(moment) / np.trace(rest @ rest.T)
    np.testing.assert_allclose(whole[3:], expected[3:], atol=1e-9)


def test_a_wide_patch_presses_one_hollow(pad_state: PadState) -> None:
    """The points of its quadrature are no separate loads."""
    model = pad_state.model
    wide = np.array([[0.5, -0.5, 3.6, 0.3, 3.2, 40.0, 0.0, 0.0, 0.0, -0.1]])
    face_mm = forced(
        model.by_node(tractions(model, Patches(parameters=wide, profile=np.zeros(1, dtype=np.int64)))),
        model.face,
    )
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
    add_pressure(shape, model.grid, POINTS[Profile.DOME], few)
    add_pressure(shape, model.grid, DENSE_POINTS[Profile.DOME], many)
    rows = model.by_sides.shape[-1]
    for axis in range(3):
        sides = model.by_sides[axis].reshape(-1, rows)
        found, expected = few[0].ravel() @ sides, many[0].ravel() @ sides
        np.testing.assert_allclose(found, expected, atol=0.01 * np.abs(expected).max())
