"""Time between frames."""

import math

import pytest

from manytouch.estimation.frame_interval import LONGEST_S, USUAL_S, interval_s, remaining


@pytest.mark.parametrize(
    ("before_ns", "now_ns", "expected_s"),
    [
        (1_000_000_000, 1_020_000_000, 0.02),
        (0, 60_000_000_000, LONGEST_S),
        (None, 40_000_000, USUAL_S),
        (40_000_000, None, USUAL_S),
        (40_000_000, 40_000_000, USUAL_S),
        (80_000_000, 40_000_000, USUAL_S),
    ],
)
def test_the_time_since_the_frame_before(
    before_ns: int | None, now_ns: int | None, expected_s: float
) -> None:
    assert interval_s(before_ns, now_ns) == pytest.approx(expected_s)


def test_what_is_left_is_that_of_all_intervals_together() -> None:
    assert remaining(0.2, 3.0) * remaining(0.5, 3.0) == pytest.approx(remaining(0.7, 3.0))
    assert remaining(3.0, 3.0) == pytest.approx(math.exp(-1.0))
    assert remaining(0.1, 0.0) == 0.0
