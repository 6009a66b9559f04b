"""Cells between markers and markers around a marker."""

import numpy as np
import pytest

from manytouch.geometry.neighbours import lattice_cells, nearest_neighbours, triangle_cells

ROWS, COLUMNS = 4, 7
ROW_COLUMN = np.column_stack(np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)).astype(np.int64)


def test_a_lattice_has_a_cell_between_any_four_markers():
    cells = lattice_cells(ROW_COLUMN)
    assert cells.corner.shape == ((ROWS - 1) * (COLUMNS - 1), 4)
    assert cells.corner[0].tolist() == [0, 1, COLUMNS + 1, COLUMNS]
    at = np.bincount(cells.marker)
    assert (at[0], at[1], at[COLUMNS + 1]) == (1, 2, 4)


def test_the_mean_over_cells_keeps_constants_and_knows_lonely_markers():
    cells = lattice_cells(ROW_COLUMN)
    mean = cells.to_markers(np.full(len(cells.corner), 3.0), len(ROW_COLUMN) + 1)
    np.testing.assert_allclose(mean[:-1], 3.0)
    assert np.isnan(mean[-1])


def test_triangles_cover_the_hull_of_any_points_once():
    chance = np.random.default_rng(0)
    point = ROW_COLUMN[:, ::-1] + chance.uniform(-0.2, 0.2, (len(ROW_COLUMN), 2))
    cells = triangle_cells(point)
    a, b, c = (point[cells.corner[:, k]] for k in range(3))
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()
    assert area == pytest.approx(18.0, rel=0.1)
    assert (cells.corner[:, 2] == cells.corner[:, 3]).all()
    assert len(cells.marker) == 3 * len(cells.corner)


def test_markers_on_a_line_have_no_cells():
    assert len(triangle_cells(np.column_stack([np.arange(5.0), np.arange(5.0)])).corner) == 0
    assert len(triangle_cells(np.zeros((2, 2))).corner) == 0


def test_nearest_neighbours_come_first_and_a_marker_is_not_its_own():
    near = nearest_neighbours(ROW_COLUMN[:, ::-1].astype(np.float64) * [1.0, 1.5], 5)
    assert near.index.shape == (ROWS * COLUMNS, 5)
    assert (np.diff(near.distance, axis=1) >= 0).all()
    assert not (near.index == np.arange(ROWS * COLUMNS)[:, None]).any()
    assert set(near.index[8, :2].tolist()) == {7, 9}
    assert nearest_neighbours(np.eye(3)[:, :2], 8).index.shape == (3, 2)
