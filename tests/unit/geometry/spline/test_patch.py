"""The spline patch: what bicubic splines reproduce, in both orientations and with both boundaries."""

from dataclasses import replace

import numpy as np
import pytest

import spline_reference as reference
from manytouch.geometry.spline import basis
from manytouch.geometry.spline.patch import SplinePatch
from patches import PATCHES, bent

SHEAR_MM2 = 1.8


@pytest.fixture(params=[*PATCHES, "clamped, sheared", "clamped, upright, sheared", "soft, sheared"])
def patch(request: pytest.FixtureRequest) -> SplinePatch:
    name = request.param.removesuffix(", sheared")
    return replace(PATCHES[name], shear_mm2=SHEAR_MM2 if name != request.param else 0.0)


@pytest.fixture
def bent_mm(patch: SplinePatch) -> np.ndarray:
    return bent(patch)


def points_of(patch: SplinePatch, count: int = 40) -> np.ndarray:
    share = np.random.default_rng(1).uniform(0.0, 1.0, (count, 2))
    return patch.corner_mm + share * np.array(patch.size_mm)


def test_the_short_side_runs_fastest(patch: SplinePatch) -> None:
    assert patch.shape[0] >= patch.shape[1]
    step = np.abs(patch.place_mm[1] - patch.place_mm[0])
    assert step[patch.axes[1]] > 0.0
    assert step[patch.axes[0]] == 0.0


def test_coefficients_at_greville_points_give_linear_fields_back() -> None:
    for patch in (
        SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), boundary="soft", centre_mm=(3.0, 1.0)),
        SplinePatch(size_mm=(30.0, 40.0), elements=(7, 9), boundary="soft", shear_mm2=SHEAR_MM2),
    ):
        point = points_of(patch)
        at, x, y = patch.at(point), patch.place_mm[:, 0], patch.place_mm[:, 1]
        np.testing.assert_allclose(
            at.displacement(np.column_stack([x, y, y])), point[:, [0, 1, 1]], atol=1e-12
        )
        for tables in ((at.dx, at.dy), (at.slope_x, at.slope_y)):
            np.testing.assert_allclose((tables[0] * x[at.node]).sum(axis=1), 1.0, atol=1e-12)
            np.testing.assert_allclose((tables[1] * x[at.node]).sum(axis=1), 0.0, atol=1e-12)
            np.testing.assert_allclose((tables[1] * y[at.node]).sum(axis=1), 1.0, atol=1e-12)


def test_the_tables_are_those_of_scipy(patch: SplinePatch, bent_mm: np.ndarray) -> None:
    point = points_of(patch)
    at = patch.at(point)

    def field(table: np.ndarray, component: int) -> np.ndarray:
        return (table * bent_mm[at.node, component]).sum(axis=1)

    for name, component, orders in (
        ("value", 0, (0, 0)),
        ("dx", 1, (1, 0)),
        ("dy", 1, (0, 1)),
        ("slope_x", 2, (1, 0)),
        ("slope_y", 2, (0, 1)),
        ("dxx", 2, (2, 0)),
        ("dyy", 2, (0, 2)),
    ):
        expected = reference.derivative(patch, bent_mm, point, *orders)[:, component]
        np.testing.assert_allclose(field(getattr(at, name), component), expected, atol=1e-12, err_msg=name)
    np.testing.assert_allclose(at.displacement(bent_mm), reference.moved(patch, bent_mm, point), atol=1e-12)


def test_slopes_at_the_nodes_are_those_of_the_tables(patch: SplinePatch, bent_mm: np.ndarray) -> None:
    points = patch.at(patch.place_mm)
    own = bent_mm[points.node, 2]
    expected = np.stack([(points.slope_x * own).sum(axis=1), (points.slope_y * own).sum(axis=1)], axis=1)
    np.testing.assert_allclose(patch.slopes(bent_mm[:, 2]), expected, atol=1e-13)
    couple = np.random.default_rng(4).normal(size=(patch.node_count, 2))
    work = float((couple * expected).sum())
    assert float(patch.slope_moments(couple) @ bent_mm[:, 2]) == pytest.approx(work, rel=1e-12)


def test_a_window_has_the_factors_of_the_tables(patch: SplinePatch, bent_mm: np.ndarray) -> None:
    point = points_of(patch)
    window, grid = patch.window(point), bent_mm.reshape(*patch.shape, 3)
    for k, (slow, fast) in enumerate(window.first):
        nodal = grid[slow : slow + 4, fast : fast + 4]
        for orders in ((0, 0), (1, 0), (0, 1), (3, 0), (1, 2), (0, 3)):
            along = orders if patch.is_x_slow else orders[::-1]
            expected = reference.derivative(patch, bent_mm, point[k : k + 1], *along)[0]
            for component in range(3):
                table = window.bending[k] if component == 2 else window.plane[k]
                found = table[0, orders[0]] @ nodal[..., component] @ table[1, orders[1]]
                assert found == pytest.approx(expected[component], abs=1e-11)


def test_places_next_to_a_knot_get_all_functions_of_one_element() -> None:
    length, elements = 19.634954084936208, 96
    knot = np.arange(1, elements) * (length / elements)
    for place in (knot, np.nextafter(knot, 0.0), np.nextafter(knot, length), knot + 1e-9):
        _, table = basis.values(length, elements, place)
        np.testing.assert_allclose(table[:, 0].sum(axis=1), 1.0, atol=1e-12)
        size = np.abs(table[:, 3]).sum(axis=1)
        np.testing.assert_allclose(table[:, 3].sum(axis=1) / size, 0.0, atol=1e-9)


@pytest.mark.parametrize("shear_mm2", [0.0, SHEAR_MM2, 400.0])
def test_a_clamped_outline_does_not_move(shear_mm2: float) -> None:
    """u, v, the slope of b across the outline and b - a b'' along each axis are 0."""
    patch = SplinePatch(size_mm=(48.0, 36.0), elements=(11, 8), shear_mm2=shear_mm2)
    moved = np.random.default_rng(2).normal(size=(patch.node_count, 3)) * patch.is_free
    for axis in range(2):
        half = 0.5 * np.array(patch.size_mm)
        for side in (-1.0, 1.0):
            point = np.column_stack([np.linspace(-half[i], half[i], 9) for i in range(2)])
            point[:, axis] = side * half[axis]
            at = patch.at(point)
            np.testing.assert_allclose(at.displacement(moved)[:, :2], 0.0, atol=1e-12)
            b = moved[at.node, 2]
            slope = (at.slope_x, at.slope_y)[axis]
            np.testing.assert_allclose((slope * b).sum(axis=1), 0.0, atol=1e-12)
            curvature = (at.dxx, at.dyy)[axis]
            value = reference.derivative(patch, moved, point, 0, 0)[:, 2]
            within = 1e-12 * (1.0 + shear_mm2)
            np.testing.assert_allclose(value, shear_mm2 * (curvature * b).sum(axis=1), atol=within)
            assert np.abs(((at.dx, at.dy)[axis] * moved[at.node, 0]).sum(axis=1)).max() > 0.1


def test_loads_keep_their_sum_and_centroid(patch: SplinePatch) -> None:
    inner = np.array(patch.centre_mm) + np.random.default_rng(3).uniform(-4.0, 4.0, (20, 2))
    force = np.outer(np.linspace(0.5, 2.0, 20), [0.3, -0.2, -1.0])
    nodal = patch.load(inner, force)
    np.testing.assert_allclose(nodal.sum(axis=0), force.sum(axis=0))
    np.testing.assert_allclose(nodal.T @ patch.place_mm, force.T @ inner, rtol=1e-11, atol=1e-11)


def test_the_work_of_a_load_is_that_of_its_nodal_forces(patch: SplinePatch, bent_mm: np.ndarray) -> None:
    point = points_of(patch)
    force = np.random.default_rng(4).normal(size=(len(point), 3))
    work = (force * reference.moved(patch, bent_mm, point)).sum()
    assert (patch.load(point, force) * bent_mm).sum() == pytest.approx(work)


def test_points_on_the_rectangle_and_its_outline_are_covered() -> None:
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), centre_mm=(100.0, -10.0))
    inside_mm = np.array([[100.0, -10.0], [80.0, -10.0], [120.0, 5.0], [81.0, -24.0]])
    outside_mm = np.array([[79.9, -10.0], [120.1, 0.0], [100.0, 5.1], [100.0, -25.1], [0.0, 0.0]])
    assert patch.covers(inside_mm).tolist() == [True] * 4
    assert patch.covers(outside_mm).tolist() == [False] * 5


def test_areas_sum_up_to_the_patch(patch: SplinePatch) -> None:
    if patch.boundary == "soft":
        assert patch.area_mm2.sum() == pytest.approx(np.prod(patch.size_mm))
    else:
        assert patch.area_mm2.sum() < np.prod(patch.size_mm)


def test_invalid_patches_raise() -> None:
    with pytest.raises(ValueError, match="4 elements or more"):
        SplinePatch(size_mm=(10.0, 10.0), elements=(3, 8))
    with pytest.raises(ValueError, match="must be positive"):
        SplinePatch(size_mm=(10.0, 0.0), elements=(8, 8))
