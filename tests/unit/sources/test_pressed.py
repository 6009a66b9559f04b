"""The simulated sensor under people's fingers."""

from itertools import islice

import numpy as np
import pytest

from manytouch.simulation.hands import MOST_FINGERS
from manytouch.sources.pressed import PressedSource, pressed_source
from manytouch.values import Contact, Press, Release

EASED = 12  # frames until a finger is where it is wanted


@pytest.fixture
def source() -> PressedSource:
    return pressed_source("rest")


def touching(source: PressedSource, frames: int) -> tuple[Contact, ...]:
    """The true contacts after some frames more."""
    last = list(islice(source, frames))[-1]
    truth = source.truth(last.index)
    assert truth is not None
    return truth.contacts.touching


def test_a_finger_comes_moves_and_leaves(source: PressedSource) -> None:
    assert touching(source, 2) == ()
    source.press(Press(finger=1, x_mm=-20.0, y_mm=10.0, depth_mm=2.0))
    (contact,) = touching(source, EASED)
    np.testing.assert_allclose(contact.centre_mm, [-20.0, 10.0], atol=0.01)
    assert contact.depth_mm == pytest.approx(2.0, rel=0.01)
    source.press(Press(finger=1, x_mm=15.0, y_mm=-5.0, depth_mm=3.0))
    (moved,) = touching(source, EASED)
    assert moved.id == contact.id
    np.testing.assert_allclose(moved.centre_mm, [15.0, -5.0], atol=0.05)
    assert moved.depth_mm == pytest.approx(3.0, rel=0.02)
    source.press(Release(finger=1))
    assert touching(source, EASED) == ()
    source.press(Press(finger=1, x_mm=0.0, y_mm=0.0, depth_mm=1.0))
    assert touching(source, EASED)[0].id > contact.id


def test_fingers_stay_on_the_sheet_and_do_not_tear_it(source: PressedSource) -> None:
    source.press(Press(finger=1, x_mm=500.0, y_mm=-500.0, depth_mm=100.0))
    (contact,) = touching(source, EASED)
    assert np.all(np.abs(contact.centre_mm) < [60.0, 40.0])
    assert -contact.force_N[2] <= 20.0
    source.press(Release(finger=7))


def test_fingers_are_not_without_number(source: PressedSource) -> None:
    for finger in range(MOST_FINGERS + 5):
        source.press(Press(finger=finger, x_mm=float(finger), y_mm=0.0, depth_mm=0.5))
    assert len(touching(source, EASED)) == MOST_FINGERS


def test_the_scene_keeps_away_while_somebody_presses() -> None:
    source = pressed_source("fingers")
    assert len(touching(source, round(3.0 * source.fps))) == 2
    source.press(Press(finger=1, x_mm=40.0, y_mm=20.0, depth_mm=2.0))
    (contact,) = touching(source, EASED + 5)
    np.testing.assert_allclose(contact.centre_mm, [40.0, 20.0], atol=0.05)


def test_the_scene_comes_again_and_again() -> None:
    source = pressed_source("one")
    first = touching(source, round(3.0 * source.fps))
    again = touching(source, round(6.0 * source.fps))
    assert len(first) == len(again) == 1
    assert again[0].id > first[0].id
    np.testing.assert_array_equal(again[0].centre_mm, first[0].centre_mm)


def test_truth_goes_with_the_picture_and_is_forgotten(source: PressedSource) -> None:
    frame = next(iter(source))
    truth = source.truth(frame.index)
    assert truth is not None
    assert truth.frame_index == frame.index
    assert source.truth(frame.index + 1) is None


def test_it_ends_when_it_shall() -> None:
    source = pressed_source("rest", seconds=0.5)
    assert [frame.index for frame in source] == list(range(15))
    assert source.frame_count == 15
    assert pressed_source().frame_count is None
