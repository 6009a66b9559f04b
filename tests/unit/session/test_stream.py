"""Readings of a live session in Python: `with`, `async with`, commands, outputs, a recording."""

import asyncio
from itertools import islice
from pathlib import Path

import pytest

import manytouch
from drawn_source import DrawnSource
from manytouch.errors import ManytouchError
from manytouch.recording.reader import Recording
from manytouch.values import Pause

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
