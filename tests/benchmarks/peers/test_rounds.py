"""Methods that are timed together take turns, and what they answer is compared with the truth."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path += [str(BENCHMARKS), str(BENCHMARKS / "peers")]

import rounds  # noqa: E402
from goals import TRACKED, goals_of  # noqa: E402
from rounds import TURN_MS, Answer, Footage, Method, Timing, in_a_row, interleaved  # noqa: E402
from sequences import Sequence, course_of  # noqa: E402

from manytouch.values import Frame  # noqa: E402


@pytest.fixture
def footage() -> Footage:
    course = course_of(Sequence(dots=96, size="480p", frames=6))
    blank = [Frame(index=index, timestamp_ns=0, camera="test", image=None) for index in range(6)]
    return Footage(course=course, frames=blank, jpeg=[b""] * 6)


def method(name: str, run: Callable[[Footage, int], Answer]) -> Method:
    return Method(name=name, does="", prepare=lambda footage: lambda index: run(footage, index))


def truth(footage: Footage, index: int) -> Answer:
    return Answer(centre_px=footage.course.centre_px[index], marker=np.arange(96))


def test_answers_are_compared_with_the_truth(footage: Footage) -> None:
    def shifted(footage: Footage, index: int) -> Answer:
        return Answer(centre_px=footage.course.centre_px[index] + [0.5, 0.0])

    def swapped(footage: Footage, index: int) -> Answer:
        return Answer(centre_px=footage.course.centre_px[index], marker=np.roll(np.arange(96), 1))

    def half(footage: Footage, index: int) -> Answer:
        return Answer(centre_px=footage.course.centre_px[index][:48])

    methods = [
        method("truth", truth),
        method("shifted", shifted),
        method("swapped", swapped),
        method("half", half),
    ]
    timings = interleaved(methods, footage, 10)
    assert (np.mean(timings["truth"].found), np.mean(timings["truth"].wrong)) == (1.0, 0.0)
    assert timings["truth"].rms_px == 0.0
    assert timings["shifted"].rms_px == pytest.approx(0.5 / np.sqrt(2))
    assert np.mean(timings["swapped"].wrong) == 1.0
    assert np.mean(timings["half"].found) == pytest.approx(0.5)
    for each in timings.values():
        assert len(each.first_ms) == 10
        assert len(each.spent_ms) == 10 * each.frames


class FakeClock:
    """Stands in for the module `time`: methods advance it by what they are supposed to take."""

    def __init__(self) -> None:
        self.wall_s = self.cpu_s = 0.0

    def perf_counter(self) -> float:
        return self.wall_s

    def thread_time(self) -> float:
        return self.cpu_s


def test_turns_run_through_neighbouring_frames_and_slow_methods_skip_rounds(
    footage: Footage, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = FakeClock()
    monkeypatch.setattr(rounds, "time", clock)
    frames: dict[str, list[int]] = {"quick": [], "slow": []}

    def quick(footage: Footage, index: int) -> Answer:
        frames["quick"].append(index)
        clock.wall_s += 3e-3
        clock.cpu_s += 2e-3
        return Answer()

    def slow(footage: Footage, index: int) -> Answer:
        frames["slow"].append(index)
        clock.wall_s += 2.2e-3 * TURN_MS
        return Answer()

    timings = interleaved([method("quick", quick), method("slow", slow)], footage, 9)
    assert timings["quick"].frames == 10
    assert len(timings["quick"].first_ms) == 9
    assert len(timings["quick"].spent_ms) == 9 * timings["quick"].frames
    assert timings["slow"].frames == 1
    assert timings["slow"].every == 2
    assert len(timings["slow"].spent_ms) == 5
    for indices in frames.values():
        assert (np.abs(np.diff(indices)) == 1).all()
    assert timings["quick"].median_ms == pytest.approx(3.0)
    assert timings["quick"].median_cpu_ms == pytest.approx(2.0)
    assert timings["slow"].median_ms == pytest.approx(2.2 * TURN_MS)
    assert timings["slow"].median_cpu_ms == 0.0


def test_goals_compare_with_the_fastest_tuned_chain_on_the_whole_image() -> None:
    spent = {
        TRACKED: 1.0,
        "copy of the frame": 0.25,
        "OpenCV, tuned: blobs": 5.0,
        "OpenCV, tuned: contours": 9.0,
        "OpenCV, tuned: components at half size": 2.0,
        "trackpy.locate": 100.0,
    }
    timings = {name: Timing(spent_ms=[ms] * 120, cpu_ms=[ms] * 120) for name, ms in spent.items()}
    row = Timing(spent_ms=[1.0] * 970 + [2.5] * 30, cpu_ms=[1.0] * 1000)
    lines_of_goals = goals_of(timings, row, None)
    numbers = {line.split("  ")[0].strip(): line for line in lines_of_goals}
    assert "5.00" in numbers["times faster than tuned OpenCV"]
    assert numbers["times faster than tuned OpenCV"].endswith(": reached")
    assert numbers["times faster than trackpy.locate"].endswith("NOT reached")
    assert numbers["tracked frame, ms"].endswith(": reached")
    assert "4.00" in numbers["tracked frame, copies"]
    assert "2.50" in numbers["p99 / median of 1000 tracked frames"]


def test_frames_in_a_row_are_neighbours_and_the_first_ones_are_not_counted(footage: Footage) -> None:
    seen: list[int] = []

    def run(footage: Footage, index: int) -> Answer:
        seen.append(index)
        return Answer()

    assert len(in_a_row(method("alone", run), footage, 20).spent_ms) == 20
    assert len(seen) > 20
    assert (np.abs(np.diff(seen)) == 1).all()
