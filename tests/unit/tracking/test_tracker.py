"""Identities of markers in point sequences: none is wrong, and few visible markers are lost."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from flat_sensor import detections_of, flat_sensor, rectangle_px
from manytouch.errors import SensorError
from manytouch.tracking import MarkerTracker
from manytouch.values import Detections, Roi, Sensor, Status

WIDTH, HEIGHT, PITCH = 900, 640, 50.0


def sensor_of(rest_px, row_column=None, is_missing=None):
    return flat_sensor(
        rest_px,
        width_px=WIDTH,
        height_px=HEIGHT,
        pitch_px=PITCH,
        radius_px=10.0,
        row_column=row_column,
        is_missing=is_missing,
        polarity="dark",
    )


def dots_of(centre_px):
    return detections_of(centre_px, std_px=0.1, area_px2=300.0)


def rectangle(rows=10, columns=15, pitch=(PITCH, PITCH)):
    return rectangle_px(rows, columns, pitch, (80.0, 70.0))


def press(rest_px, centre_px, depth_px, width_px, *, shear=0.3):
    """Dots move away from a press, and a little to the side."""
    away = rest_px - centre_px
    bell = np.exp(-0.5 * (away**2).sum(axis=1, keepdims=True) / width_px**2)
    return depth_px * bell * (1.65 * away / width_px + np.array([shear, -0.5 * shear]))


@dataclass
class TrackedSequence:
    """Tracks a sequence and counts the markers that are seen at a wrong dot, and those that are lost."""

    rest_px: np.ndarray
    sensor: Sensor
    seed: int = 0

    def __post_init__(self):
        self.tracker = MarkerTracker()
        self.state = self.tracker.start(self.sensor)
        self.rng = np.random.default_rng(self.seed)
        self.wrong = self.lost = self.visible = 0
        self.grid = None

    def show(self, true_px, is_visible=None, extra_px=()):
        shown = np.ones(len(true_px), dtype=bool) if is_visible is None else is_visible
        shown = shown & (true_px > 0).all(axis=1) & (true_px < [WIDTH, HEIGHT]).all(axis=1)
        dots = np.concatenate([true_px[shown], np.reshape(extra_px, (-1, 2))])
        dots = self.rng.permutation(dots + self.rng.normal(0.0, 0.05, dots.shape))
        self.state, self.grid = self.tracker.step(self.state, dots_of(dots))
        error = np.linalg.norm(self.grid.position_px - true_px, axis=1)
        right = shown & (error < 0.5)
        self.wrong += int((self.grid.is_seen & ~right).sum())
        self.lost += int((shown & ~self.grid.is_seen).sum())
        self.visible += int(shown.sum())
        return self.grid


def sequence_of(rest_px, **layout):
    return TrackedSequence(rest_px, sensor_of(rest_px, **layout))


def test_markers_at_rest_are_all_seen():
    rest = rectangle()
    sequence = sequence_of(rest)
    grid = sequence.show(rest)
    assert grid.status == "ok"
    assert grid.is_seen.all()
    assert (sequence.wrong, sequence.lost) == (0, 0)
    assert_array_equal(grid.frames_unseen, 0)


@pytest.mark.parametrize("gap", [1.0, 2.0, 2.2])
def test_markers_beyond_a_gap_are_seen_in_the_first_frame_and_after_a_blackout(gap):
    """Spokes of a ring, or two fields of dots, have neighbours, but no adjacent ones, beyond a gap."""
    left = rectangle(8, 6)
    rest = np.concatenate([left, left + np.array([(5.0 + gap) * PITCH, 0.0])])
    sequence = sequence_of(rest)
    assert sequence.show(rest).is_seen.all()
    sequence.show(rest, np.zeros(len(rest), dtype=bool))
    grid = sequence.show(rest + press(rest, rest.mean(axis=0), 0.1 * PITCH, 4.0 * PITCH))
    assert grid.is_seen.all()
    assert sequence.wrong == 0


@pytest.mark.parametrize("step", [0.0, 0.25, 0.5])
def test_hiding_another_half_of_the_dots_in_each_frame_loses_few_visible_ones(step):
    rest = rectangle(22, 30, (25.0, 25.0))
    sequence = sequence_of(rest)
    sequence.show(rest)
    field = press(rest, np.array([440.0, 330.0]), 25.0, 90.0)
    longest = np.linalg.norm(field, axis=1).max()
    for k in range(24):
        share = step * 25.0 / longest * (1, 2, 1, 0)[k % 4]
        sequence.show(rest + share * field, sequence.rng.random(len(rest)) < 0.5)
    assert sequence.wrong == 0
    assert sequence.lost < 0.012 * sequence.visible


@pytest.mark.parametrize("step", [0.25, 0.5, 0.8, 1.2])
def test_presses_of_any_speed_swap_no_identities(step):
    rest = rectangle()
    sequence = sequence_of(rest)
    sequence.show(rest)
    now = np.zeros_like(rest)
    for press_number in range(8):
        middle = rest[sequence.rng.integers(len(rest))]
        target = press(rest, middle, 0.8 * PITCH, 2.8 * PITCH) if press_number % 2 == 0 else 0.0 * rest
        steps = int(np.ceil(np.linalg.norm(target - now, axis=1).max() / (step * PITCH)))
        for k in range(steps):
            sequence.show(rest + now + (target - now) * (k + 1) / steps)
        now = target
    assert sequence.wrong == 0
    assert sequence.lost <= 0.005 * sequence.visible


@pytest.mark.parametrize("shift", [0.1, 0.3, 0.6, 1.0])
def test_translation_of_the_whole_view_changes_no_identity(shift):
    rest = rectangle()
    sequence = sequence_of(rest)
    sequence.show(rest)
    for k in range(8):
        angle = 0.7 * k
        sequence.show(rest + shift * PITCH * np.array([np.cos(angle), np.sin(angle)]))
        sequence.show(rest)
    assert sequence.wrong == 0
    assert sequence.lost <= 0.02 * sequence.visible


def test_missing_and_false_dots_change_no_other_identity():
    rest = rectangle()
    sequence = sequence_of(rest)
    far_wrong = 0
    for k in range(40):
        target = press(rest, rest[(37 * (k // 4)) % len(rest)], 0.2 * (k % 4) * PITCH, 2.5 * PITCH)
        false = sequence.rng.uniform(rest.min(axis=0), rest.max(axis=0), (3, 2))
        grid = sequence.show(rest + target, sequence.rng.random(len(rest)) > 0.02, false)
        error = np.linalg.norm(grid.position_px - rest - target, axis=1)
        far_wrong += int((error > 0.3 * PITCH).sum())
    # A false dot at the position of a hidden marker cannot be distinguished from it; no other is accepted.
    assert sequence.wrong <= 0.001 * sequence.visible
    assert far_wrong == 0
    assert sequence.lost <= 0.005 * sequence.visible


def test_markers_of_a_hidden_half_are_found_again():
    rest = rectangle()
    sequence = sequence_of(rest)
    sequence.show(rest)
    left = rest[:, 0] < np.median(rest[:, 0])
    for k in range(6):
        grid = sequence.show(
            rest + press(rest, rest[130], 0.15 * k * PITCH, 2.5 * PITCH), left if k % 2 else ~left
        )
        assert grid.is_seen.sum() > 0.4 * len(rest)
    assert sequence.show(rest).is_seen.all()
    assert sequence.wrong == 0


def test_first_frame_after_a_blackout_is_identified():
    rest = rectangle()
    sequence = sequence_of(rest)
    sequence.show(rest + press(rest, rest[70], 0.5 * PITCH, 2.5 * PITCH))
    for k in range(30):
        grid = sequence.show(rest, np.zeros(len(rest), dtype=bool))
        assert grid.status == "few_markers"
        assert grid.frames_unseen.min() == k + 1
        assert sequence.tracker.expected_px(sequence.state) is None
    sequence.show(rest + press(rest, rest[40], 0.6 * PITCH, 2.5 * PITCH))
    assert sequence.wrong == 0
    assert sequence.grid is not None
    assert sequence.grid.is_seen.mean() > 0.98


def test_dots_that_enter_the_view_get_no_marker():
    """Markers fill the view; as the sheet moves, dots from outside come in and border ones leave."""
    whole = rectangle(17, 23)
    whole -= whole[8 * 23 + 11] - [WIDTH / 2, HEIGHT / 2]
    inside = ((whole > 12.0) & (whole < [WIDTH - 12.0, HEIGHT - 12.0])).all(axis=1)
    sequence = sequence_of(whole[inside])
    for k in [*range(12), *range(12, -1, -1)]:
        stretch = 1.0 + 0.03 * k
        moved = (whole - [WIDTH / 2, HEIGHT / 2]) / stretch + [WIDTH / 2, HEIGHT / 2]
        moved += np.array([2.0, -1.5]) * k
        in_view = ((moved > 0) & (moved < [WIDTH, HEIGHT])).all(axis=1)
        sequence.show(moved[inside], extra_px=moved[~inside & in_view])
    assert sequence.wrong == 0
    assert sequence.grid is not None
    assert sequence.grid.is_seen.all()


def test_a_marker_that_left_comes_back_under_its_number():
    rest = rectangle()
    sequence = sequence_of(rest)
    hidden = np.arange(len(rest)) == 52
    for k in range(5):
        grid = sequence.show(rest + 0.1 * k, ~hidden)
        assert not grid.is_seen[52]
        assert grid.frames_unseen[52] == k + 1
        assert np.isnan(grid.position_px[52]).all()
    assert sequence.show(rest).is_seen[52]
    assert sequence.wrong == 0


def test_missing_markers_are_never_seen_nor_expected():
    rest = rectangle()
    is_missing = np.zeros(len(rest), dtype=bool)
    is_missing[[3, 77]] = True
    sequence = sequence_of(rest, is_missing=is_missing)
    sequence.show(rest)
    sequence.show(rest)
    assert sequence.grid is not None
    assert_array_equal(sequence.grid.is_seen, ~is_missing)
    expected = sequence.tracker.expected_px(sequence.state)
    assert expected is not None
    assert_array_equal(np.isnan(expected[:, 0]), is_missing)
    np.testing.assert_allclose(expected[~is_missing], rest[~is_missing], atol=0.5)


def test_windows_are_used_in_slow_motion_only():
    rest = rectangle()
    sequence = sequence_of(rest)
    assert sequence.tracker.expected_px(sequence.state) is None
    sequence.show(rest)
    sequence.show(rest + 2.0)
    assert sequence.tracker.expected_px(sequence.state) is not None
    sequence.show(rest + 0.4 * PITCH)
    assert sequence.tracker.expected_px(sequence.state) is None
    assert sequence.tracker.needs_full_search(sequence.state)


def test_fewer_dots_in_windows_require_a_search_of_the_whole_image():
    rest = rectangle()
    sequence = sequence_of(rest)
    sequence.show(rest)
    sequence.show(rest, np.arange(len(rest)) % 15 != 0)
    assert sequence.tracker.needs_full_search(sequence.state)


def test_the_order_of_detections_changes_nothing():
    rest = rectangle(7, 11, pitch=(62.0, 47.0))
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    dots = rest + press(rest, rest[40], 30.0, 110.0)
    _, first = tracker.step(state, dots_of(dots))
    for seed in range(5):
        order = np.random.default_rng(seed).permutation(len(dots))
        _, again = tracker.step(state, dots_of(dots[order]))
        np.testing.assert_array_equal(again.position_px, first.position_px)


def test_a_state_is_a_value():
    rest = rectangle()
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rest))
    before = state.position_px.copy()
    _, first = tracker.step(state, dots_of(rest + 3.0))
    _, again = tracker.step(state, dots_of(rest + 3.0))
    assert_array_equal(state.position_px, before)
    assert_array_equal(first.position_px, again.position_px)


def test_a_layout_without_rows_is_tracked():
    ring, spoke = np.indices((6, 20))
    radius, angle = 90.0 + 32.0 * ring.ravel(), (spoke.ravel() + 0.5 * ring.ravel()) * 2 * np.pi / 20
    rest = np.column_stack([radius * np.cos(angle) + 450.0, radius * np.sin(angle) + 320.0])
    sequence = sequence_of(rest)
    for k in [*range(6), *range(6, -1, -1)]:
        sequence.show(rest + press(rest, rest[50], 3.0 * k, 80.0))
    assert sequence.wrong == 0
    assert sequence.grid is not None
    assert sequence.grid.is_seen.all()


@pytest.mark.parametrize("share", [0.6, 1.0])
def test_an_irregular_layout_that_jumps_by_a_spacing_keeps_its_identities(share):
    # No two positions have the same surroundings: no shift fits, and none is tried.
    chance = np.random.default_rng(3)
    rest = rectangle() + chance.uniform(-0.3 * PITCH, 0.3 * PITCH, (150, 2))
    sequence = sequence_of(rest)
    assert not sequence.state.graph.can_be_shifted
    for k in range(30):
        angle = 0.4 * k
        away = share * PITCH * np.array([np.cos(angle), np.sin(angle)]) if k % 10 >= 5 else np.zeros(2)
        sequence.show(rest + away)
    assert sequence.wrong == 0
    assert sequence.lost < 0.005 * sequence.visible


def test_a_lattice_without_row_numbers_can_be_shifted():
    sequence = sequence_of(rectangle(), row_column=None)
    assert sequence.state.graph.can_be_shifted


def test_the_status_of_a_bad_image_is_kept():
    tracker = MarkerTracker()
    state = tracker.start(sensor_of(rectangle()))
    empty = np.zeros((0, 2))
    dark = Detections(
        centre_px=empty,
        covariance_px2=np.zeros((0, 2, 2)),
        area_px2=np.zeros(0),
        contrast=np.zeros(0),
        status=Status.DARK,
    )
    state, grid = tracker.step(state, dark)
    assert grid.status == "dark"
    assert not grid.is_seen.any()


def test_a_sensor_without_markers_raises_an_error():
    bare = sensor_of(rectangle())
    bare = Sensor(name="camera only", camera=bare.camera)
    with pytest.raises(SensorError, match="camera only"):
        MarkerTracker().start(bare)


def test_markers_outside_the_region_of_interest_are_not_expected():
    rest_px = rectangle()
    is_inside = (rest_px < [300.0, 300.0]).all(axis=1)
    assert is_inside.mean() < 0.3
    tracker = MarkerTracker(roi_px=Roi(0, 0, 305, 305))
    state, grid = tracker.step(tracker.start(sensor_of(rest_px)), dots_of(rest_px[is_inside]))
    assert grid.status == "ok"
    state, grid = tracker.step(state, dots_of(rest_px[is_inside]))
    assert tracker.expected_px(state) is not None
    assert_array_equal(grid.is_seen, is_inside)
