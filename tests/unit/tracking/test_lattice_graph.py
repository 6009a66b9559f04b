"""The graph of a layout: neighbours, exterior nodes, shifts."""

import numpy as np
import pytest

from flat_sensor import rectangle_px, rows_and_columns
from manytouch.tracking.lattice_graph import EXTERIOR_HIDDEN, EXTERIOR_VISIBLE, PRESENT, build_lattice_graph

ROWS, COLUMNS, PITCH = 10, 14, 40.0
REST = rectangle_px(ROWS, COLUMNS, (PITCH, PITCH), (140.0, 120.0))
NONE_MISSING = np.zeros(len(REST), dtype=bool)


@pytest.mark.parametrize("row_column", [None, rows_and_columns(ROWS, COLUMNS)])
def test_exterior_nodes_continue_the_lattice_by_two_rings(row_column):
    graph = build_lattice_graph(REST, NONE_MISSING, row_column=row_column)
    arrays, markers = graph.arrays, graph.marker_count
    np.testing.assert_array_equal(arrays.rest_px[:markers], REST)
    exterior = arrays.rest_px[markers:]
    assert len(exterior) >= 2 * 2 * (ROWS + COLUMNS)  # corners not counted
    place = (exterior - REST[0]) / PITCH
    np.testing.assert_allclose(place, np.round(place), atol=1e-9)
    assert (place.min(axis=0) == -2).all()
    np.testing.assert_array_equal(place.max(axis=0), [COLUMNS + 1, ROWS + 1])


def test_exterior_nodes_in_view_are_visible_and_others_hidden():
    in_view = build_lattice_graph(REST, NONE_MISSING, bounds_px=(8.0, 8.0, 792.0, 592.0))
    assert (in_view.arrays.kind[: len(REST)] == PRESENT).all()
    assert (in_view.arrays.kind[len(REST) :] == EXTERIOR_VISIBLE).all()
    tight = (*(REST.min(axis=0) - 1.0), *(REST.max(axis=0) + 1.0))
    hidden = build_lattice_graph(REST, NONE_MISSING, bounds_px=tight)
    assert (hidden.arrays.kind[len(REST) :] == EXTERIOR_HIDDEN).all()


def test_shifts_move_all_nodes_by_the_same_number_of_pitches():
    graph = build_lattice_graph(REST, NONE_MISSING)
    arrays = graph.arrays
    np.testing.assert_array_equal(arrays.shifted[0], np.arange(len(arrays.rest_px)))
    steps = set()
    for shifted in arrays.shifted[1:]:
        is_on = shifted >= 0
        assert is_on.sum() > 0.7 * len(is_on)
        step = (arrays.rest_px[shifted[is_on]] - arrays.rest_px[is_on]) / PITCH
        np.testing.assert_allclose(step, np.broadcast_to(step[0], step.shape), atol=1e-9)
        steps.add(tuple(np.round(step[0]).tolist()))
    assert steps == {(x, y) for x in range(-2, 3) for y in range(-2, 3) if 0 < abs(x) + abs(y) < 3}


def test_neighbours_are_sorted_and_adjacent_ones_come_first():
    graph = build_lattice_graph(REST, NONE_MISSING, row_column=rows_and_columns(ROWS, COLUMNS))
    arrays = graph.arrays
    for k in range(len(REST)):
        distance = np.linalg.norm(arrays.rest_px[_neighbours(arrays, k)] - REST[k], axis=1)
        assert (np.diff(distance) >= 0.0).all()
        adjacent = arrays.adjacent_end[k] - arrays.start[k]
        assert (distance[:adjacent] < 1.6 * PITCH).all()
        assert (distance[adjacent:] > 1.4 * PITCH).all()
    left, right, above, below = arrays.opposite[COLUMNS + 1]
    assert (left, right, above, below) == (COLUMNS, COLUMNS + 2, 1, 2 * COLUMNS + 1)


def test_an_irregular_layout_has_neither_exterior_nodes_nor_shifts():
    chance = np.random.default_rng(3)
    graph = build_lattice_graph(REST + chance.uniform(-0.3 * PITCH, 0.3 * PITCH, REST.shape), NONE_MISSING)
    assert len(graph.arrays.rest_px) == len(REST)
    assert not graph.can_be_shifted


def test_interpolation_is_exact_for_quadratic_fields():
    arrays = build_lattice_graph(REST, NONE_MISSING).arrays
    x, y = ((REST - REST.mean(axis=0)) / PITCH).T
    value = 1.0 + 0.3 * x - 0.2 * y + 0.05 * x * x - 0.04 * x * y + 0.03 * y * y
    checked = 0
    for k in np.flatnonzero(arrays.is_interpolated[: len(REST)]):
        used = slice(arrays.start[k], arrays.start[k + 1])
        neighbour, coefficient = arrays.neighbour[used], arrays.interpolation[used]
        assert (coefficient[neighbour >= len(REST)] == 0.0).all()  # exterior nodes carry no marker
        row, column = divmod(int(k), COLUMNS)
        if 2 <= row < ROWS - 2 and 2 <= column < COLUMNS - 2:
            known = neighbour < len(REST)
            assert coefficient[known] @ value[neighbour[known]] == pytest.approx(value[k], abs=1e-5)
            checked += 1
    assert checked == (ROWS - 4) * (COLUMNS - 4)


def _neighbours(arrays, k):
    return arrays.neighbour[arrays.start[k] : arrays.start[k + 1]]
