"""Laws of identity that hold for any smooth motion, any dropout and any order of the dots."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from manytouch.tracking import MarkerTracker
from manytouch.values import Detections, Layout, Sensor
from straight import straight_camera

WIDTH, HEIGHT, PITCH = 760, 560, 40.0
ROWS, COLUMNS = 9, 13


def sensor_of(rest_px, width_px=WIDTH, height_px=HEIGHT):
    row, column = np.indices((ROWS, COLUMNS))
    return Sensor(
        name="flat",
        camera=straight_camera(width_px, height_px, focal_px=1e3, distance_mm=1e3, principal_px=(0.0, 0.0)),
        layout=Layout(
            rest_mm=np.column_stack([rest_px, np.zeros(len(rest_px))]),
            row_column=np.column_stack([row.ravel(), column.ravel()]).astype(np.int64),
            pitch_mm=np.array([PITCH, PITCH]),
            radius_mm=np.full(len(rest_px), 8.0),
            polarity="light",
            is_missing=np.zeros(len(rest_px), dtype=bool),
        ),
    )


def rest_of():
    row, column = np.indices((ROWS, COLUMNS))
    return PITCH * np.column_stack([column.ravel(), row.ravel()]) + np.array([140.0, 120.0])


def detections_of(centre_px):
    n = len(centre_px)
    return Detections(
        centre_px=np.array(centre_px),
        covariance_px2=np.tile(1e-4 * np.eye(2), (n, 1, 1)),
        area_px2=np.full(n, 200.0),
        contrast=np.full(n, 60.0),
    )


def frames(seed, step, dropout, number=4):
    """True places, visibility and dots (with false ones) of a few frames."""
    rng = np.random.default_rng(seed)
    rest = rest_of()
    centre = rest.mean(axis=0) + rng.uniform(-0.3, 0.3, 2) * np.ptp(rest, axis=0)
    bell = np.exp(-0.5 * ((rest - centre) ** 2).sum(axis=1, keepdims=True) / (3.5 * PITCH) ** 2)
    angle = rng.uniform(0, 2 * np.pi)
    for k in range(number):
        true = rest + step * PITCH * (k % 2) * bell * np.array([np.cos(angle), np.sin(angle)])
        visible = rng.random(len(rest)) >= dropout
        away = np.inf * np.ones(1)
        false = rng.uniform(rest.min(axis=0), rest.max(axis=0), (3, 2))
        away = np.linalg.norm(false[:, None] - true, axis=2).min(axis=1)
        dots = np.concatenate([true[visible], false[away > 0.3 * PITCH]])
        yield true, visible, dots + rng.normal(0.0, 0.01, dots.shape)


seeds, steps = st.integers(0, 2**32 - 1), st.sampled_from([0.1, 0.5, 1.0, 1.5])


@settings(max_examples=40, deadline=None)
@given(seed=seeds, step=steps, dropout=st.sampled_from([0.0, 0.05, 0.3]))
def test_seen_is_at_its_own_place_and_no_dot_has_two_markers(seed, step, dropout):
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest_of()))
    for true, _, dots in frames(seed, step, dropout):
        state, grid = follow.step(state, detections_of(dots))
        seen = grid.position_px[grid.is_seen]
        assert len(np.unique(seen, axis=0)) == len(seen)
        assert np.isnan(grid.position_px[~grid.is_seen]).all()
        assert (np.linalg.norm(seen - true[grid.is_seen], axis=1) < 0.45 * PITCH).all()


@settings(max_examples=25, deadline=None)
@given(seed=seeds, step=steps)
def test_the_order_of_dots_is_nothing(seed, step):
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest_of()))
    order = np.random.default_rng(seed)
    for _, _, dots in frames(seed, step, 0.05):
        _, other = follow.step(state, detections_of(order.permutation(dots)))
        state, grid = follow.step(state, detections_of(dots))
        np.testing.assert_array_equal(grid.position_px, other.position_px)


@settings(max_examples=25, deadline=None)
@given(seed=seeds, step=steps, x=st.integers(-60, 60), y=st.integers(-60, 60))
def test_a_shifted_camera_tells_the_same(seed, step, x, y):
    follow, move = MarkerTracker(), np.array([x, y], dtype=np.float64)
    wide = {"width_px": WIDTH + 400, "height_px": HEIGHT + 400}
    state = follow.start(sensor_of(rest_of() + 200.0, **wide))
    moved_state = follow.start(sensor_of(rest_of() + 200.0 + move, **wide))
    for _, _, dots in frames(seed, step, 0.05):
        state, grid = follow.step(state, detections_of(dots + 200.0))
        moved_state, moved = follow.step(moved_state, detections_of(dots + 200.0 + move))
        np.testing.assert_array_equal(grid.is_seen, moved.is_seen)
        np.testing.assert_allclose(grid.position_px + move, moved.position_px, atol=1e-9)
