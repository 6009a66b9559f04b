"""Prediction of the next node and growth over the lattice, against plain Python."""

import numpy as np
import pytest

from manytouch.tracking.matching.affine_fit import NO_FIT, RIDGE, fit_affine, rms_residual, sum_neighbours
from manytouch.tracking.matching.growth import (
    GROWTH,
    extrapolate_lines,
    fill_displacements,
    find_predicted_dot,
    grow,
)
from manytouch.tracking.matching.spatial_hash import SECOND_REACH, build_grid


def reference_lines(graph, assignment, k):
    """Quadratic extrapolations to node k along the lines on which three nodes in a row are known."""
    found = []
    for direction in range(4):
        nodes = [k]
        while len(nodes) < 4 and nodes[-1] >= 0:
            nodes.append(int(graph.opposite[nodes[-1], direction]))
        nodes = nodes[1:]
        if len(nodes) == 3 and min(nodes) >= 0 and (assignment.dot[nodes] >= 0).all():
            a, b, c = assignment.displacement_px[nodes]
            found.append(3.0 * (a - b) + c)
    return found


def reference_dot(scene, assignment, k):
    """The dot that the definition of growth gives node k, or -1."""
    graph = scene.graph.arrays
    spacing = graph.spacing_px[k]
    fit, used = fit_affine(k, graph, assignment, NO_FIT, False)
    near = graph.neighbour[graph.start[k] : graph.adjacent_end[k]]
    stretch = np.linalg.svd(np.eye(2) + np.reshape(fit[2:], (2, 2)), compute_uv=False).min()
    gate = GROWTH.gate * spacing * np.clip(stretch, 0.35, 1.2)
    if used <= GROWTH.sparse_count:
        gate = min(gate, GROWTH.sparse_gate * spacing)
    elif 2 * (assignment.dot[near] >= 0).sum() > len(near):
        # The kernel's residual leaves the ridge out; it is small against that of the fit.
        rms = rms_residual(k, graph, assignment, fit, False)
        gate = min(gate, GROWTH.narrow_gate * spacing + GROWTH.residual_factor * rms)
    lines = reference_lines(graph, assignment, k)
    shifts = [np.mean(lines, axis=0)] if lines else []
    for shift in [*shifts, np.array(fit[:2])]:
        distance = np.linalg.norm(scene.dots.centre_px - graph.rest_px[k] - shift, axis=1)
        order = np.argsort(distance)
        second = min(distance[order[1]], SECOND_REACH * gate)
        if distance[order[0]] < gate and distance[order[0]] ** 2 <= GROWTH.ratio * second**2:
            return int(order[0])
    return -1


def test_lines_are_extrapolated_quadratically(scene):
    graph, assignment = scene.graph.arrays, scene.assignment(0.8)
    numbers = []
    for k in range(len(graph.rest_px)):
        x, y, number = extrapolate_lines(k, graph, assignment)
        expected = reference_lines(graph, assignment, k)
        assert number == len(expected)
        np.testing.assert_allclose([x, y], np.sum(expected, axis=0) if expected else [0.0, 0.0], atol=1e-9)
        numbers.append(number)
    assert max(numbers) >= 3


def test_the_predicted_dot_is_the_unambiguous_one_near_the_prediction(scene):
    graph, assignment = scene.graph.arrays, scene.assignment(0.7)
    grid = build_grid(scene.dots.centre_px, scene.graph.spacing_px)
    agree, compared = 0, 0
    for k in range(scene.graph.marker_count):
        sums = sum_neighbours(k, graph, assignment, NO_FIT, False)
        if assignment.dot[k] < 0 and sums.used >= 3:
            compared += 1
            agree += find_predicted_dot(k, grid, graph, assignment, sums) == reference_dot(
                scene, assignment, k
            )
    assert compared > 15
    assert agree >= compared - 1  # the ridge may decide at the edge of a gate
    assert RIDGE < 0.1


@pytest.mark.parametrize("share", [0.15, 0.5])
def test_growth_gives_smoothly_displaced_markers_their_own_dots(scene, share):
    graph, assignment = scene.graph.arrays, scene.assignment(share)
    before = assignment.dot.copy()
    grid = build_grid(scene.dots.centre_px, scene.graph.spacing_px)
    grow(grid, scene.graph.marker_count, graph, assignment, scene.workspace)
    markers = slice(0, scene.graph.marker_count)
    grown = assignment.dot[markers]
    np.testing.assert_array_equal(grown[before[markers] >= 0], before[markers][before[markers] >= 0])
    assert ((grown < 0) | (grown == scene.true_dot[markers])).mean() > 0.97
    assert (grown == scene.true_dot[markers]).mean() > 0.9
    known = np.flatnonzero(assignment.dot >= 0)
    assert len(np.unique(assignment.dot[known])) == len(known)
    np.testing.assert_array_equal(np.flatnonzero(assignment.is_used), np.sort(assignment.dot[known]))
    np.testing.assert_allclose(
        assignment.displacement_px[known],
        scene.dots.centre_px[assignment.dot[known]] - graph.rest_px[known],
    )


@pytest.mark.parametrize("share", [0.02, 0.3, 0.9])
def test_filling_averages_known_neighbours_from_the_dots_outward(scene, share):
    graph, assignment = scene.graph.arrays, scene.assignment(share)
    if not (assignment.dot >= 0).any():
        assignment.dot[0] = scene.true_dot[0]
        assignment.displacement_px[0] = scene.dots.centre_px[scene.true_dot[0]] - graph.rest_px[0]
    expected = reference_fill(graph, assignment)
    fill_displacements(len(graph.rest_px), graph, assignment, scene.workspace)
    np.testing.assert_allclose(assignment.displacement_px, expected, atol=1e-9)


def reference_fill(graph, assignment):
    is_known = assignment.dot >= 0
    displacement = np.where(is_known[:, None], assignment.displacement_px, np.nan)
    near = [graph.neighbour[a:b] for a, b in zip(graph.start[:-1], graph.start[1:], strict=True)]
    queue = [k for k in range(len(near)) if not is_known[k] and is_known[near[k]].any()]
    is_queued = is_known.copy()
    is_queued[queue] = True
    for k in queue:  # grows while it is read
        weight = graph.weight[graph.start[k] : graph.start[k + 1]].astype(np.float64)
        has_value = np.isfinite(displacement[near[k], 0])
        for n in near[k][~has_value].tolist():
            if not is_queued[n]:
                queue.append(n)
                is_queued[n] = True
        displacement[k] = np.average(displacement[near[k][has_value]], axis=0, weights=weight[has_value])
    displacement[np.isnan(displacement[:, 0])] = assignment.displacement_px[is_known].mean(axis=0)
    return displacement
