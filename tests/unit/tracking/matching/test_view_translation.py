"""Votes on the translation of the view."""

import numpy as np
import pytest

from flat_sensor import rectangle_px
from manytouch.tracking.matching.view_translation import TRANSLATION, likely_translations

PITCH = 40.0


def reference_histogram(centre, position):
    """(y, x) number of pairs by dot minus position, in bins of a tenth of a pitch."""
    bin_px, half = PITCH / TRANSLATION.bins_per_spacing, int(TRANSLATION.reach * TRANSLATION.bins_per_spacing)
    off = np.floor((centre[None] - position[:, None]).reshape(-1, 2) / bin_px + 0.5).astype(int) + half
    off = off[((off >= 0) & (off <= 2 * half)).all(axis=1)]
    count = np.zeros((2 * half + 1, 2 * half + 1))
    np.add.at(count, (off[:, 1], off[:, 0]), 1.0)
    return count, bin_px, half


@pytest.mark.parametrize("seed", range(4))
def test_the_first_translation_is_the_peak_of_the_histogram(seed):
    chance = np.random.default_rng(seed)
    position = rectangle_px(9, 12) + chance.normal(0.0, 3.0, (108, 2))
    is_present = chance.random(108) < 0.9
    moved = chance.uniform(-1.2, 1.2, 2) * PITCH
    centre = (position + moved + chance.normal(0.0, 0.5, position.shape))[chance.permutation(108)[:90]]
    found = likely_translations(centre, PITCH, position, is_present)
    assert len(found) <= TRANSLATION.peaks
    count, bin_px, half = reference_histogram(centre, position[is_present])
    windows = np.lib.stride_tricks.sliding_window_view(count, (3, 3))
    v, u = np.unravel_index(np.argmax(windows.sum(axis=(2, 3))), windows.shape[:2])
    window = windows[v, u]
    y, x = np.indices((3, 3))
    expected = np.array([(window * (u + x)).sum(), (window * (v + y)).sum()]) / window.sum() - half
    np.testing.assert_allclose(found[0], expected * bin_px, atol=1e-9)
    np.testing.assert_allclose(found[0], moved, atol=0.1 * PITCH)


def test_a_regular_pattern_has_peaks_one_pitch_apart():
    position = rectangle_px(9, 12)
    moved = np.array([0.3 * PITCH, -0.1 * PITCH])
    found = likely_translations(position + moved, PITCH, position, np.ones(108, dtype=bool))
    apart = (found - moved) / PITCH
    np.testing.assert_allclose(apart, np.round(apart), atol=0.02)
    assert len(found) == TRANSLATION.peaks
    np.testing.assert_allclose(apart[0], 0.0, atol=0.02)
