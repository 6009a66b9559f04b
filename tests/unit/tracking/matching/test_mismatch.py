"""Connected sets and the boundaries of mismatched parts, against scipy's connected components."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from manytouch.tracking.matching.mismatch import keep_largest_set, mark_mismatched, widen_mismatch
from manytouch.tracking.matching.spatial_hash import build_grid


def reference_largest(graph, assignment, tolerance):
    """Nodes of the largest set of adjacent nodes whose displacements differ by less."""
    nodes = len(graph.rest_px)
    node = np.repeat(np.arange(nodes), graph.adjacent_end - graph.start[:-1])
    near = np.concatenate(
        [graph.neighbour[a:b] for a, b in zip(graph.start, graph.adjacent_end, strict=False)]
    )
    is_known = (assignment.dot[node] >= 0) & (assignment.dot[near] >= 0)
    node, near = node[is_known], near[is_known]
    off = np.linalg.norm(assignment.displacement_px[node] - assignment.displacement_px[near], axis=1)
    alike = off < tolerance * graph.spacing_px[node]
    edges = coo_array((np.ones(alike.sum()), (node[alike], near[alike])), shape=(nodes, nodes))
    _, label = connected_components(edges, directed=False)
    size = np.bincount(label[assignment.dot >= 0], minlength=label.max() + 1)
    return (assignment.dot >= 0) & (label == np.argmax(size))


@pytest.mark.parametrize("tolerance", [0.05, 0.1, 0.45])
def test_the_largest_connected_set_is_kept(scene, tolerance):
    graph, assignment = scene.graph.arrays, scene.assignment(0.6)
    right = graph.rest_px[:, 0] > np.median(graph.rest_px[:, 0]) + 60.0
    assignment.displacement_px[right] += 30.0
    expected = reference_largest(graph, assignment, tolerance)
    nothing = assignment.displacement_px[:0]
    size = keep_largest_set(len(graph.rest_px), graph, assignment, tolerance, nothing, scene.workspace)
    assert size == expected.sum()
    np.testing.assert_array_equal(assignment.dot >= 0, expected)


def test_the_boundary_of_a_part_that_is_off_by_one_pitch_is_marked(scene):
    graph, count = scene.graph.arrays, scene.graph.marker_count
    assignment = scene.assignment(1.1)
    grid = build_grid(scene.dots.centre_px, scene.graph.spacing_px)
    is_mismatched, free = np.ones(count, dtype=bool), np.empty(count, dtype=np.int64)
    assert mark_mismatched(count, grid, graph, assignment, free, is_mismatched) == 0
    assert not is_mismatched.any()
    # The right columns take the dots of the columns next to them; one column between is without dots.
    columns, true = 11, scene.true_dot
    for k in range(count):
        if k % columns >= 6:
            taken = true[k + 1] if k % columns < columns - 1 else -1
            assignment.dot[k] = taken
            if taken >= 0:
                assignment.displacement_px[k] = scene.dots.centre_px[taken] - graph.rest_px[k]
        if k % columns == 5:
            assignment.dot[k] = -1
    assignment.is_used[:] = False
    assignment.is_used[assignment.dot[assignment.dot >= 0]] = True
    marked = mark_mismatched(count, grid, graph, assignment, free, is_mismatched)
    assert marked == is_mismatched.sum() >= 3
    assert set(np.flatnonzero(is_mismatched) % columns) <= {5, 10}
    before = is_mismatched.copy()
    widen_mismatch(count, graph, assignment.dot, is_mismatched, np.empty(count, dtype=np.int64))
    around = np.zeros(len(graph.rest_px), dtype=bool)
    for k in np.flatnonzero(before):
        around[graph.neighbour[graph.start[k] : graph.start[k + 1]]] = True
    np.testing.assert_array_equal(is_mismatched, before | around[:count])
    assert (assignment.dot[around] == -1).all()
