"""Readings of a live session in Python: `with`, `async with`, commands, outputs, a recording."""

import asyncio
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

import manytouch
from drawn_source import DrawnSource
from manytouch.errors import ManytouchError
from manytouch.recording.reader import Recording
from manytouch.sources import Capabilities
from manytouch.values import Frame, Pause
from waiting import wait_until

FRAMES = 24


def source() -> DrawnSource:
    return DrawnSource(frames=FRAMES, fps=200.0)


def test_the_readings_are_those_of_all_frames_and_the_session_ends_with_the_block(tmp_path: Path) -> None:
    path = tmp_path / "press.mcap"
    with manytouch.stream(source(), method="perimeter", pitch_mm=4.0, record=str(path)) as readings:
        found = [reading.frame.index for reading in readings]
        assert readings.health.frames == FRAMES
        assert readings.sensor.layout is not None
    assert found == list(range(FRAMES))
    assert len(Recording(path)) == FRAMES


def test_a_block_may_be_left_early() -> None:
    with manytouch.stream(source(), method="perimeter", pitch_mm=4.0) as readings:
        assert len(list(islice(readings, 3))) == 3
        readings.send(Pause())


def test_without_a_block_a_sentence_states_how() -> None:
    readings = manytouch.stream(source(), method="perimeter")
    with pytest.raises(ManytouchError, match="iterated in its block"):
        next(readings)
    with pytest.raises(ManytouchError, match="no session before its block"):
        _ = readings.health
    with pytest.raises(ManytouchError, match="no output smoke://"):
        manytouch.stream(source(), to=["smoke://here"])


def test_other_tasks_run_while_an_asynchronous_loop_waits() -> None:
    async def count() -> tuple[int, int]:
        ticks = 0

        async def tick() -> None:
            nonlocal ticks
            while True:
                ticks += 1
                await asyncio.sleep(0.001)

        ticking = asyncio.create_task(tick())
        async with manytouch.stream(source(), method="perimeter", pitch_mm=4.0) as readings:
            found = [reading.frame.index async for reading in readings]
        ticking.cancel()
        return len(found), ticks

    frames, ticks = asyncio.run(count())
    assert frames == FRAMES
    assert ticks > 10


def test_an_error_of_the_source_is_raised_when_the_block_is_entered() -> None:
    with pytest.raises(ManytouchError, match="There is no"), manytouch.stream("missing.mp4"):
        pass


class SilentCamera(DrawnSource):
    """Gives its first frames, and then none until it is closed.

    Attributes:
        is_silent: set when it gives none any more.
        is_closed: set when it is closed.
        at_begin: called before the first frame.
    """

    def __init__(self, at_begin: Callable[[], object] = lambda: None) -> None:
        super().__init__(frames=60, is_touched=False, is_live=True)
        self.is_silent, self.is_closed = threading.Event(), threading.Event()
        self.at_begin = at_begin

    @property
    def capabilities(self) -> Capabilities:
        return replace(super().capabilities, close=self.is_closed.set)

    def __iter__(self) -> Iterator[Frame]:
        self.at_begin()
        yield from super().__iter__()
        self.is_silent.set()
        self.is_closed.wait()


def test_a_task_that_waits_for_a_silent_camera_can_be_cancelled(tmp_path: Path) -> None:
    camera, path = SilentCamera(), tmp_path / "press.mcap"

    async def read() -> None:
        async with manytouch.stream(camera, method="perimeter", pitch_mm=4.0, record=path) as readings:
            async for _ in readings:
                pass

    async def cancel() -> None:
        reading = asyncio.create_task(read())
        await asyncio.to_thread(camera.is_silent.wait)
        reading.cancel()
        await reading

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(cancel())
    assert camera.is_closed.is_set()
    assert len(Recording(path)) > 0, "the recording is complete"


def test_a_task_that_is_cancelled_while_it_enters_the_block_leaves_no_camera_open() -> None:
    has_begun, may_continue = threading.Event(), threading.Event()

    def wait() -> None:
        has_begun.set()
        may_continue.wait()

    camera = SilentCamera(at_begin=wait)

    async def enter() -> None:
        async with manytouch.stream(camera, method="perimeter", pitch_mm=4.0):
            pass

    async def cancel() -> None:
        entering = asyncio.create_task(enter())
        await asyncio.to_thread(has_begun.wait)
        entering.cancel()
        with pytest.raises(asyncio.CancelledError):
            await entering
        may_continue.set()

    asyncio.run(cancel())
    wait_until(camera.is_closed.is_set)


def test_a_block_that_is_left_ends_the_iteration_of_another_thread() -> None:
    camera, found = SilentCamera(), []
    with manytouch.stream(camera, method="perimeter", pitch_mm=4.0) as readings:
        thread = threading.Thread(target=lambda: found.extend(readings))
        thread.start()
        camera.is_silent.wait()
    thread.join()
    assert found
