"""Shifts of all identities by whole pitches: outline and print resolve them, else the frame is ambiguous."""

import numpy as np
import pytest

from flat_sensor import detections_of, flat_sensor, rectangle_px
from manytouch.tracking import MarkerTracker

WIDTH, HEIGHT, PITCH, RADIUS = 800, 600, 40.0, 8.0


def sensor_of(rest_px):
    return flat_sensor(rest_px, width_px=WIDTH, height_px=HEIGHT, pitch_px=PITCH, radius_px=RADIUS)


def lattice(rows, columns, jitter=0.0):
    place = rectangle_px(rows, columns, (1.0, 1.0), (-(columns - 1) / 2, -(rows - 1) / 2))
    rng = np.random.default_rng(5)
    return PITCH * (place + jitter * rng.standard_normal(place.shape)) + np.array([WIDTH, HEIGHT]) / 2


def shown(true_px, rng, *, hidden=(), extra_px=(), contrast=None, area=None):
    """Detections of whole dots in the image, and which markers they come from."""
    inside = ((true_px > RADIUS) & (true_px < np.array([WIDTH, HEIGHT]) - RADIUS)).all(axis=1)
    inside[list(hidden)] = False
    dots = np.concatenate([true_px[inside], np.reshape(extra_px, (-1, 2))])
    order = rng.permutation(len(dots))
    dots = (dots + rng.normal(0.0, 0.02, dots.shape))[order]
    appearance = np.ones((len(dots), 2))
    for quantity, each in enumerate((area, contrast)):
        if each is not None:
            appearance[: inside.sum(), quantity] = each[inside]
    appearance = (appearance * rng.uniform(0.98, 1.02, appearance.shape))[order]
    return detections_of(dots, area_px2=200.0 * appearance[:, 0], contrast=60.0 * appearance[:, 1]), inside


def wrong(grid, true_px):
    away = np.linalg.norm(grid.position_px - true_px, axis=1)
    return int((grid.is_seen & ~(away < 0.1 * PITCH)).sum())


@pytest.mark.parametrize("shift", [0.4, 0.6, 1.0, 1.4])
@pytest.mark.parametrize("angle", [0.0, np.pi / 2, 0.6])
def test_the_outline_resolves_a_motion_of_the_view(shift, angle):
    rest, rng = lattice(10, 14), np.random.default_rng(0)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    away = shift * PITCH * np.array([np.cos(angle), np.sin(angle)])
    for k in range(8):
        true = rest + away * (k // 2 % 2)
        state, grid = tracker.step(state, shown(true, rng)[0])
        assert grid.is_seen.all()
        assert wrong(grid, true) == 0
        assert grid.status == "ok"


@pytest.mark.parametrize("shift", [0.6, 1.0])
def test_an_uneven_print_resolves_it_where_the_outline_is_out_of_view(shift):
    rest, rng = lattice(19, 25, jitter=0.02), np.random.default_rng(1)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    for k in range(8):
        true = rest + shift * PITCH * np.array([1.0, 0.0]) * (k // 2 % 2)
        found, inside = shown(true, rng)
        state, grid = tracker.step(state, found)
        assert wrong(grid, true) == 0
        assert (grid.is_seen & inside).sum() > 0.9 * inside.sum()


def test_a_jump_of_an_even_pattern_that_fills_the_view_is_ambiguous():
    rest, rng = lattice(19, 25), np.random.default_rng(2)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    for k in range(4):
        state, grid = tracker.step(state, shown(rest + 0.05 * PITCH * k, rng)[0])
        assert grid.is_seen.any()
    state, grid = tracker.step(state, shown(rest + PITCH * np.array([0.65, 0.0]), rng)[0])
    assert grid.status == "ambiguous_shift"
    assert not grid.is_seen.any()
    state, grid = tracker.step(state, shown(rest, rng)[0])
    assert grid.is_seen.any()
    assert wrong(grid, rest) == 0


def distorted(rest_px, curvature=0.02):
    """A lattice with radial distortion."""
    away = (rest_px - [WIDTH / 2, HEIGHT / 2]) / WIDTH
    return rest_px - curvature * (rest_px - [WIDTH / 2, HEIGHT / 2]) * (away**2).sum(axis=1, keepdims=True)


@pytest.mark.parametrize("quantity", ["area", "contrast"])
@pytest.mark.parametrize("steps", [(1.0, 0.0), (0.0, -1.0), (0.6, 0.0)])
def test_appearance_resolves_a_jump_of_an_even_pattern_that_fills_the_view(quantity, steps):
    rest, rng = lattice(19, 25), np.random.default_rng(7)
    appearance = {quantity: 1.0 + 0.04 * rng.standard_normal(len(rest))}
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    for k in range(6):
        state, grid = tracker.step(state, shown(rest + 0.01 * k, rng, **appearance)[0])
        assert grid.status == "ok"
    for away in (PITCH * np.array(steps), np.zeros(2)):
        for _ in range(2):
            dots, inside = shown(rest + away, rng, **appearance)
            state, grid = tracker.step(state, dots)
            assert grid.status == "ok"
            assert wrong(grid, rest + away) == 0
            assert (grid.is_seen & inside).sum() > 0.9 * inside.sum()


def test_identical_dots_that_jump_by_a_pitch_stay_ambiguous():
    rest, rng = distorted(lattice(19, 25)), np.random.default_rng(8)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    for _ in range(4):
        state, grid = tracker.step(state, shown(rest, rng)[0])
        assert grid.status == "ok"
    for _ in range(6):
        state, grid = tracker.step(state, shown(rest + np.array([PITCH, 0.0]), rng)[0])
        assert grid.status == "ambiguous_shift"


def test_slow_motion_of_identical_dots_is_not_ambiguous():
    rest, rng = distorted(lattice(19, 25)), np.random.default_rng(9)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    bell = np.exp(-0.5 * ((rest - rest.mean(axis=0)) ** 2).sum(axis=1, keepdims=True) / (3 * PITCH) ** 2)
    for k in range(20):
        true = rest + 0.2 * PITCH * np.sin(0.5 * k) * bell + 0.1 * PITCH * np.sin(0.3 * k)
        state, grid = tracker.step(state, shown(true, rng)[0])
        assert grid.status == "ok"
        assert wrong(grid, true) == 0


@pytest.mark.parametrize(("rows", "status"), [(19, "ambiguous_shift"), (9, "ok")])
def test_after_a_blackout_identities_are_ambiguous_unless_the_outline_is_in_view(rows, status):
    rest, rng = lattice(rows, 25 if rows > 10 else 13), np.random.default_rng(10)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    for _ in range(3):
        state, _ = tracker.step(state, shown(rest, rng)[0])
    for _ in range(5):
        state, _ = tracker.step(state, shown(rest, rng, hidden=range(len(rest)))[0])
    for _ in range(4):
        state, grid = tracker.step(state, shown(rest, rng)[0])
        assert grid.status == status
        assert grid.is_seen.sum() > 0.55 * len(rest)


def test_after_a_blackout_appearance_resolves_identities_where_the_outline_is_out_of_view():
    rest, rng = lattice(19, 25), np.random.default_rng(11)
    contrast = 1.0 + 0.08 * rng.standard_normal(len(rest))
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    for _ in range(5):
        state, _ = tracker.step(state, shown(rest, rng, contrast=contrast)[0])
    for _ in range(5):
        state, _ = tracker.step(state, shown(rest, rng, hidden=range(len(rest)))[0])
    for away in (np.array([PITCH, 0.0]), np.zeros(2)):
        state, grid = tracker.step(state, shown(rest + away, rng, contrast=contrast)[0])
        assert grid.status == "ok"
        assert wrong(grid, rest + away) == 0
        assert grid.is_seen.sum() > 0.55 * len(rest)


def test_a_spot_next_to_a_hidden_marker_is_not_that_marker():
    rest, rng = lattice(10, 14), np.random.default_rng(3)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    for k in range(12):
        marker = 30 + 7 * k
        spot = rest[marker] + 0.3 * PITCH * np.array([np.cos(k), np.sin(k)])
        state, grid = tracker.step(state, shown(rest, rng, hidden=[marker], extra_px=[spot])[0])
        assert wrong(grid, rest) == 0
        assert not grid.is_seen[marker]
        assert grid.is_seen.sum() == len(rest) - 1


def test_hiding_another_half_of_the_dots_in_each_frame_shifts_no_identity():
    rest, rng = lattice(8, 10), np.random.default_rng(4)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    state, _ = tracker.step(state, shown(rest, rng)[0])
    seen = 0
    for k in range(60):
        true = rest + 0.1 * PITCH * np.sin(0.3 * k)
        hidden = np.flatnonzero(rng.random(len(rest)) < 0.5)
        state, grid = tracker.step(state, shown(true, rng, hidden=hidden)[0])
        assert wrong(grid, true) == 0
        seen += int(grid.is_seen.sum())
    assert seen > 0.35 * 60 * len(rest)  # half are shown; where a shift cannot be excluded, none is seen


def test_a_part_that_moved_by_two_pitches_is_not_mistaken_for_the_next_row():
    rest, rng = lattice(14, 19), np.random.default_rng(6)
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    bell = np.exp(-0.5 * ((rest - rest.mean(axis=0)) ** 2).sum(axis=1, keepdims=True) / (4 * PITCH) ** 2)
    for k in range(8):
        true = rest + 2.0 * PITCH * (k % 2) * bell * np.array([1.0, 0.2])
        state, grid = tracker.step(state, shown(true, rng)[0])
        assert wrong(grid, true) == 0
        assert grid.is_seen.sum() > 0.97 * len(rest)


def test_clutter_near_hidden_markers_affects_no_other_marker():
    rest, rng = lattice(10, 14), np.random.default_rng(7)
    tracker = MarkerTracker()
    hidden = np.flatnonzero((np.abs(rest - rest[75]) < 1.5 * PITCH).all(axis=1))
    spots = rest[hidden] + 0.45 * PITCH
    _, grid = tracker.step(tracker.start(sensor_of(rest)), shown(rest, rng, hidden=hidden, extra_px=spots)[0])
    assert wrong(grid, rest) == 0
    assert grid.is_seen.sum() == len(rest) - len(hidden)
