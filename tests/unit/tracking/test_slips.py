"""Whether the numbers slipped: the outline and the print decide, and where they cannot, nobody is seen."""

import numpy as np
import pytest

from manytouch.tracking import MarkerTracker
from manytouch.tracking.lattice_graph import EXTERIOR_HIDDEN, EXTERIOR_VISIBLE, build_lattice_graph
from manytouch.tracking.matching.shift_ambiguity import approximate_median
from manytouch.values import Detections, Layout, Sensor
from straight import straight_camera

WIDTH, HEIGHT, PITCH, RADIUS = 800, 600, 40.0, 8.0


def sensor_of(rest_px):
    return Sensor(
        name="flat",
        camera=straight_camera(WIDTH, HEIGHT, focal_px=1e3, distance_mm=1e3, principal_px=(0.0, 0.0)),
        layout=Layout(
            rest_mm=np.column_stack([rest_px, np.zeros(len(rest_px))]),
            row_column=None,
            pitch_mm=np.array([PITCH, PITCH]),
            radius_mm=np.full(len(rest_px), RADIUS),
            polarity="light",
            is_missing=np.zeros(len(rest_px), dtype=bool),
        ),
    )


def lattice(rows, columns, jitter=0.0):
    row, column = np.indices((rows, columns))
    place = np.column_stack([column.ravel() - (columns - 1) / 2, row.ravel() - (rows - 1) / 2])
    rng = np.random.default_rng(5)
    return PITCH * (place + jitter * rng.standard_normal(place.shape)) + np.array([WIDTH, HEIGHT]) / 2


def shown(true_px, rng, *, hidden=(), extra_px=(), contrast=None, area=None):
    """Detections of whole dots in the image, and which markers they come from."""
    inside = ((true_px > RADIUS) & (true_px < np.array([WIDTH, HEIGHT]) - RADIUS)).all(axis=1)
    inside[list(hidden)] = False
    dots = np.concatenate([true_px[inside], np.reshape(extra_px, (-1, 2))])
    order = rng.permutation(len(dots))
    dots = (dots + rng.normal(0.0, 0.02, dots.shape))[order]
    looks = np.ones((len(dots), 2))
    for sign, each in enumerate((area, contrast)):
        if each is not None:
            looks[: inside.sum(), sign] = each[inside]
    looks = (looks * rng.uniform(0.98, 1.02, looks.shape))[order]
    found = Detections(
        centre_px=dots,
        covariance_px2=np.tile(4e-4 * np.eye(2), (len(dots), 1, 1)),
        area_px2=200.0 * looks[:, 0],
        contrast=60.0 * looks[:, 1],
    )
    return found, inside


def wrong(grid, true_px):
    away = np.linalg.norm(grid.position_px - true_px, axis=1)
    return int((grid.is_seen & ~(away < 0.1 * PITCH)).sum())


@pytest.mark.parametrize("shift", [0.4, 0.6, 1.0, 1.4])
@pytest.mark.parametrize("angle", [0.0, np.pi / 2, 0.6])
def test_the_outline_tells_where_the_view_went(shift, angle):
    rest, rng = lattice(10, 14), np.random.default_rng(0)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    away = shift * PITCH * np.array([np.cos(angle), np.sin(angle)])
    for k in range(8):
        true = rest + away * (k // 2 % 2)
        state, grid = follow.step(state, shown(true, rng)[0])
        assert grid.is_seen.all()
        assert wrong(grid, true) == 0
        assert grid.status == "ok"


@pytest.mark.parametrize("shift", [0.6, 1.0])
def test_uneven_print_tells_where_the_outline_is_out_of_view(shift):
    rest, rng = lattice(19, 25, jitter=0.02), np.random.default_rng(1)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    for k in range(8):
        true = rest + shift * PITCH * np.array([1.0, 0.0]) * (k // 2 % 2)
        found, inside = shown(true, rng)
        state, grid = follow.step(state, found)
        assert wrong(grid, true) == 0
        assert (grid.is_seen & inside).sum() > 0.9 * inside.sum()


def test_an_even_pattern_that_fills_the_view_and_jumped_is_not_told():
    rest, rng = lattice(19, 25), np.random.default_rng(2)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    for k in range(4):
        state, grid = follow.step(state, shown(rest + 0.05 * PITCH * k, rng)[0])
        assert grid.is_seen.any()
    state, grid = follow.step(state, shown(rest + PITCH * np.array([0.65, 0.0]), rng)[0])
    assert grid.status == "ambiguous_shift"
    assert not grid.is_seen.any()
    state, grid = follow.step(state, shown(rest, rng)[0])
    assert grid.is_seen.any()
    assert wrong(grid, rest) == 0


def bulged(rest_px, curvature=0.02):
    """What a lens makes of a lattice."""
    away = (rest_px - [WIDTH / 2, HEIGHT / 2]) / WIDTH
    return rest_px - curvature * (rest_px - [WIDTH / 2, HEIGHT / 2]) * (away**2).sum(axis=1, keepdims=True)


@pytest.mark.parametrize("sign", ["area", "contrast"])
@pytest.mark.parametrize("steps", [(1.0, 0.0), (0.0, -1.0), (0.6, 0.0)])
def test_looks_tell_where_an_even_pattern_that_fills_the_view_jumped(sign, steps):
    rest, rng = lattice(19, 25), np.random.default_rng(7)
    looks = {sign: 1.0 + 0.04 * rng.standard_normal(len(rest))}
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    for k in range(6):
        state, grid = follow.step(state, shown(rest + 0.01 * k, rng, **looks)[0])
        assert grid.status == "ok"
    for away in (PITCH * np.array(steps), np.zeros(2)):
        for _ in range(2):
            dots, inside = shown(rest + away, rng, **looks)
            state, grid = follow.step(state, dots)
            assert grid.status == "ok"
            assert wrong(grid, rest + away) == 0
            assert (grid.is_seen & inside).sum() > 0.9 * inside.sum()


def test_dots_all_alike_that_jump_a_pitch_with_the_view_are_ambiguous_ever_after():
    rest, rng = bulged(lattice(19, 25)), np.random.default_rng(8)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    for _ in range(4):
        state, grid = follow.step(state, shown(rest, rng)[0])
        assert grid.status == "ok"
    for _ in range(6):
        state, grid = follow.step(state, shown(rest + np.array([PITCH, 0.0]), rng)[0])
        assert grid.status == "ambiguous_shift"


def test_slow_motion_of_dots_all_alike_is_not_ambiguous():
    rest, rng = bulged(lattice(19, 25)), np.random.default_rng(9)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    bell = np.exp(-0.5 * ((rest - rest.mean(axis=0)) ** 2).sum(axis=1, keepdims=True) / (3 * PITCH) ** 2)
    for k in range(20):
        true = rest + 0.2 * PITCH * np.sin(0.5 * k) * bell + 0.1 * PITCH * np.sin(0.3 * k)
        state, grid = follow.step(state, shown(true, rng)[0])
        assert grid.status == "ok"
        assert wrong(grid, true) == 0


@pytest.mark.parametrize(("rows", "status"), [(19, "ambiguous_shift"), (9, "ok")])
def test_after_a_blackout_numbers_are_open_until_the_outline_tells_them(rows, status):
    rest, rng = lattice(rows, 25 if rows > 10 else 13), np.random.default_rng(10)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    for _ in range(3):
        state, _ = follow.step(state, shown(rest, rng)[0])
    for _ in range(5):
        state, _ = follow.step(state, shown(rest, rng, hidden=range(len(rest)))[0])
    for _ in range(4):
        state, grid = follow.step(state, shown(rest, rng)[0])
        assert grid.status == status
        assert grid.is_seen.sum() > 0.55 * len(rest)


def test_after_a_blackout_looks_tell_the_numbers_where_the_outline_is_out_of_view():
    rest, rng = lattice(19, 25), np.random.default_rng(11)
    contrast = 1.0 + 0.08 * rng.standard_normal(len(rest))
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    for _ in range(5):
        state, _ = follow.step(state, shown(rest, rng, contrast=contrast)[0])
    for _ in range(5):
        state, _ = follow.step(state, shown(rest, rng, hidden=range(len(rest)))[0])
    for away in (np.array([PITCH, 0.0]), np.zeros(2)):
        state, grid = follow.step(state, shown(rest + away, rng, contrast=contrast)[0])
        assert grid.status == "ok"
        assert wrong(grid, rest + away) == 0
        assert grid.is_seen.sum() > 0.55 * len(rest)


def test_a_spot_beside_a_hidden_marker_is_not_that_marker():
    rest, rng = lattice(10, 14), np.random.default_rng(3)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    for k in range(12):
        marker = 30 + 7 * k
        spot = rest[marker] + 0.3 * PITCH * np.array([np.cos(k), np.sin(k)])
        state, grid = follow.step(state, shown(rest, rng, hidden=[marker], extra_px=[spot])[0])
        assert wrong(grid, rest) == 0
        assert not grid.is_seen[marker]
        assert grid.is_seen.sum() == len(rest) - 1


def test_half_the_dots_hidden_anew_in_each_frame_slip_nowhere():
    rest, rng = lattice(8, 10), np.random.default_rng(4)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    state, _ = follow.step(state, shown(rest, rng)[0])
    seen = 0
    for k in range(60):
        true = rest + 0.1 * PITCH * np.sin(0.3 * k)
        hidden = np.flatnonzero(rng.random(len(rest)) < 0.5)
        state, grid = follow.step(state, shown(true, rng, hidden=hidden)[0])
        assert wrong(grid, true) == 0
        seen += int(grid.is_seen.sum())
    assert seen > 0.35 * 60 * len(rest)  # half show; where they cannot tell a slip, nobody is seen


def test_a_part_that_moved_by_two_pitches_is_not_mistaken_for_the_next_row():
    rest, rng = lattice(14, 19), np.random.default_rng(6)
    follow = MarkerTracker()
    state = follow.start(sensor_of(rest))
    bell = np.exp(-0.5 * ((rest - rest.mean(axis=0)) ** 2).sum(axis=1, keepdims=True) / (4 * PITCH) ** 2)
    for k in range(8):
        true = rest + 2.0 * PITCH * (k % 2) * bell * np.array([1.0, 0.2])
        state, grid = follow.step(state, shown(true, rng)[0])
        assert wrong(grid, true) == 0
        assert grid.is_seen.sum() > 0.97 * len(rest)


def test_ghosts_within_the_image_are_closed_and_beyond_it_open():
    rest = lattice(10, 14)
    missing = np.zeros(len(rest), dtype=bool)
    bounds = (RADIUS, RADIUS, WIDTH - RADIUS, HEIGHT - RADIUS)
    mesh = mesh_of(rest, missing, bounds_px=bounds)
    ghosts = mesh.rest_px[mesh.markers :]
    np.testing.assert_array_equal(mesh.rest_px[: mesh.markers], rest)
    assert len(ghosts) >= 2 * 2 * (10 + 14)  # two rings, corners not counted
    assert (mesh.kind[mesh.markers :] == CLOSED).all()
    tight = (*(rest.min(axis=0) - 1.0), *(rest.max(axis=0) + 1.0))
    assert (mesh_of(rest, missing, bounds_px=tight).kind[mesh.markers :] == OPEN).all()
    for to in mesh.slip[1:]:
        step = (mesh.rest_px[to] - mesh.rest_px)[: mesh.markers][to[: mesh.markers] >= 0]
        np.testing.assert_allclose(step, np.broadcast_to(step[0], step.shape), atol=1e-6)


def test_clutter_beside_hidden_markers_shakes_nobody_else():
    rest, rng = lattice(10, 14), np.random.default_rng(7)
    follow = MarkerTracker()
    hidden = np.flatnonzero((np.abs(rest - rest[75]) < 1.5 * PITCH).all(axis=1))
    spots = rest[hidden] + 0.45 * PITCH
    _, grid = follow.step(follow.start(sensor_of(rest)), shown(rest, rng, hidden=hidden, extra_px=spots)[0])
    assert wrong(grid, rest) == 0
    assert grid.is_seen.sum() == len(rest) - len(hidden)


@pytest.mark.parametrize("number", [1, 2, 7, 500])
def test_the_middle_is_the_median(number: int) -> None:
    chance = np.random.default_rng(number)
    value = (1e-6 * chance.lognormal(0.0, 3.0, number)).astype(np.float32)
    ordered = np.sort(value)
    least, most = ordered[(number - 1) // 2], ordered[number // 2]
    assert least * (1 - 1e-3) <= approximate_median(value) <= most * (1 + 1e-3)


def test_the_middle_of_nothing_but_zeros_is_zero() -> None:
    assert approximate_median(np.zeros(5, np.float32)) == 0.0
    assert approximate_median(np.array([0.0, 0.0, 3.0], np.float32)) == 0.0
