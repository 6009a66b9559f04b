"""Files at the pace of their timestamps."""

import pytest

from manytouch.session.pacing import Pace

STEP_NS = 40_000_000


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time, then the naps so far."""
    now = [100.0]
    monkeypatch.setattr("manytouch.session.pacing.time.monotonic", lambda: now[0])

    def nap(seconds: float) -> None:
        now[0] += seconds
        now.append(seconds)

    monkeypatch.setattr("manytouch.session.pacing.time.sleep", nap)
    return now


def times(pace: Pace, clock: list[float], frames: list[int], *, is_over: bool = False) -> list[float]:
    found = []
    for frame in frames:
        pace.wait_for(frame * STEP_NS, lambda: is_over)
        found.append(clock[0])
    return found


def test_frames_come_when_their_time_has_come(clock: list[float]) -> None:
    assert times(Pace(), clock, [5, 6, 11]) == pytest.approx([100.0, 100.04, 100.24])
    assert max(clock[1:]) <= 0.05


def test_twice_the_speed_takes_half_the_time(clock: list[float]) -> None:
    assert times(Pace(2.0), clock, [0, 10]) == pytest.approx([100.0, 100.2])


def test_nobody_waits_once_it_is_over(clock: list[float]) -> None:
    assert times(Pace(), clock, [0, 1000], is_over=True) == [100.0, 100.0]


def test_after_a_reset_the_next_frame_is_due_at_once(clock: list[float]) -> None:
    pace = Pace()
    times(pace, clock, [0, 1])
    pace.reset()
    assert times(pace, clock, [500, 501]) == pytest.approx([100.04, 100.08])


def test_the_next_frame_is_due_one_period_after_the_latest_one(clock: list[float]) -> None:
    pace = Pace()
    pace.wait_for_next(25.0, lambda: False)
    assert clock[0] == 100.0, "the first frame is due at once"
    times(pace, clock, [3])
    for _ in range(2):  # however often it is asked for
        pace.wait_for_next(25.0, lambda: False)
        assert clock[0] == pytest.approx(100.04)
    assert times(pace, clock, [4, 5]) == pytest.approx([100.04, 100.08])
    pace.wait_for_next(None, lambda: False)
    pace.reset()
    pace.wait_for_next(25.0, lambda: False)
    assert clock[0] == pytest.approx(100.08), "without a rate, and after a pause, it is due at once"


@pytest.mark.parametrize("jump", [10**6, 2**60, -(10**6)])
def test_a_frame_after_a_jump_of_the_clock_is_due_at_once(jump: int, clock: list[float]) -> None:
    frames = [0, 1, jump, jump + 1, jump + 2]
    assert times(Pace(), clock, frames) == pytest.approx([100.0, 100.04, 100.04, 100.08, 100.12])


def test_a_pause_of_ten_seconds_is_waited_for(clock: list[float]) -> None:
    assert times(Pace(), clock, [0, 250]) == pytest.approx([100.0, 110.0])
