"""Cases in which markers once had a wrong identity."""

import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

from identity import runs_of, score, track_pictures, track_points  # noqa: E402
from sequences import Sequence, can_move, course_of  # noqa: E402

from manytouch.detection import DotSearch  # noqa: E402
from manytouch.tracking.tracker import MarkerTracker  # noqa: E402


def test_fast_presses_shift_no_row_at_the_rim() -> None:
    course = course_of(Sequence(step_pitches=1.2, missing_share=0.02, false_share=0.02, frames=50, seed=4))
    result = score(course, track_points(course, MarkerTracker()))
    assert result.wrong == 0.0
    assert result.lost_percent < 0.1


def test_dots_that_move_by_15_px_per_frame_at_a_pitch_of_17_px() -> None:
    course = course_of(
        Sequence(dots=384, size="480p", margin=0.6375, step_pitches=15.0 / 17.0, frames=40, seed=1)
    )
    assert 16.9 < course.pitch_px < 17.1
    fastest_px = np.linalg.norm(np.diff(course.centre_px, axis=0), axis=2).max(axis=1)
    assert np.allclose(fastest_px[2:], 15.0, atol=0.1)
    result = score(course, track_pictures(course, DotSearch(), MarkerTracker()))
    assert result.wrong == 0.0
    assert result.lost_percent < 0.5


def test_seeds_whose_sheet_would_fold_are_skipped() -> None:
    wanted = Sequence(dots=96, step_pitches=1.2)
    runs = list(runs_of(wanted, 40_000))
    assert len(runs) == 9
    assert all(can_move(run) for run in runs)
    assert runs[-1].seed > len(runs) - 1, "no sheet folds: choose a larger step"
