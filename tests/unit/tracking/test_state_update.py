"""The state after a frame and the measured markers, against plain numpy."""

import numpy as np
import pytest

from flat_sensor import rectangle_px
from manytouch.tracking.lattice_graph import PRESENT, build_lattice_graph
from manytouch.tracking.matching.match_frame import WorkspacePool
from manytouch.tracking.matching.records import Assignment, DotArrays, MatchingState
from manytouch.tracking.state_update import UPDATE, Measurements, NextState, update_state

DAMPING = 0.5


@pytest.mark.parametrize("seed", range(3))
def test_the_next_state_and_measurements_equal_their_definitions(seed):
    chance = np.random.default_rng(seed)
    rest = rectangle_px(7, 9, first_px=(100.0, 100.0))
    markers = len(rest)
    is_missing = chance.random(markers) < 0.05
    graph = build_lattice_graph(rest, is_missing, bounds_px=(90.0, 90.0, 500.0, 400.0))
    arrays, nodes = graph.arrays, len(graph.arrays.rest_px)
    n = nodes + 5
    dot = np.where(chance.random(nodes) < 0.7, chance.permutation(n)[:nodes], -1)
    dot[chance.random(nodes) < 0.1] = -1
    centre = chance.uniform(0.0, 500.0, (n, 2))
    known = dot >= 0
    centre[dot[known]] = arrays.rest_px[known] + chance.normal(0.0, 6.0, (known.sum(), 2))
    square = chance.normal(0.0, 0.1, (n, 2, 2))
    dots = DotArrays(centre, square @ square.transpose(0, 2, 1), chance.uniform(100, 200, n), np.ones(n))
    state = MatchingState(
        position_px=rest + chance.normal(0.0, 5.0, rest.shape),
        frames_unseen=chance.integers(0, 3, markers),
        presence=chance.uniform(0.01, 0.95, nodes),
        seen_count=markers,
        roughness=0.0,
        is_consecutive=True,
        is_ambiguous=False,
        appearance=np.full((markers, 2), np.nan),
        appearance_difference=np.full(2, np.nan),
    )
    after = NextState(
        np.empty((markers, 2)), np.empty((markers, 2)), np.empty(markers, dtype=np.int64), np.empty(nodes)
    )
    out = Measurements(
        np.empty((markers, 2)), np.empty((markers, 2, 2)), np.empty(markers), np.empty(markers, dtype=bool)
    )
    workspace = WorkspacePool(nodes).get(n)
    assignment = Assignment(dot, np.empty((nodes, 2)), workspace.is_used)
    motion, seen = update_state(dots, assignment, state, arrays, DAMPING, workspace, after, out)

    has_dot = dot[:markers] >= 0
    is_seen = has_dot & ~is_missing
    np.testing.assert_array_equal(out.is_seen, is_seen)
    assert seen == is_seen.sum()
    for measured, given in zip(out[:3], dots[:3], strict=True):
        np.testing.assert_array_equal(measured[is_seen], given[dot[:markers][is_seen]])
        assert np.isnan(measured[~is_seen]).all()
    np.testing.assert_array_equal(after.frames_unseen, np.where(is_seen, 0, state.frames_unseen + 1))
    np.testing.assert_allclose(after.position_px[has_dot], centre[dot[:markers][has_dot]])
    assert np.isfinite(after.position_px).all()
    moved = after.position_px - state.position_px
    goes_on = is_seen & (state.frames_unseen == 0)
    expected = after.position_px + DAMPING * np.where(goes_on[:, None], moved, 0.0)
    expected[is_missing] = np.nan
    np.testing.assert_allclose(after.expected_px, expected)
    speed = np.linalg.norm(moved[is_seen], axis=1) / arrays.spacing_px[:markers][is_seen]
    assert (speed < motion).mean() >= UPDATE.motion_share
    assert (speed < motion - 1.0 / UPDATE.bins_per_spacing).mean() < UPDATE.motion_share

    position = arrays.rest_px + assignment.displacement_px
    low, high = arrays.bounds_px[:2], arrays.bounds_px[2:]
    in_view = known | ((position > low) & (position < high)).all(axis=1)
    is_marker = arrays.kind == PRESENT
    least = np.where(is_marker, UPDATE.least_presence, UPDATE.least_exterior_presence)
    most = np.where(is_marker, UPDATE.most_presence, UPDATE.most_exterior_presence)
    presence = state.presence + UPDATE.presence_rate * (known - state.presence)
    np.testing.assert_allclose(after.presence, np.where(in_view, presence.clip(least, most), state.presence))
