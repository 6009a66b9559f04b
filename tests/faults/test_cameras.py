"""Cameras that stall silently, change the size of their images, or are disconnected again and again."""

import threading
import time
from collections.abc import Callable, Iterator
from itertools import islice

import numpy as np
import pytest

from cameras import numbered
from manytouch.sources.cameras import camera as camera_module
from manytouch.sources.cameras.camera import ArrivalClock, CameraSource
from manytouch.sources.cameras.capture import CapturedImage
from manytouch.values import Frame, Setting
from waiting import wait_until


class Capture:
    """A camera whose images are what a function returns; None is a failure."""

    settings: tuple[Setting, ...] = ()

    def __init__(self, image: Callable[[], np.ndarray | None]) -> None:
        self.is_released = False
        self._image = image

    def read(self) -> CapturedImage | None:
        time.sleep(0.001)
        image = self._image()
        return None if image is None else CapturedImage(image=image, encoded=None, driver_ns=None)

    def release(self) -> None:
        self.is_released = True


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_module, "RETRY_S", 0.002)


def test_a_camera_comes_back_a_hundred_times() -> None:
    opened: list[Capture] = []
    reads = iter(range(10**9))

    def image() -> np.ndarray | None:
        number = next(reads)
        return None if number % 11 > 6 and number > 20 else numbered(number)

    def open_capture() -> Capture:
        opened.append(Capture(image))
        return opened[-1]

    source = CameraSource("0", open_capture)
    frames: Iterator[Frame] = iter(source)
    indices, times_ns = [], []
    while len(opened) < 100:
        frame = next(frames)
        indices.append(frame.index)
        times_ns.append(frame.timestamp_ns)
    source.close()
    assert (np.diff(indices) > 0).all()
    assert (np.diff(times_ns) > 0).all()
    assert all(capture.is_released for capture in opened)
    assert "manytouch-camera" not in [thread.name for thread in threading.enumerate()]


def test_a_silent_camera_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_module, "SILENT_S", 0.2)
    silent, go_on = threading.Event(), threading.Event()

    def image() -> np.ndarray:
        if silent.is_set():
            assert go_on.wait(20)
        return numbered(1)

    source = CameraSource("0", lambda: Capture(image))
    frames = iter(source)
    next(frames)
    assert source.status == "ok"
    silent.set()
    wait_until(lambda: "no image from camera-0 for" in source.status)
    silent.clear()
    go_on.set()
    wait_until(lambda: source.status == "ok")
    source.close()


def test_images_of_another_size_are_frames_without_image() -> None:
    sizes = iter([(320, 240)] * 3 + [(640, 480)] * 3 + [(320, 240)] * 10**4)
    source = CameraSource("0", lambda: Capture(lambda: numbered(1, *next(sizes))))
    frames, shapes, statuses = iter(source), [], []
    for frame in islice(frames, 10):
        shapes.append(None if frame.image is None else frame.image.shape)
        statuses.append(source.status)
    source.close()
    assert set(shapes) <= {None, (240, 320)}
    assert None in shapes
    assert any("to 640 x 480 px; set the size again" in status for status in statuses)
    assert statuses[-1] == "ok"


@pytest.mark.parametrize("jump_ns", [-(10**18), -1, 0, 10**18])
def test_times_increase_when_the_clock_of_the_driver_jumps(jump_ns: int) -> None:
    clock, times_ns = ArrivalClock(), []
    for number in range(100):
        jumped_ns = jump_ns if number % 20 > 10 else 0
        times_ns.append(clock.at(10**12 + number * 33_000_000 + jumped_ns, 5 * 10**9 + number * 33_000_000))
    assert times_ns[0] == 0
    assert (np.diff(times_ns) > 0).all()
    assert times_ns[-1] <= 101 * 33_000_000
