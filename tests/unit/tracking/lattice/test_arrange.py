"""Numbers of markers: rows from the top, columns from the left, the same in every run."""

import numpy as np
import pytest

from manytouch.tracking.lattice.arrange import arrange


def grid_px(rows, columns, pitch=(40.0, 31.0)):
    row, column = np.indices((rows, columns))
    return np.column_stack([column.ravel() * pitch[0], row.ravel() * pitch[1]]) + np.array([60.0, 45.0])


def turned(points, degrees):
    angle = np.deg2rad(degrees)
    centre = points.mean(axis=0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return (points - centre) @ turn + centre


def nothing_cut(points):
    return np.zeros(len(points), dtype=bool)


@pytest.mark.parametrize("degrees", [0.0, 8.0, -20.0, 30.0])
def test_marker_is_row_times_columns_plus_column(degrees):
    points = turned(grid_px(6, 9), degrees)
    order = np.random.default_rng(0).permutation(len(points))
    found = arrange(points[order], nothing_cut(points))
    assert found.row_column is not None
    np.testing.assert_array_equal(order[found.dot], np.arange(54))
    np.testing.assert_array_equal(found.row_column[:, 0] * 9 + found.row_column[:, 1], np.arange(54))
    np.testing.assert_allclose(found.pitch_px, [40.0, 31.0], rtol=1e-9)


@pytest.mark.parametrize("degrees", [0.0, 45.0, -12.0])
def test_noise_and_order_change_no_number(degrees):
    points = turned(grid_px(5, 8), degrees)
    first = arrange(points, nothing_cut(points)).dot
    for seed in range(10):
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(points))
        again = arrange(points[order] + rng.normal(0.0, 0.8, points.shape), nothing_cut(points))
        np.testing.assert_array_equal(order[again.dot], first)


def test_missing_dots_are_interpolated():
    points = grid_px(6, 9)
    gone = np.array([0, 20, 21, 40])
    kept = np.setdiff1d(np.arange(54), gone)
    found = arrange(points[kept], nothing_cut(kept))
    np.testing.assert_array_equal(np.flatnonzero(found.dot < 0), gone)
    np.testing.assert_allclose(found.centre_px, points, atol=1e-6)


def test_a_cut_border_row_is_not_part_of_the_rectangle():
    points = grid_px(8, 10)
    is_cut = points[:, 1] < points[0, 1] + 1.0
    found = arrange(points, is_cut)
    assert found.row_column is not None
    assert tuple(found.row_column.max(axis=0) + 1) == (7, 10)
    np.testing.assert_array_equal(found.dot, np.arange(10, 80))


def test_a_border_line_with_few_dots_is_not_part_of_the_rectangle():
    points = np.concatenate([grid_px(7, 10), [[60.0 + 3 * 40.0, 45.0 + 7 * 31.0]]])
    found = arrange(points, nothing_cut(points))
    assert found.row_column is not None
    assert len(found.dot) == 70


def diamond_px():
    points = turned(grid_px(9, 9, pitch=(20.0, 20.0)), 45.0)
    row, column = np.indices((9, 9))
    inside = np.abs(row.ravel() - 4) + np.abs(column.ravel() - 4) <= 4
    return turned(points[inside], -45.0)


def test_an_outline_that_is_not_a_rectangle_is_a_table_in_a_stable_order():
    points = turned(diamond_px(), 10.0)
    first = arrange(points, nothing_cut(points))
    assert first.row_column is None
    assert len(first.dot) == len(points)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(points))
        again = arrange(points[order] + rng.normal(0.0, 0.4, points.shape), nothing_cut(points))
        np.testing.assert_array_equal(order[again.dot], first.dot)


def test_rings_are_a_table_in_a_stable_order():
    ring, spoke = np.indices((5, 16))
    radius, angle = 60.0 + 25.0 * ring.ravel(), (spoke.ravel() + 0.3) * 2 * np.pi / 16
    points = np.column_stack([radius * np.cos(angle) + 320.0, radius * np.sin(angle) + 240.0])
    first = arrange(points, nothing_cut(points))
    assert first.row_column is None
    assert sorted(first.dot) == list(range(80))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        order = rng.permutation(80)
        again = arrange(points[order] + rng.normal(0.0, 0.3, points.shape), nothing_cut(points))
        np.testing.assert_array_equal(order[again.dot], first.dot)


@pytest.mark.parametrize(("beyond", "kept"), [(1, 0), (2, 0), (8, 8), (12, 12)])
def test_a_table_leaves_out_strays_but_no_part_of_the_pattern(beyond, kept):
    """A gap that no lattice crosses, as next to a deep press, is between two parts of a triangle of dots."""
    points = grid_px(11, 11)
    row, column = np.indices((11, 11)).reshape(2, -1)
    triangle = points[row + column <= 10]
    part = grid_px(4, 3)[:beyond] + np.array([500.0, 17.0])
    every = np.concatenate([triangle, part])
    found = arrange(every, nothing_cut(every))
    assert found.row_column is None
    assert len(found.dot) == len(triangle) + kept
