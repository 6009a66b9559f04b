"""Relative area and contrast of dots, and what shifts cost by them, against numpy."""

import numpy as np
import pytest

from manytouch.tracking.matching.relative_appearance import (
    APPEARANCE,
    add_appearance_cost,
    measure_appearance,
    measure_difference,
    running_mean,
    sample_step,
    update_appearance,
)


def reference_appearance(scene, assignment):
    graph, dots = scene.graph.arrays, scene.dots
    quantity = np.stack([dots.area_px2, dots.contrast], axis=1)
    found = np.full((len(graph.rest_px), 2), np.nan)
    for k in np.flatnonzero(assignment.dot >= 0):
        near = assignment.dot[graph.neighbour[graph.start[k] : graph.adjacent_end[k]]]
        near = near[near >= 0]
        if len(near) >= APPEARANCE.least_adjacent:
            found[k] = quantity[assignment.dot[k]] / quantity[near].mean(axis=0) - 1.0
    return found


def test_appearance_is_relative_to_the_mean_of_adjacent_dots(scene):
    assignment, nodes = scene.assignment(0.7), len(scene.graph.arrays.rest_px)
    found = np.empty((nodes, 2))
    measure_appearance(nodes, 1, assignment.dot, scene.dots, scene.graph.arrays, found)
    np.testing.assert_allclose(found, reference_appearance(scene, assignment), atol=1e-12)
    assert np.isfinite(found).sum() > 60


def test_brightness_and_scale_do_not_change_appearance(scene):
    assignment, nodes = scene.assignment(0.9), len(scene.graph.arrays.rest_px)
    other = scene.dots._replace(area_px2=1.7 * scene.dots.area_px2, contrast=0.4 * scene.dots.contrast)
    found = np.empty((2, nodes, 2))
    for dots, out in zip((scene.dots, other), found, strict=True):
        measure_appearance(nodes, 1, assignment.dot, dots, scene.graph.arrays, out)
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)


def test_the_difference_of_a_frame_is_a_clipped_mean(scene):
    assignment, markers = scene.assignment(0.9), scene.graph.marker_count
    usual = scene.chance.normal(0.0, 0.4, (markers, 2))
    difference = np.empty(2)
    graph = scene.graph.arrays
    workspace = np.empty((len(graph.rest_px), 2))
    measure_difference(assignment.dot, scene.dots, graph, usual, workspace, difference)
    off = np.abs(reference_appearance(scene, assignment)[:markers] - usual)
    expected = np.nanmean(np.minimum(off, APPEARANCE.largest_difference), axis=0)
    assert sample_step(markers, APPEARANCE.check_samples) == 1
    np.testing.assert_allclose(difference, expected, atol=1e-12)


def test_running_means_pass_over_unknown_values(scene):
    assert running_mean(1.0, 2.0, 0.25) == 1.25
    assert running_mean(np.nan, 2.0, 0.25) == 2.0
    assert running_mean(1.0, np.nan, 0.25) == 1.0
    assignment, markers = scene.assignment(0.6), scene.graph.marker_count
    before = scene.chance.normal(0.0, 0.1, (markers, 2))
    before[::7] = np.nan
    after = np.empty_like(before)
    update_appearance(assignment.dot, scene.dots, scene.graph.arrays, before, 0.2, after)
    now = reference_appearance(scene, assignment)[:markers]
    expected = np.where(np.isnan(now), before, np.where(np.isnan(before), now, before + 0.2 * (now - before)))
    np.testing.assert_allclose(after, expected, atol=1e-12)


@pytest.mark.parametrize("shift", [0, 3, 7])
def test_the_cost_of_shifts_is_least_for_the_true_one(scene, shift):
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    usual = scene.chance.normal(0.0, 0.05, (markers, 2))
    shifted = graph.shifted
    target = shifted[shift]
    measured = np.full((shifted.shape[1], 2), np.nan)
    is_on = (target >= 0) & (target < markers)
    measured[is_on] = usual[target[is_on]] + scene.chance.normal(0.0, 0.005, (is_on.sum(), 2))
    cost = np.zeros(len(shifted))
    add_appearance_cost(measured, shifted, usual, np.full(2, 0.004), cost)
    np.testing.assert_allclose(cost, reference_cost(measured, shifted, usual, np.full(2, 0.004)), rtol=1e-9)
    assert np.argmin(cost) == shift
    assert cost[0] == 0.0


def reference_cost(measured, shifted, usual, usual_difference):
    markers = len(usual)
    padded = np.vstack([usual, np.full((shifted.max() + 2 - markers, 2), np.nan)])
    off = np.abs(measured - padded[shifted])  # (s, N, 2); the last row stands for -1
    cost = np.zeros(len(shifted))
    for quantity in range(2):
        each = off[:, :, quantity]
        least = np.nanmin(np.nanmean(np.minimum(each, APPEARANCE.largest_difference), axis=1))
        std = max(APPEARANCE.least_std, APPEARANCE.mean_to_std * max(usual_difference[quantity], least))
        square = np.nanmean(np.minimum((each / std) ** 2, APPEARANCE.largest_square), axis=1)
        number = np.isfinite(each[0]).sum()
        cost += 0.5 * number / APPEARANCE.dependence * (square - square[0])
    return cost
