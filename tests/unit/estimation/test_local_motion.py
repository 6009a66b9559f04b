"""How far neighbouring markers have moved together, and what a soft sheet keeps of a press."""

from unittest import mock

import numpy as np
import pytest
from numba import typeof

from flat_sensor import rectangle_px
from manytouch.estimation.kernels import lengths_without_view
from manytouch.estimation.local_motion import LocalMotion, TouchMemory, largest_of_still, marker_groups

PITCH_PX = 44.0


@pytest.mark.parametrize("count", [5, 9, 35])
def test_local_motion_is_that_of_most_of_a_group(count: int) -> None:
    rest = rectangle_px(5, 7, (PITCH_PX, PITCH_PX), (28.0, 32.0))[:count]
    motion = LocalMotion()
    groups = marker_groups(rest, PITCH_PX)
    assert np.abs(motion(groups, np.full((count, 2), 3.0), np.ones(count, dtype=bool))).max() < 1e-3
    one = np.zeros((count, 2))
    one[0] = 10.0
    assert np.abs(motion(groups, one, np.ones(count, dtype=bool))).max() < 0.02
    assert motion(groups, one, np.arange(count) == 1).max() == 0.0


def test_a_lower_motion_after_a_press_lowers_what_may_be_left_of_it() -> None:
    motion = LocalMotion()
    memory = motion.remember(TouchMemory(), 0.3, elapsed_s=0.1)
    assert motion.limits(memory, 0.0) == (motion.floor_pitch, pytest.approx(0.2 * 0.3))
    memory = motion.remember(memory, 0.01, elapsed_s=0.1)
    assert motion.limits(memory, 0.0) == (motion.floor_pitch, pytest.approx(2.0 * 0.01))
    memory = motion.remember(memory, 0.2, elapsed_s=0.1)
    assert motion.limits(memory, 0.0)[1] == pytest.approx(0.2 * 0.3)
    assert motion.limits(memory, 0.01) == (pytest.approx(0.03), pytest.approx(0.06))


def test_what_a_pad_keeps_is_a_share_of_a_recent_press() -> None:
    motion = LocalMotion()
    memory = motion.remember(TouchMemory(), 0.3, elapsed_s=0.1)
    assert motion.is_surely_kept(0.0599 * 0.3, memory)
    assert not motion.is_surely_kept(0.0601 * 0.3, memory)
    for _ in range(round(10.0 * motion.fade_s * np.log(2.0))):  # half of the press is left
        memory = motion.remember(memory, 0.01, elapsed_s=0.1)
    assert motion.is_surely_kept(0.0298 * 0.3, memory)
    assert not motion.is_surely_kept(0.0302 * 0.3, memory)


def test_a_touch_lasts_above_what_untouched_sheets_show_and_what_is_left_of_a_press() -> None:
    motion = LocalMotion()
    assert motion.limits(TouchMemory(), 0.0, was_touched=True) == (motion.rest_pitch, motion.rest_pitch)
    memory = TouchMemory(strongest=0.3, lowest=0.01)
    assert motion.limits(memory, 0.0, was_touched=True) == (motion.rest_pitch, pytest.approx(0.02))
    assert motion.limits(memory, 0.01, was_touched=True)[0] == pytest.approx(0.03)


def test_the_same_function_is_compiled_for_a_mask_that_is_read_only_and_for_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    called = mock.Mock(side_effect=lengths_without_view)
    monkeypatch.setattr("manytouch.estimation.local_motion.lengths_without_view", called)
    place = rectangle_px(5, 6)
    groups = marker_groups(place, 1.0)
    seen, fixed = np.ones(len(place), dtype=np.bool_), np.ones(len(place), dtype=np.bool_)
    fixed.flags.writeable = False
    moved = np.random.default_rng(1).normal(size=place.shape)
    for mask in (seen, fixed):
        LocalMotion(refinements=4)(groups, moved, mask)
    of_variable, of_fixed = [[typeof(value) for value in call.args] for call in called.call_args_list]
    assert of_variable == of_fixed
    assert seen.flags.writeable


def test_a_still_sheet_moves_by_at_most_twice_its_usual_motion_between_frames() -> None:
    still, press, again = [0.002] * 6, [0.01] * 4, [0.0] * 9
    assert largest_of_still(still) == pytest.approx(0.004)
    assert largest_of_still([*still, *press]) == pytest.approx(0.004)
    assert largest_of_still([*again, *still]) == pytest.approx(0.004)  # frames that were recorded twice
    assert largest_of_still([1e-6] * 8) == pytest.approx(0.0005)
    assert largest_of_still(again) == float("inf")


def test_a_touch_lasts_a_little_below_the_limit_above_which_one_begins() -> None:
    motion = LocalMotion()
    memory, limit = TouchMemory(strongest=0.1, lowest=0.1), 0.02
    assert motion.limits(memory, 0.0)[1] == pytest.approx(limit)
    for lasts, share in ((False, 1.0), (True, motion.lasting_share)):
        assert motion.is_touched(1.01 * share * limit, memory, 0.0, lasts=lasts)
        assert not motion.is_touched(0.99 * share * limit, memory, 0.0, lasts=lasts)
