"""Cases in which markers once had a wrong number, kept so that they never do again."""

import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

from identity import score, tracked_points  # noqa: E402
from sequences import Sequence, course_of  # noqa: E402

from manytouch.tracking.follow import FollowGrid  # noqa: E402


def test_a_row_at_the_rim_that_a_slip_of_the_whole_left_behind() -> None:
    course = course_of(Sequence(step_pitches=1.2, missing_share=0.02, false_share=0.02, frames=50, seed=4))
    judged = score(course, tracked_points(course, FollowGrid()))
    assert judged.wrong == 0.0
    assert judged.lost_percent < 0.1
