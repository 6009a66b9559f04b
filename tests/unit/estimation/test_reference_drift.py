"""The reference follows a creep, and never far."""

import numpy as np

from layouts import grid_at
from manytouch.estimation.reference_drift import ReferenceDrift


def test_it_follows_slowly_and_no_further_than_its_bound() -> None:
    began = np.zeros((3, 2))
    crept = np.array([[0.2, 0.0], [0.0, 5.0], [7.0, 7.0]])
    seen = np.array([True, True, False])
    settle, reference = ReferenceDrift(share=0.01, max_drift_pitch=0.01), began
    for frame in range(1000):
        reference = settle(reference, began, grid_at(crept, unseen=~seen), pitch_px=70.0)
        if frame == 9:
            assert 0.01 < reference[0, 0] < 0.03
    np.testing.assert_allclose(reference[0], [0.2, 0.0], atol=1e-3)
    np.testing.assert_allclose(reference[1], [0.0, 0.7], atol=1e-12)
    np.testing.assert_array_equal(reference[2], 0.0)
