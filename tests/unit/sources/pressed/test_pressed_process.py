"""The simulated sensor in a process of its own: the frames of the same sensor in this one."""

import os
import signal
from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.sources import Source
from manytouch.sources.pressed.pressed_process import TRUTHS_KEPT, PressedProcess
from manytouch.sources.pressed.pressed_source import PressedSource
from manytouch.sources.source import close
from manytouch.values import Frame, Press, Release, Truth

SMALL_PX = 160


def pressed(source: Source) -> Iterator[tuple[Frame, Truth]]:
    """Frames while a finger comes and goes, with their ground truth."""
    can = source.capabilities
    assert can.press is not None
    assert can.truth is not None
    for frame in source:
        if frame.index == 2:
            can.press(Press(finger=1, x_mm=-20.0, y_mm=10.0, depth_mm=2.0))
        if frame.index == 8:
            can.press(Release(finger=1))
        truth = can.truth(frame.index)
        assert truth is not None
        yield frame, truth


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_frames_and_truth_are_those_of_this_process() -> None:
    here, there = (kind("one", seconds=0.5, width_px=SMALL_PX) for kind in (PressedSource, PressedProcess))
    for name in ("name", "fps", "frame_count", "width_px", "height_px", "is_live"):
        assert getattr(there, name) == getattr(here, name), name
    pairs = list(zip(pressed(here), pressed(there), strict=True))
    assert len(pairs) == 15
    assert max(len(true.contacts.touching) for (_, true), _ in pairs) == 1
    for (frame, true), (other, found) in pairs:
        assert (other.index, other.timestamp_ns, other.camera) == (
            frame.index,
            frame.timestamp_ns,
            frame.camera,
        )
        np.testing.assert_array_equal(other.image, frame.image)
        assert not other.image.flags.writeable
        np.testing.assert_array_equal(found.surface.position_mm, true.surface.position_mm)
        np.testing.assert_array_equal(found.grid.position_px, true.grid.position_px)
        assert found.surface.layout is there.capabilities.sensor.layout
        for contact, expected in zip(found.contacts.contacts, true.contacts.contacts, strict=True):
            assert (contact.id, contact.phase) == (expected.id, expected.phase)
            np.testing.assert_array_equal(contact.force_N, expected.force_N)
    close(there)
    assert not is_running(there.pid)
    assert list(there) == []
    there.press(Release(finger=1))


def test_only_the_latest_truth_is_kept() -> None:
    source = PressedProcess("rest", width_px=SMALL_PX)
    list(islice(source, TRUTHS_KEPT + 2))
    assert [source.truth(index) is None for index in (0, 1, 2, TRUTHS_KEPT + 1, TRUTHS_KEPT + 2)] == [
        True,
        True,
        False,
        False,
        True,
    ]
    source.close()


def test_a_scene_that_does_not_exist_is_known_with_the_first_property() -> None:
    source = PressedProcess("nothing")
    with pytest.raises(SourceError, match="The simulated scene 'nothing' does not exist: use "):
        _ = source.capabilities
    source.close()
    assert not is_running(source.pid)


def test_a_process_that_was_killed_ends_the_frames_with_a_sentence() -> None:
    source = PressedProcess("rest", width_px=SMALL_PX)
    frames = iter(source)
    next(frames)
    os.kill(source.pid, signal.SIGKILL)
    with pytest.raises(SourceError, match=r"^the process of the simulated sensor has ended \(exit status -9"):
        next(frames)
    with pytest.raises(SourceError, match="has ended"):
        source.press(Release(finger=1))
    source.close()
