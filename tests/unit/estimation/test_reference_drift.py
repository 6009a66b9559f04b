"""The reference follows a creep, and never far."""

import numpy as np

from layouts import grid_at
from manytouch.estimation.reference_drift import ReferenceDrift


def test_it_follows_slowly_and_no_further_than_its_bound() -> None:
    began = np.zeros((3, 2))
    crept = np.array([[0.2, 0.0], [0.0, 5.0], [7.0, 7.0]])
    seen = np.array([True, True, False])
    settle, reference = ReferenceDrift(time_constant_s=5.0, max_drift_pitch=0.01), began
    for frame in range(1000):
        grid = grid_at(crept, unseen=~seen)
        reference = settle(reference, began, grid, pitch_px=70.0, elapsed_s=0.05)
        if frame == 9:
            assert 0.01 < reference[0, 0] < 0.03
    np.testing.assert_allclose(reference[0], [0.2, 0.0], atol=1e-3)
    np.testing.assert_allclose(reference[1], [0.0, 0.7], atol=1e-12)
    np.testing.assert_array_equal(reference[2], 0.0)


def test_it_follows_as_fast_at_every_frame_rate() -> None:
    began, crept = np.zeros((1, 2)), np.array([[0.2, -0.1]])
    found = []
    for fps in (15, 120):
        reference = began
        for _ in range(2 * fps):
            reference = ReferenceDrift()(reference, began, grid_at(crept), pitch_px=70.0, elapsed_s=1.0 / fps)
        found.append(reference)
    np.testing.assert_allclose(found[0], found[1])
    assert 0.04 < found[0][0, 0] < 0.06
