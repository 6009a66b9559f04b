"""The hash grid finds what a search through all dots finds."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from flat_sensor import rectangle_px
from manytouch.tracking.lattice_graph import build_lattice_graph
from manytouch.tracking.matching.spatial_hash import (
    SECOND_REACH,
    build_grid,
    match_nearest,
    nearest_dot,
    nearest_free_dot,
    nearest_two,
)

seeds = st.integers(0, 2**32 - 1)


def distances(centre_px, x, y):
    return ((centre_px - [x, y]) ** 2).sum(axis=1)


@settings(max_examples=60)
@given(seed=seeds, number=st.integers(1, 60), cell=st.sampled_from([3.0, 11.0, 80.0]))
def test_nearest_dots_equal_those_of_an_exhaustive_search(seed, number, cell):
    chance = np.random.default_rng(seed)
    centre = chance.uniform(-50.0, 50.0, (number, 2))
    grid = build_grid(centre, cell)
    np.testing.assert_array_equal(np.sort(grid.dot), np.arange(number))
    is_used = chance.random(number) < 0.5
    for _ in range(10):
        x, y = chance.uniform(-70.0, 70.0, 2).tolist()
        gate = float(chance.uniform(0.5, 30.0))
        squared = distances(centre, x, y)
        inside = np.flatnonzero(squared < gate**2)
        expected = inside[np.argmin(squared[inside])] if len(inside) else -1
        best, first, second = nearest_two(grid, x, y, gate)
        assert best == expected
        others = np.delete(squared, expected) if expected >= 0 else squared
        limit = (SECOND_REACH * gate) ** 2
        np.testing.assert_allclose(second, min(np.min(others, initial=np.inf), limit))
        assert nearest_dot(grid, x, y, gate) == (best, first)
        free = inside[~is_used[inside]]
        expected_free = free[np.argmin(squared[free])] if len(free) else -1
        assert nearest_free_dot(grid, x, y, gate, is_used) == expected_free


@settings(max_examples=30)
@given(seed=seeds, gate=st.sampled_from([0.2, 0.45, 1.2]))
def test_matches_are_the_pairs_that_are_nearest_to_each_other(seed, gate):
    chance = np.random.default_rng(seed)
    rest = rectangle_px(5, 7)
    is_missing = chance.random(len(rest)) < 0.1
    graph = build_lattice_graph(rest, is_missing).arrays
    guess = rest + chance.normal(0.0, 6.0, rest.shape)
    centre = rest[chance.random(len(rest)) < 0.8] + chance.normal(0.0, 6.0, 2)
    centre = np.concatenate([centre, chance.uniform(0.0, 240.0, (5, 2))])
    dot_of_node = np.empty(len(graph.rest_px), dtype=np.int64)
    match_nearest(build_grid(centre, 40.0), guess, graph, gate, dot_of_node, np.empty(100, dtype=np.int64))
    squared = ((guess[:, None] - centre) ** 2).sum(axis=2)
    squared[squared >= (gate * graph.spacing_px[: len(rest), None]) ** 2] = np.inf
    squared[is_missing] = np.inf
    nearest = np.where(np.isfinite(squared.min(axis=1)), squared.argmin(axis=1), -1)
    for k, i in enumerate(nearest):
        rivals = np.flatnonzero(nearest == i)
        is_mutual = i >= 0 and k == rivals[np.argmin(squared[rivals, i])]
        assert dot_of_node[k] == (i if is_mutual else -1)
