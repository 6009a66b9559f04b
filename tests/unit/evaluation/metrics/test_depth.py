"""Errors of depth, where the right answer is known by hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows, EvaluatedRecording
from manytouch.evaluation.metrics.depth import (
    depth_figures,
    depth_samples,
    error_against_depth,
    error_map,
    relative_place,
)

Sheet = Callable[..., EvaluatedRecording]
Table = Callable[..., ContactRows]


def dent(*peaks: float) -> np.ndarray:
    depth = np.zeros((len(peaks), 15))
    depth[:, 7] = peaks
    return depth


def pressed_sheet(sheet: Sheet, depth: np.ndarray, contacts: ContactRows) -> EvaluatedRecording:
    return replace(sheet(frames=len(depth)), depth_mm=depth, contacts=contacts)


@pytest.fixture
def everywhere(contact_table: Table) -> ContactRows:
    return contact_table([(frame, 1, 0.0, 0.0, 2.0) for frame in range(3)])


def test_depth_errors_by_hand(sheet: Sheet, everywhere: ContactRows) -> None:
    truth = pressed_sheet(sheet, dent(2.0, 4.0, 5.0), everywhere)
    estimate = replace(truth, depth_mm=dent(2.2, 3.6, 5.5))
    found = depth_figures(depth_samples(truth, estimate))
    rmse = np.array([0.2, 0.4, 0.5]) / np.sqrt(15)
    assert found["rmse_median_mm"] == pytest.approx(rmse[1])
    assert found["rmse_worst_mm"] == pytest.approx(rmse[2])
    assert found["worst_mm"] == pytest.approx(0.5)
    assert found["peak_percent"] == pytest.approx(10)
    assert found["peak_bias_percent"] == pytest.approx(10)
    assert found["given_percent"] == 100


def test_the_error_over_the_peak_is_that_of_the_same_frame(sheet: Sheet, everywhere: ContactRows) -> None:
    truth = pressed_sheet(sheet, dent(2.0, 4.0, 5.0), everywhere)
    estimate = replace(truth, depth_mm=dent(2.4, 2.8, 4.5))
    found = depth_figures(depth_samples(truth, estimate))
    assert found["rmse_of_peak_percent"] == pytest.approx(20 / np.sqrt(15))  # of 20, 30 and 10 % at one of 15


def test_a_flat_estimate_has_lost_the_whole_peak(sheet: Sheet, everywhere: ContactRows) -> None:
    truth = pressed_sheet(sheet, dent(2.0, 4.0, 5.0), everywhere)
    found = depth_figures(depth_samples(truth, replace(truth, depth_mm=np.zeros((3, 15)))))
    assert found["peak_bias_percent"] == pytest.approx(-100)
    assert found["at_peak_percent"] == pytest.approx(100)


def test_the_right_peak_at_the_wrong_place_is_seen_at_the_true_place(
    sheet: Sheet, everywhere: ContactRows
) -> None:
    truth = pressed_sheet(sheet, dent(2.0, 4.0, 5.0), everywhere)
    elsewhere = np.roll(truth.depth_mm, 3, axis=1)
    found = depth_figures(depth_samples(truth, replace(truth, depth_mm=elsewhere)))
    assert found["peak_percent"] == 0
    assert found["at_peak_percent"] == 100
    assert found["rmse_median_mm"] == pytest.approx(4 * np.sqrt(2 / 15))


def test_depth_that_is_not_given_is_not_zero(sheet: Sheet, everywhere: ContactRows) -> None:
    truth = pressed_sheet(sheet, dent(2.0, 4.0, 5.0), everywhere)
    depth = truth.depth_mm.copy()
    depth[:, 7:10] = np.nan
    found = depth_figures(depth_samples(truth, replace(truth, depth_mm=depth)))
    assert found["rmse_median_mm"] == 0
    assert found["given_percent"] == pytest.approx(80)
    nothing = depth_figures(depth_samples(truth, replace(truth, depth_mm=np.full((3, 15), np.nan))))
    assert np.isnan(nothing["rmse_median_mm"])
    assert nothing["given_percent"] == 0


def test_frames_at_rest_are_kept_apart(sheet: Sheet, contact_table: Table) -> None:
    truth = pressed_sheet(sheet, dent(0.5, 0.5, 4.0), contact_table([(2, 1, 0.0, 0.0, 4.0)]))
    samples = depth_samples(truth, replace(truth, depth_mm=truth.depth_mm + 0.25))
    found = depth_figures(samples)
    assert len(samples.error_mm) == 15  # markers of the one frame in which something touches
    assert found["frames"] == 1
    assert found["peak_bias_percent"] == pytest.approx(6.25)
    assert found["rest_rmse_mm"] == pytest.approx(0.25)
    assert found["rmse_worst_mm"] == pytest.approx(0.25)


def test_error_against_depth_keeps_the_sign_and_the_class() -> None:
    true = np.repeat([0.05, 2.5], 30)
    error = np.repeat([0.01, -0.5], 30)
    found = error_against_depth(true, error)
    assert found["depth_mm"] == pytest.approx([0.05, 2.5])
    assert found["median_mm"] == pytest.approx([0.01, -0.5])
    assert error_against_depth(true[:19], error[:19])["count"] == []


def test_the_error_map_puts_rows_down_and_columns_across() -> None:
    place = relative_place(np.array([[0.0, 0.0], [8.0, 0.0], [0.0, 4.0], [8.0, 4.0]]))
    found = error_map(np.concatenate([place, place]), np.array([1, 2, 3, 4, -1, -2, -3, -4.0]), (2, 3))
    assert found[:, [0, 2]].tolist() == [[1, 2], [3, 4]]
    assert np.isnan(found[:, 1]).all()
