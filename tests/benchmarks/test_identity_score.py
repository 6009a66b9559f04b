"""Scores of identity: wrong and lost markers, and frames until all are found again."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

from identity import GivenDots, NoEstimate, combine_scores, runs_of, score, score_frame, track_points  # noqa: E402
from sequences import Course, Sequence, course_of, dots_in  # noqa: E402

from layouts import grid_at  # noqa: E402
from manytouch.pipeline import Pipeline  # noqa: E402
from manytouch.tracking.tracker import MarkerTracker  # noqa: E402
from manytouch.values import Detections, Frame, Reading, Sensor, Status, TrackedGrid  # noqa: E402

STD_PX = 0.02


def grid_of(course: Course, index: int, *, status: Status = Status.OK) -> TrackedGrid:
    """The grid of a perfect tracker, with noise."""
    return grid_at(
        course.centre_px[index],
        std_px=STD_PX,
        noise_px=STD_PX,
        seed=index,
        unseen=~course.is_visible[index],
        status=status,
    )


def changed(
    grid: TrackedGrid, *, swap: tuple[int, int] | None = None, drop: slice | None = None
) -> TrackedGrid:
    position, seen = grid.position_px.copy(), grid.is_seen.copy()
    covariance = grid.covariance_px2.copy()
    if swap is not None:
        position[list(swap)] = position[list(swap)[::-1]]
    if drop is not None:
        position[drop], covariance[drop], seen[drop] = np.nan, np.nan, False
    return TrackedGrid(
        position_px=position,
        covariance_px2=covariance,
        is_seen=seen,
        frames_unseen=grid.frames_unseen,
        status=grid.status,
    )


def readings(course: Course, grids: list[TrackedGrid]) -> Iterator[Reading]:
    """Readings of the pipeline with given grids."""
    surface, _, contacts = NoEstimate().step(NoEstimate().start(course.sensor), grids[0])
    for index, grid in enumerate(grids):
        yield Reading(
            frame=Frame(index=index, timestamp_ns=index, camera="test", image=None),
            detections=dots_in(course, index),
            grid=grid,
            surface=surface,
            contacts=contacts,
            milliseconds=1.0,
        )


@pytest.fixture
def course() -> Course:
    return course_of(Sequence(dots=384, size="720p", frames=10, missing_share=0.02))


def test_a_perfect_tracker_has_no_wrong_marker_and_a_chi2_of_one(course: Course) -> None:
    result = score(course, readings(course, [grid_of(course, index) for index in range(10)]))
    assert (result.wrong, result.near, result.lost_percent, result.relock) == (0.0, 0, 0.0, None)
    assert result.seen == course.is_visible.sum()
    assert result.rms_px == pytest.approx(STD_PX, rel=0.05)
    assert result.chi2 == pytest.approx(1.0, rel=0.08)


def test_a_swap_is_two_wrong_markers_counted_by_status(course: Course) -> None:
    grids = [grid_of(course, index) for index in range(10)]
    seen = np.flatnonzero(grids[4].is_seen & grids[5].is_seen)[:2]
    grids[4] = changed(grids[4], swap=(int(seen[0]), int(seen[1])))
    grids[5] = changed(grid_of(course, 5, status=Status.FEW_MARKERS), swap=(int(seen[0]), int(seen[1])))
    result = score(course, readings(course, grids))
    assert (result.wrong_ok, result.wrong_flagged) == (2, 2)
    assert result.wrong == pytest.approx(1e5 * 4 / result.seen)


def test_dropped_markers_are_lost_not_wrong(course: Course) -> None:
    grids = [grid_of(course, index) for index in range(10)]
    grids[6] = changed(grids[6], drop=slice(0, 96))
    result = score(course, readings(course, grids))
    assert result.wrong == 0.0
    assert result.lost_percent == pytest.approx(
        100 * course.is_visible[6][:96].sum() / course.is_visible.sum()
    )


def test_a_false_spot_near_a_missing_dot_is_near_but_one_on_another_dot_is_wrong(course: Course) -> None:
    absent = int(np.flatnonzero(~course.is_visible[3])[0])
    own, other = course.centre_px[3][absent], course.centre_px[3][np.flatnonzero(course.is_visible[3])[0]]
    grid = grid_of(course, 3)

    def standing_at(place: np.ndarray) -> TrackedGrid:
        position, seen = grid.position_px.copy(), grid.is_seen.copy()
        position[absent], seen[absent] = place, True
        return TrackedGrid(
            position_px=position,
            covariance_px2=grid.covariance_px2,
            is_seen=seen,
            frames_unseen=grid.frames_unseen,
        )

    near = score_frame(course, 3, standing_at(own + 0.2 * course.pitch_px * np.array([1.0, 0.0])))
    assert (near.is_near.sum(), near.is_wrong.sum()) == (1, 0)
    far = score_frame(course, 3, standing_at(own + 0.3 * course.pitch_px * np.array([0.0, 1.0])))
    assert (far.is_near.sum(), far.is_wrong.sum()) == (0, 1)
    taken = score_frame(course, 3, standing_at(other))
    assert (taken.is_near.sum(), taken.is_wrong.sum()) == (0, 1)
    crowded_px = course.centre_px.copy()
    place = own + 0.2 * course.pitch_px * np.array([1.0, 0.0])
    crowded_px[3][np.flatnonzero(course.is_visible[3])[0]] = place
    crowded = score_frame(replace(course, centre_px=crowded_px), 3, standing_at(place))
    assert (crowded.is_near.sum(), crowded.is_wrong[absent]) == (0, True)


@pytest.mark.parametrize(("blind", "frames"), [(0, 1), (2, 3)])
def test_relock_counts_clear_frames(blind: int, frames: int) -> None:
    course = course_of(Sequence(dots=96, size="480p", frames=12, fault="black", fault_from=3, fault_frames=4))
    grids = [grid_of(course, index) for index in range(12)]
    for index in range(7, 7 + blind):
        grids[index] = changed(grids[index], drop=slice(0, 50))
    result = score(course, readings(course, grids))
    assert result.relock == frames
    # Lost markers count from the second frame after the fault on.
    assert (result.lost_percent > 0) == (blind > 1)


def test_never_finding_all_again_counts_more_than_the_frames_left() -> None:
    course = course_of(Sequence(dots=96, size="480p", frames=8, fault="flash", fault_from=3))
    grids = [changed(grid_of(course, i), drop=slice(0, 96) if i > 3 else None) for i in range(8)]
    assert score(course, readings(course, grids)).relock == 5


def test_windows_show_only_the_dots_in_them(course: Course) -> None:
    every = dots_in(course, 2)
    detect = GivenDots(dots=(every,) * 3, reach_px=4.0)
    frame = Frame(index=2, timestamp_ns=0, camera="test", image=None)
    _, all_dots = detect.step(None, frame, None)
    assert len(all_dots.centre_px) == len(every.centre_px)
    expected_px = course.centre_px[2] + [3.0, 0.0]
    expected_px[40:] += 0.5 * course.pitch_px
    _, few = detect.step(None, frame, expected_px)
    assert len(few.centre_px) == course.is_visible[2][:40].sum()
    assert few.covariance_px2.shape == (len(few.centre_px), 2, 2)


def test_a_tracker_with_random_identities_is_wrong_nearly_everywhere(course: Course) -> None:
    @dataclass(frozen=True, slots=True, eq=False, kw_only=True)
    class ByOrder:
        """The n-th dot is the n-th marker."""

        def start(self, sensor: Sensor) -> int:
            return len(sensor.layout.rest_mm)

        def step(self, state: int, detections: Detections) -> tuple[int, TrackedGrid]:
            count = len(detections.centre_px)
            position, covariance = np.full((state, 2), np.nan), np.full((state, 2, 2), np.nan)
            position[:count], covariance[:count] = detections.centre_px, detections.covariance_px2
            seen = np.arange(state) < count
            unseen = np.where(seen, 0, 1).astype(np.int64)
            grid = TrackedGrid(
                position_px=position, covariance_px2=covariance, is_seen=seen, frames_unseen=unseen
            )
            return state, grid

        def expected_px(self, state: int) -> None:
            return None

        def needs_full_search(self, state: int) -> bool:
            return False

        def resume(self, started: int, before: int) -> int:
            return before

    result = score(course, track_points(course, ByOrder()))
    assert result.wrong > 95_000


def test_points_run_through_the_real_pipeline() -> None:
    course = course_of(Sequence(dots=96, size="480p", frames=6))
    result = score(course, track_points(course, MarkerTracker()))
    assert result.seen > 0.99 * course.is_visible.sum()
    assert result.wrong == 0.0
    stages = Pipeline(detect=GivenDots(dots=(), reach_px=1.0), track=MarkerTracker(), estimate=NoEstimate())
    assert list(stages.run([], course.sensor)) == []


def test_runs_have_enough_markers_and_add_up(course: Course) -> None:
    runs = list(runs_of(Sequence(dots=384), 50_000))
    assert sum(run.frames * run.dots for run in runs) >= 50_000
    assert len({run.seed for run in runs}) == len(runs)
    grids = [grid_of(course, index) for index in range(10)]
    bad = [changed(grid, drop=slice(0, 192)) for grid in grids]
    good, half = (score(course, readings(course, each)) for each in (grids, bad))
    both = combine_scores([good, half])
    assert both.seen == good.seen + half.seen
    assert both.lost_percent == pytest.approx(half.lost_percent / 2)
    assert min(good.rms_px, half.rms_px) <= both.rms_px <= max(good.rms_px, half.rms_px)
