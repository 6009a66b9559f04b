"""Measures of a frame against plain numpy."""

import numpy as np
import pytest

from manytouch.tracking.matching.frame_checks import (
    CHECKS,
    count_exterior_dots,
    count_vanished,
    is_disturbed,
    mark_disagreeing,
    measure_roughness,
    median_motion,
    rms_noise_px,
)
from manytouch.tracking.matching.records import MatchingState
from manytouch.tracking.matching.spatial_hash import build_grid


def make_state(position_px, nodes, *, frames_unseen=None):
    markers = len(position_px)
    return MatchingState(
        position_px=position_px,
        frames_unseen=np.zeros(markers, dtype=np.int64) if frames_unseen is None else frames_unseen,
        presence=np.full(nodes, 0.5),
        seen_count=markers,
        roughness=0.0,
        is_consecutive=True,
        is_ambiguous=False,
        appearance=np.full((markers, 2), np.nan),
        appearance_difference=np.full(2, np.nan),
    )


def test_matches_disagree_where_fewer_than_half_of_the_adjacent_ones_are_off_by_the_same(scene):
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    assignment = scene.assignment(0.7)
    dot = assignment.dot
    guess = np.array(graph.rest_px[:markers])
    wrong = np.flatnonzero(dot[:markers] >= 0)[::9]
    guess[wrong] += 20.0
    difference, disagrees = np.zeros_like(graph.rest_px), np.zeros(len(dot), dtype=bool)
    good, odd = mark_disagreeing(scene.dots.centre_px, guess, graph, dot, difference, disagrees)
    has_dot = dot[:markers] >= 0
    off = scene.dots.centre_px[dot[:markers]] - guess
    for k in range(markers):
        near = graph.neighbour[graph.start[k] : graph.adjacent_end[k]]
        near = near[near < markers]
        near = near[has_dot[near]]
        same = np.linalg.norm(off[near] - off[k], axis=1) < CHECKS.agreement * graph.spacing_px[k]
        assert disagrees[k] == (has_dot[k] and (len(near) == 0 or 2 * same.sum() < len(near)))
    assert (good, odd) == ((has_dot & ~disagrees[:markers]).sum(), disagrees[:markers].sum())
    assert disagrees[wrong].all()


def test_a_single_vanished_or_odd_marker_disturbs_nothing_but_several_adjacent_ones_do(scene):
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    last = scene.dots.centre_px[scene.true_dot[:markers]]
    state, score = make_state(last, len(graph.rest_px)), np.empty(len(graph.rest_px), dtype=np.int64)
    disagrees = np.zeros(len(graph.rest_px), dtype=bool)

    def is_disturbed_without(missing):
        dot = scene.true_dot.copy()
        dot[missing] = -1
        return is_disturbed(scene.dots.centre_px, graph, state, dot, disagrees, score)

    assert not is_disturbed_without([])
    assert not is_disturbed_without([40])
    assert is_disturbed_without([40, 41, 51, 52])
    disagrees[40] = True
    assert not is_disturbed_without([])
    disagrees[41] = True
    assert is_disturbed_without([])


def test_counts_of_vanished_markers_and_of_dots_on_exterior_nodes(scene):
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    assignment = scene.assignment(0.8)
    unseen = scene.chance.integers(0, 2, markers)
    expected = ((assignment.dot[:markers] < 0) & (unseen == 0)).sum()
    assert count_vanished(assignment.dot, unseen, graph.kind) == expected > 0
    exterior = np.arange(markers, len(graph.rest_px))
    assignment.displacement_px[exterior] = 0.0
    centre = np.concatenate([graph.rest_px[exterior[:5]] + 3.0, scene.dots.centre_px + 1e4])
    assignment.is_used[:] = False
    presence = np.full(len(graph.rest_px), 0.003)
    presence[exterior[4]] = 0.5
    used = assignment._replace(is_used=np.zeros(len(centre), dtype=bool))
    used.is_used[0] = True
    assert count_exterior_dots(build_grid(centre, 40.0), graph, used, presence) == 3


def test_roughness_is_the_median_second_difference(scene):
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    assignment = scene.assignment(0.9)
    moved, found = assignment.displacement_px, []
    for k in np.flatnonzero(assignment.dot[:markers] >= 0):
        for a, b in graph.opposite[k].reshape(2, 2):
            if min(a, b) >= 0 and min(assignment.dot[a], assignment.dot[b]) >= 0:
                bend = np.linalg.norm(moved[a] + moved[b] - 2.0 * moved[k])
                found.append(bend / graph.spacing_px[k])
    assert measure_roughness(markers, graph, assignment) == pytest.approx(
        np.median(found), abs=CHECKS.bin_width
    )
    assignment.dot[:] = -1
    assert np.isnan(measure_roughness(markers, graph, assignment))


def test_medians_and_noise(scene):
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    dot = scene.assignment(0.7).dot
    base = np.array(graph.rest_px[:markers])
    has_dot = dot[:markers] >= 0
    away = np.linalg.norm(scene.dots.centre_px[dot[:markers][has_dot]] - base[has_dot], axis=1)
    expected = np.sqrt(np.median((away / graph.spacing_px[:markers][has_dot]) ** 2))
    assert median_motion(scene.dots.centre_px, dot, base, graph.spacing_px) == pytest.approx(expected)
    assert median_motion(scene.dots.centre_px, np.full_like(dot, -1), base, graph.spacing_px) == np.inf
    assert rms_noise_px(scene.dots.covariance_px2) == pytest.approx(0.02)
    assert rms_noise_px(np.full((3, 2, 2), np.nan)) == 0.0
