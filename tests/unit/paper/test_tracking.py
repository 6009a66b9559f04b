"""The paper's tracking: sorted IDs, the gate, and their limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layouts import lattice_layout
from manytouch.errors import SensorError
from manytouch.geometry.camera import project
from manytouch.paper.tracking import PaperTracking, sorted_by_rows
from manytouch.values import Camera, Detections, Sensor, Status

ROWS, COLUMNS, PITCH_MM = 5, 7, np.array([4.0, 5.0])


def sensor(rotation=(0.0, 0.0, 0.0), missing=()):
    return Sensor(
        name="test sheet",
        camera=Camera(
            width_px=420,
            height_px=300,
            fx_px=900.0,
            fy_px=900.0,
            cx_px=210.0,
            cy_px=150.0,
            distortion=np.array([-0.1, 0.02, 0.0, 0.0, 0.0]),
            rotation_vector=np.array(rotation),
            translation_mm=np.array([0.0, 0.0, 100.0]),
        ),
        layout=lattice_layout(ROWS, COLUMNS, PITCH_MM, missing=missing),
    )


def detections(centre_px, status=Status.OK):
    count = len(centre_px)
    return Detections(
        centre_px=np.array(centre_px, dtype=np.float64).reshape(-1, 2),
        covariance_px2=np.tile(0.01 * np.eye(2), (count, 1, 1)),
        area_px2=np.full(count, 100.0),
        contrast=np.full(count, 99.0),
        status=status,
    )


def tracked(of, frames, tracking=None):
    tracking = tracking or PaperTracking()
    state, grids = tracking.start(of), []
    for centre_px in frames:
        state, grid = tracking.step(state, detections(centre_px))
        grids.append(grid)
    return state, grids


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(-3.1, 3.1), tilt=st.floats(-0.3, 0.3))
def test_first_ids_do_not_depend_on_the_order_nor_on_how_the_camera_is_turned(seed, turn, tilt):
    # rotation about the optical axis, then about x
    of = sensor(rotation=(0.0, 0.0, turn) if seed % 2 else (tilt, 0.0, 0.0), missing=(3, 17))
    random = np.random.default_rng(seed)
    rest_px = project(of.camera, of.layout.rest_mm)
    present = np.flatnonzero(~of.layout.is_missing)
    shown_px = rest_px[present] + random.uniform(-3.0, 3.0, (len(present), 2))
    _, (grid,) = tracked(of, [shown_px[random.permutation(len(present))]])
    assert grid.status == "ok"
    np.testing.assert_array_equal(grid.is_seen, ~of.layout.is_missing)
    np.testing.assert_array_equal(grid.position_px[present], shown_px)
    assert np.isnan(grid.position_px[[3, 17]]).all()
    assert np.isnan(grid.covariance_px2[[3, 17]]).all()


def test_nothing_is_numbered_until_all_markers_are_there():
    of = sensor()
    rest_px = project(of.camera, of.layout.rest_mm)
    state, grids = tracked(of, [rest_px[1:], np.vstack([rest_px, [5.0, 5.0]]), rest_px, rest_px[1:]])
    assert [grid.status for grid in grids] == ["few_markers", "many_markers", "ok", "few_markers"]
    assert [int(grid.is_seen.sum()) for grid in grids] == [0, 0, ROWS * COLUMNS, ROWS * COLUMNS - 1]
    assert not grids[3].is_seen[0]
    assert [int(grid.frames_unseen[0]) for grid in grids] == [1, 2, 0, 1]
    assert state.new_ids == 0


def test_a_jump_beyond_the_gate_gives_a_new_id_and_the_old_one_is_not_seen_again():
    of = sensor()
    rest_px = project(of.camera, of.layout.rest_mm)
    near_px, far_px = rest_px.copy(), rest_px.copy()
    near_px[10] += [9.0, 0.0]
    far_px[10] += [9.0, 12.0]
    tracking = PaperTracking(gate_px=10.0)
    state, grids = tracked(of, [rest_px, near_px, far_px, far_px], tracking)
    assert [bool(grid.is_seen[10]) for grid in grids] == [True, True, False, False]
    assert all(np.delete(grid.is_seen, 10).all() for grid in grids)
    assert state.new_ids == 1
    np.testing.assert_array_equal(np.sort(state.id), [*range(ROWS * COLUMNS + 1)])


def test_a_marker_that_comes_back_where_it_was_last_seen_has_its_id():
    of = sensor()
    rest_px = project(of.camera, of.layout.rest_mm)
    state, grids = tracked(of, [rest_px, np.delete(rest_px, 12, axis=0), rest_px + 2.0])
    assert [int(grid.frames_unseen[12]) for grid in grids] == [0, 1, 0]
    np.testing.assert_array_equal(grids[-1].position_px, rest_px + 2.0)
    assert state.new_ids == 0


def test_a_dot_from_outside_gets_a_new_id_that_is_forgotten_when_it_leaves():
    of = sensor()
    rest_px = project(of.camera, of.layout.rest_mm)
    guest_px = np.vstack([rest_px, [400.0, 10.0]])
    state, grids = tracked(of, [rest_px, guest_px, guest_px, rest_px])
    assert all(grid.is_seen.all() for grid in grids)
    assert state.new_ids == 1
    assert len(state.id) == ROWS * COLUMNS


def test_two_dots_in_one_gate_only_the_nearer_keeps_the_id():
    of = sensor()
    rest_px = project(of.camera, of.layout.rest_mm)
    twin_px = np.vstack([rest_px[20] + [4.0, 0.0], rest_px])
    state, grids = tracked(of, [rest_px, twin_px])
    np.testing.assert_array_equal(grids[-1].position_px, rest_px)
    assert state.new_ids == 1


def test_slow_motion_is_followed_over_several_pitches_and_fast_motion_swaps_neighbours():
    of = sensor()
    rest_px = project(of.camera, of.layout.rest_mm)
    steps = np.arange(0.0, 60.0, 5.0)[:, None, None]
    _, grids = tracked(of, list(rest_px + steps * np.array([1.0, 0.2])))
    np.testing.assert_array_equal(grids[-1].position_px, rest_px + steps[-1] * np.array([1.0, 0.2]))
    pitch_px = np.array([36.0, 0.0])
    _, grids = tracked(of, [rest_px, rest_px + pitch_px])
    assert np.linalg.norm(grids[-1].position_px[0] - rest_px[0]) > 30 or not grids[-1].is_seen[0]
    assert np.linalg.norm(grids[-1].position_px[1] - rest_px[1]) < 5  # its neighbour: the paper's weakness


def test_a_frame_without_dots_loses_nothing():
    of = sensor()
    rest_px = project(of.camera, of.layout.rest_mm)
    tracking = PaperTracking()
    state, _ = tracked(of, [rest_px], tracking)
    state, grid = tracking.step(state, detections(np.zeros((0, 2)), status=Status.DECODE_ERROR))
    assert grid.status == "decode_error"
    assert not grid.is_seen.any()
    state, grid = tracking.step(state, detections(rest_px))
    assert grid.is_seen.all()
    assert tracking.expected_px(state) is None
    assert not tracking.needs_full_search(state)


def test_rows_are_parted_by_gaps_and_sorted_by_x():
    point = np.array([[3.0, 0.2], [1.0, 0.0], [2.0, 0.4], [2.5, 5.1], [0.5, 5.0]])
    np.testing.assert_array_equal(sorted_by_rows(point, 1.0), [1, 2, 0, 4, 3])
    assert len(sorted_by_rows(np.zeros((0, 2)), 1.0)) == 0


def test_a_sensor_without_markers_is_refused():
    with pytest.raises(SensorError, match="has no \\[markers\\]"):
        PaperTracking().start(Sensor(name="bare", camera=sensor().camera))


def test_lost_and_new_ids_are_counted_in_the_frame_in_which_they_happen():
    of = sensor(missing=(3,))
    rest_px = project(of.camera, of.layout.rest_mm)[np.arange(ROWS * COLUMNS) != 3]
    jumped = rest_px.copy()
    jumped[7] += [19.0, 0.0]  # half a pitch
    frames = [rest_px[:-1], rest_px, rest_px, jumped, jumped, np.delete(jumped, [0, 1], axis=0), rest_px]
    _, grids = tracked(of, frames)
    assert [grid.lost_ids for grid in grids] == [0, 0, 0, 1, 0, 2, 0]
    assert [grid.new_ids for grid in grids] == [0, 0, 0, 1, 0, 0, 0]
