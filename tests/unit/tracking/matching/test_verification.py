"""Verification against neighbours: the errors, against plain Python, and which dots are dropped."""

import numpy as np
import pytest

from manytouch.tracking.matching.records import MatchingState
from manytouch.tracking.matching.spatial_hash import build_grid
from manytouch.tracking.matching.verification import (
    VERIFICATION,
    drop_folded,
    drop_replaceable,
    interpolation_error,
    line_error,
    verify,
)


def state_without_past(graph):
    markers, nodes = graph.marker_count, len(graph.arrays.rest_px)
    return MatchingState(
        position_px=np.array(graph.arrays.rest_px[:markers]),
        frames_unseen=np.zeros(markers, dtype=np.int64),
        presence=np.full(nodes, 0.5),
        seen_count=0,
        roughness=0.0,
        is_consecutive=False,
        is_ambiguous=False,
        appearance=np.full((markers, 2), np.nan),
        appearance_difference=np.full(2, np.nan),
    )


def known_node(graph, assignment, k, direction, steps):
    """The displacement of the node some steps away from node k, or None."""
    for _ in range(steps):
        k = int(graph.opposite[k, direction]) if k >= 0 else -1
    return assignment.displacement_px[k] if k >= 0 and assignment.dot[k] >= 0 else None


def reference_line_error(graph, assignment, k):
    """Lower median of the distances from cubics through four and quadratics through three known nodes."""
    own, off = assignment.displacement_px[k], []
    for axis in (0, 2):
        one = [known_node(graph, assignment, k, axis + side, 1) for side in (0, 1)]
        two = [known_node(graph, assignment, k, axis + side, 2) for side in (0, 1)]
        three = [known_node(graph, assignment, k, axis + side, 3) for side in (0, 1)]
        for side in (0, 1):
            if all(each[side] is not None for each in (one, two, three)):
                off.append(3.0 * (one[side] - two[side]) + three[side] - own)
        if all(each is not None for each in (*one, *two)):
            off.append((4.0 * (one[0] + one[1]) - two[0] - two[1]) / 6.0 - own)
    distance = np.sort(np.linalg.norm(off, axis=1)) if off else np.zeros(1)
    return distance[(len(distance) - 1) // 2]


def test_errors_equal_their_definitions(scene):
    graph, assignment = scene.graph.arrays, scene.assignment(0.85)
    interpolated = 0
    for k in np.flatnonzero(assignment.dot >= 0).tolist():
        expected = reference_line_error(graph, assignment, k)
        assert line_error(k, graph, assignment, np.empty(6)) == pytest.approx(expected, abs=1e-9)
        used = slice(graph.start[k], graph.start[k + 1])
        neighbour, coefficient = graph.neighbour[used], graph.interpolation[used].astype(np.float64)
        error = interpolation_error(k, graph, assignment)
        if (assignment.dot[neighbour[coefficient != 0.0]] < 0).any():
            assert error == np.inf
        else:
            off = coefficient @ assignment.displacement_px[neighbour] - assignment.displacement_px[k]
            assert error == pytest.approx(np.linalg.norm(off), abs=1e-6)
            interpolated += 1
    assert interpolated > 0


@pytest.mark.parametrize("is_calm", [False, True])
def test_right_dots_are_kept_and_wrong_ones_dropped(scene, is_calm):
    graph, assignment = scene.graph.arrays, scene.assignment(1.1)
    state, count = state_without_past(scene.graph), scene.graph.marker_count
    assert verify(count, graph, state, assignment, 0.1, is_calm, scene.workspace) == 0
    wrong = [13, 38, 60]
    swapped = [14, 49, 61]
    for k, other in zip(wrong, swapped, strict=True):
        assignment.dot[k] = scene.true_dot[other]
        assignment.displacement_px[k] = scene.dots.centre_px[scene.true_dot[other]] - graph.rest_px[k]
    dropped = verify(count, graph, state, assignment, 0.1, is_calm, scene.workspace)
    assert (assignment.dot[wrong] == -1).all()
    assert dropped == (assignment.dot[:count] < 0).sum()
    assert dropped <= len(wrong) + 3


def test_a_dot_is_dropped_where_a_free_one_is_nearer_to_the_prediction(scene):
    graph, assignment = scene.graph.arrays, scene.assignment(1.1)
    count, centre = scene.graph.marker_count, np.array(scene.dots.centre_px)
    (false, *_) = np.flatnonzero(~assignment.is_used)
    others = np.flatnonzero(~assignment.is_used)[1:]
    centre[others] = -1e3
    k = 38
    right = int(assignment.dot[k])
    centre[false] = centre[right] + np.array([0.35, 0.1]) * graph.spacing_px[k]
    grid = build_grid(centre, graph.spacing_px[k])
    assert drop_replaceable(grid, count, graph, assignment, 0.1) == 0
    assignment.dot[k], assignment.is_used[right], assignment.is_used[false] = false, False, True
    assignment.displacement_px[k] = centre[false] - graph.rest_px[k]
    assert drop_replaceable(grid, count, graph, assignment, 0.1) == 1
    assert assignment.dot[k] == -1
    assert not assignment.is_used[false]


def test_of_a_folded_triangle_the_corner_with_the_largest_error_is_dropped(scene):
    graph, assignment = scene.graph.arrays, scene.assignment(1.1)
    centre = np.array(graph.rest_px[: scene.graph.marker_count])
    assignment.dot[: len(centre)] = np.arange(len(centre))
    assignment.is_used[:] = True
    ratio = np.zeros(len(graph.rest_px))
    drop_folded(centre, graph, assignment, ratio)
    assert (assignment.dot[: len(centre)] >= 0).all()
    for moved in (24, 29, 40, 45, 51, 62):
        now = centre.copy()
        now[moved] += 1.5 * (centre[41] - centre[40])
        ratio[:], ratio[moved] = scene.chance.uniform(0.0, 1.0, len(ratio)), 2.0
        drop_folded(now, graph, assignment, ratio)
        assert np.flatnonzero(assignment.dot[: len(centre)] < 0).tolist() == [moved]
        assert not assignment.is_used[moved]
        assignment.dot[moved], assignment.is_used[moved] = moved, True
    assert VERIFICATION.fold_ratio < 1.0
