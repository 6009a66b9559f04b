"""Times of frames, where the right answer is known by hand."""

import numpy as np
import pytest

from manytouch.evaluation.metrics.latency import latency_figures


def test_latency_by_hand() -> None:
    found = latency_figures(np.array([*np.arange(1.0, 102.0), np.nan]))
    assert found["p50_ms"] == 51
    assert found["p99_ms"] == 100
    assert found["frames"] == 101
    assert found["frames_per_second"] == pytest.approx(1000 / 51)
    assert np.isnan(latency_figures(np.array([np.nan]))["p50_ms"])


def test_a_frame_that_stalls_shows_in_the_slowest_hundredth_and_the_rate_not_in_the_median() -> None:
    stalled = latency_figures(np.array([*np.full(50, 2.0), 1000.0]))
    assert stalled["p50_ms"] == 2
    assert stalled["p99_ms"] > 400
    assert stalled["frames_per_second"] < 50
