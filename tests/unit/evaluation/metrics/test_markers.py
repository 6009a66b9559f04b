"""Dots that are found, and their identities, where the right answer is known by hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluatedRecording
from manytouch.evaluation.metrics.markers import dot_figures, dot_samples

Sheet = Callable[..., EvaluatedRecording]


def test_a_perfect_tracker_scores_perfectly(sheet: Sheet) -> None:
    found = dot_figures(dot_samples(sheet(), sheet()))
    assert found["found_percent"] == 100
    assert found["false_percent"] == 0
    assert found["centre_rms_px"] == found["centre_p95_px"] == 0
    assert found["wrong_percent"] == found["swaps"] == found["losses"] == 0


def test_the_centre_error_is_the_length_of_the_offset(sheet: Sheet) -> None:
    truth = sheet()
    off = replace(truth, centre_px=truth.centre_px + np.array([0.3, -0.4]))
    found = dot_figures(dot_samples(truth, off))
    assert found["centre_rms_px"] == pytest.approx(0.5)
    assert found["centre_p95_px"] == pytest.approx(0.5)


def test_missed_and_false_dots_are_counted_against_the_visible_ones(sheet: Sheet) -> None:
    truth = sheet(frames=2)
    centre = truth.centre_px.copy()
    centre[0, 3] = np.nan  # missed, and lost nothing: there is no frame before
    centre[1, 4] += 20.0  # 28 px off on a lattice of 40 px: on no dot
    found = dot_figures(dot_samples(truth, replace(truth, centre_px=centre)))
    assert found["found_percent"] == pytest.approx(100 * 28 / 30)
    assert found["false_percent"] == pytest.approx(100 * 1 / 30)
    assert found["losses"] == 1
    assert found["losses_per_1000"] == pytest.approx(1000 / 30)


def test_two_markers_that_change_places_are_two_swaps_and_stay_wrong(sheet: Sheet) -> None:
    truth = sheet(frames=4)
    centre = truth.centre_px.copy()
    centre[2:, [6, 7]] = centre[2:, [7, 6]]
    found = dot_figures(dot_samples(truth, replace(truth, centre_px=centre)))
    assert found["found_percent"] == 100
    assert found["swaps"] == 2
    assert found["wrong_percent"] == pytest.approx(100 * 4 / 60)
    assert found["losses"] == 2


def test_a_whole_lattice_off_by_one_column_is_wrong_though_nothing_swaps(sheet: Sheet) -> None:
    truth = sheet(frames=2)
    centre = np.roll(truth.centre_px, -1, axis=1)
    found = dot_figures(dot_samples(truth, replace(truth, centre_px=centre)))
    assert found["wrong_percent"] == 100
    assert found["swaps"] == 0


def test_a_swap_is_seen_across_frames_without_the_marker(sheet: Sheet) -> None:
    truth = sheet(frames=3)
    centre = truth.centre_px.copy()
    centre[1, 6] = np.nan
    centre[2, 6], centre[2, 7] = centre[0, 7], np.nan
    assert dot_figures(dot_samples(truth, replace(truth, centre_px=centre)))["swaps"] == 1


def test_a_dot_that_is_not_visible_cannot_be_lost(sheet: Sheet) -> None:
    truth = sheet(frames=3)
    centre = truth.centre_px.copy()
    centre[1:, 0] = np.nan
    hidden = replace(truth, centre_px=centre)
    assert dot_figures(dot_samples(hidden, hidden))["losses"] == 0


def test_another_numbering_is_taken_from_the_first_frame_and_held_to(sheet: Sheet) -> None:
    truth = sheet(frames=3)
    kept = np.array([2, 3, 4, 7, 8, 9])
    centre = truth.centre_px[:, kept].copy()
    part = replace(
        truth,
        marker=np.arange(6),
        place=truth.place[kept],
        centre_px=centre,
        centre_std_px=centre,
        depth_mm=truth.depth_mm[:, kept],
        depth_std_mm=truth.depth_mm[:, kept],
    )
    found = dot_figures(dot_samples(truth, part))
    assert found["wrong_percent"] == 0
    assert found["found_percent"] == pytest.approx(40)
    centre[2, [0, 1]] = centre[2, [1, 0]]
    assert dot_figures(dot_samples(truth, part))["swaps"] == 2
