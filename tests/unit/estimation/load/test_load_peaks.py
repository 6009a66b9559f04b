"""What is left of an earlier press while the sheet creeps back."""

import numpy as np
import pytest

from manytouch.estimation.load.load_peaks import LoadPeakFinder, LoadPeaks


def peaks(*load: float) -> LoadPeaks:
    count = len(load)
    return LoadPeaks(
        centre_mm=np.zeros((count, 2)),
        covariance_mm2=np.zeros((count, 2, 2)),
        load=np.array(load),
        load_std=np.zeros(count),
        area_mm2=np.ones(count),
        may_start=np.ones(count, dtype=np.bool_),
        floor=0.0,
        region=np.zeros((2, 2), dtype=np.int64),
    )


def test_an_earlier_press_fades_as_fast_at_every_frame_rate() -> None:
    finder = LoadPeakFinder()
    assert finder.fade(peaks(0.1, 0.4), 0.2, elapsed_s=0.1) == 0.4
    for fps in (15, 120):
        recent = 0.4
        for _ in range(fps):
            recent = finder.fade(peaks(), recent, elapsed_s=1.0 / fps)
        assert recent == pytest.approx(0.4 * np.exp(-1.0 / finder.creep_s))
