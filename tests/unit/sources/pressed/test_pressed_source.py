"""The simulated sensor, pressed interactively."""

from itertools import islice

import numpy as np
import pytest

from manytouch.simulation.interactive_indenters import ALONE_S, FIRST_ID, MOST_FINGERS
from manytouch.simulation.simulator import Simulator
from manytouch.sources.pressed.pressed_source import PressedSource
from manytouch.sources.simulated import simulated_source
from manytouch.values import Contact, Frame, Press, Release, Truth

EASED = 15  # frames until a finger is where it is wanted
SMALL_PX = 160


@pytest.fixture(autouse=True)
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames without images, which take most of the time."""

    def frame(simulator: Simulator, index: int) -> Frame:
        return Frame(index=index, timestamp_ns=round(index * 1e9 / simulator.fps), camera="sim", image=None)

    monkeypatch.setattr(Simulator, "frame", frame)


@pytest.fixture
def source() -> PressedSource:
    return PressedSource("rest", width_px=SMALL_PX)


def after(source: PressedSource, frames: int) -> Truth:
    """The truth after some frames more."""
    last = list(islice(source, frames))[-1]
    truth = source.truth(last.index)
    assert truth is not None
    return truth


def touching(source: PressedSource, frames: int) -> tuple[Contact, ...]:
    return after(source, frames).contacts.touching


def test_a_finger_comes_moves_and_leaves(source: PressedSource) -> None:
    assert touching(source, 2) == ()
    source.press(Press(finger=1, x_mm=-20.0, y_mm=10.0, depth_mm=2.0))
    (contact,) = touching(source, EASED)
    np.testing.assert_allclose(contact.centre_mm, [-20.0, 10.0], atol=0.1)
    assert 1.6 < contact.depth_mm < 2.0  # the sheet is squeezed under the finger
    source.press(Press(finger=1, x_mm=15.0, y_mm=-5.0, depth_mm=3.0))
    (moved,) = touching(source, EASED + 5)
    assert moved.id == contact.id
    np.testing.assert_allclose(moved.centre_mm, [15.0, -5.0], atol=0.1)
    assert 2.5 < moved.depth_mm < 3.0
    assert -moved.force_N[2] > -1.5 * contact.force_N[2]
    source.press(Release(finger=1))
    truth = after(source, EASED)
    assert truth.contacts.touching == ()
    assert np.abs(truth.surface.displacement_mm).max() < 0.002
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
        x_mm, y_mm = 16.0 * (finger % 6) - 40.0, 16.0 * (finger // 6) - 24.0
        deep_mm = 0.08 * min(60.0 - abs(x_mm), 40.0 - abs(y_mm))  # so that none hangs over a hollow
        source.press(Press(finger=finger, x_mm=x_mm, y_mm=y_mm, depth_mm=deep_mm))
    assert len(touching(source, EASED)) == MOST_FINGERS


def test_the_solved_scene_is_shown_while_nobody_presses() -> None:
    source, solid = (
        PressedSource("fingers", width_px=SMALL_PX),
        simulated_source("fingers", width_px=SMALL_PX),
    )
    for index, frame in enumerate(islice(source, 100)):
        assert frame.index == index
    shown, true = source.truth(75), solid.truth(75)
    assert shown is not None
    np.testing.assert_array_equal(shown.surface.displacement_mm, true.surface.displacement_mm)
    assert len(shown.contacts.touching) == 2
    for contact, other in zip(shown.contacts.contacts, true.contacts.contacts, strict=True):
        assert (contact.id, contact.phase) == (other.id, other.phase)
        np.testing.assert_array_equal(contact.force_N, other.force_N)


def test_the_first_finger_interrupts_the_scene_which_restarts_when_all_are_lifted() -> None:
    source = PressedSource("fingers", width_px=SMALL_PX)
    before = after(source, round(3.0 * source.fps))
    assert len(before.contacts.touching) == 2
    source.press(Press(finger=1, x_mm=40.0, y_mm=20.0, depth_mm=2.0))
    taken = after(source, 1)
    step_mm = taken.surface.displacement_mm - before.surface.displacement_mm
    assert np.abs(step_mm).max() < 3.0  # they are lifted in some frames, not at once
    scene_ids = {contact.id for contact in before.contacts.touching}
    assert scene_ids == {contact.id for contact in taken.contacts.touching} - {FIRST_ID}
    (contact,) = touching(source, EASED + 5)
    assert contact.id >= FIRST_ID
    np.testing.assert_allclose(contact.centre_mm, [40.0, 20.0], atol=0.3)
    source.press(Release(finger=1))
    quiet = after(source, round((ALONE_S + 1.0) * source.fps))
    assert quiet.contacts.touching == ()
    assert np.abs(quiet.surface.displacement_mm).max() < 1e-6
    again = touching(source, round(1.5 * source.fps))
    assert len(again) == 2
    assert not scene_ids & {contact.id for contact in again}
    assert all(contact.id < FIRST_ID for contact in again)


def test_the_scene_comes_again_and_again() -> None:
    source = PressedSource("one", width_px=SMALL_PX)
    first = touching(source, round(3.0 * source.fps))
    again = touching(source, round(6.0 * source.fps))
    assert len(first) == len(again) == 1
    assert again[0].id > first[0].id
    np.testing.assert_allclose(again[0].centre_mm, first[0].centre_mm, atol=1e-6)


def test_truth_goes_with_the_picture_and_is_forgotten(source: PressedSource) -> None:
    frame = next(iter(source))
    truth = source.truth(frame.index)
    assert truth is not None
    assert truth.frame_index == frame.index
    assert source.truth(frame.index + 1) is None


def test_it_ends_when_it_shall() -> None:
    source = PressedSource("rest", seconds=0.5, width_px=SMALL_PX)
    assert [frame.index for frame in source] == list(range(15))
    assert source.frame_count == 15
    assert PressedSource().frame_count is None
