"""Each metric where the right answer is known by hand, and where an estimate is wrong."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from manytouch.evaluation.metrics.contacts import contact_figures, contact_samples, force_figures
from manytouch.evaluation.metrics.depth import (
    depth_figures,
    depth_samples,
    error_against_depth,
    error_map,
    relative_place,
)
from manytouch.evaluation.metrics.latency import latency_figures
from manytouch.evaluation.metrics.markers import dot_figures, dot_samples
from manytouch.evaluation.metrics.separation import separation_curve, separation_samples
from manytouch.evaluation.metrics.uncertainty_calibration import uncertainty_calibration
from manytouch.evaluation.records.record import ContactRows, EvaluationRecord

Sheet = Callable[..., EvaluationRecord]
Table = Callable[..., ContactRows]


# detection and identities


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


# depth


def dent(*peaks: float) -> np.ndarray:
    depth = np.zeros((len(peaks), 15))
    depth[:, 7] = peaks
    return depth


def pressed_sheet(sheet: Sheet, depth: np.ndarray, contacts: ContactRows) -> EvaluationRecord:
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


# contacts and forces


def test_contacts_by_hand(contact_table: Table) -> None:
    truth = contact_table([(0, 1, 0, 0, 2.0), (0, 2, 20, 0, 2.0), (1, 1, 0, 0, 2.0), (1, 2, 20, 0, 2.0)])
    estimated = contact_table([(0, 5, 0.3, 0.4, 2.5), (0, 6, 60, 0, 2.0), (1, 5, 0, 1.0, 1.0)])
    found = contact_figures(contact_samples(truth, estimated))
    assert found["precision_percent"] == pytest.approx(100 * 2 / 3)
    assert found["recall_percent"] == pytest.approx(50)
    assert found["position_median_mm"] == pytest.approx(0.75)
    assert found["position_p95_mm"] == pytest.approx(0.975)
    assert found["depth_error_median_mm"] == pytest.approx(0.75)
    assert found["switches"] == 0


def test_an_estimate_far_away_is_false_and_finds_nothing(contact_table: Table) -> None:
    found = contact_figures(
        contact_samples(contact_table([(0, 1, 0, 0, 2.0)]), contact_table([(0, 1, 3.5, 0, 2.0)]))
    )
    assert found["precision_percent"] == found["recall_percent"] == 0
    assert np.isnan(found["position_median_mm"])


def test_no_estimate_at_all_has_no_precision_but_a_recall_of_nothing(contact_table: Table) -> None:
    found = contact_figures(contact_samples(contact_table([(0, 1, 0, 0, 2.0)]), contact_table([])))
    assert np.isnan(found["precision_percent"])
    assert found["recall_percent"] == 0


def test_a_contact_that_changes_its_identity_is_a_switch(contact_table: Table) -> None:
    truth = contact_table([(frame, 1, 0, 0, 2.0) for frame in range(5)])
    same = contact_table([(frame, 9, 0, 0, 2.0) for frame in (0, 1, 3, 4)])
    changing = contact_table([(0, 9, 0, 0), (1, 9, 0, 0), (3, 4, 0, 0), (4, 9, 0, 0)])
    assert contact_figures(contact_samples(truth, same))["switches"] == 0
    assert contact_figures(contact_samples(truth, changing))["switches"] == 2


def test_forces_by_hand(contact_table: Table) -> None:
    truth = contact_table([(0, 1, 0, 0, 2, 10.0, 3.0, 4.0), (1, 1, 0, 0, 2, 5.0, 0.0, 0.0)])
    estimated = contact_table([(0, 1, 0, 0, 2, 9.0, 3.0, 3.0), (1, 1, 0, 0, 2, 6.0, 0.0, 0.2)])
    found = force_figures(contact_samples(truth, estimated))
    assert found["normal_median_N"] == pytest.approx(1.0)
    assert found["normal_median_percent"] == pytest.approx(15)
    assert found["normal_p95_percent"] == pytest.approx(19.5)
    assert found["normal_bias_percent"] == pytest.approx(5)
    assert found["shear_median_N"] == pytest.approx(0.6)
    assert found["shear_median_percent"] == pytest.approx(20)  # without the frame that has no shear
    assert found["normal_given_percent"] == found["shear_given_percent"] == 100


def test_shear_with_friction_is_that_of_contacts_with_more_than_a_seventh_of_their_force(
    contact_table: Table,
) -> None:
    truth = contact_table([(0, 1, 0, 0, 2, 10.0, 3.0, 4.0), (1, 1, 0, 0, 2, 10.0, 1.0, 0.0)])
    estimated = contact_table([(0, 1, 0, 0, 2, 9.0, 3.0, 3.0), (1, 1, 0, 0, 2, 10.0, 4.0, 0.0)])
    found = force_figures(contact_samples(truth, estimated))
    assert found["shear_median_percent"] == pytest.approx(160)
    assert found["friction_shear_median_percent"] == pytest.approx(20)
    assert found["friction_shear_p95_percent"] == pytest.approx(20)


def test_the_direction_of_shear_is_that_of_contacts_with_friction(contact_table: Table) -> None:
    truth = contact_table([(0, 1, 0, 0, 2, 10.0, 3.0, 4.0), (1, 1, 0, 0, 2, 10.0, 1.0, 0.0)])
    estimated = contact_table([(0, 1, 0, 0, 2, 9.0, 0.0, 5.0), (1, 1, 0, 0, 2, 10.0, -1.0, 0.0)])
    found = force_figures(contact_samples(truth, estimated))
    assert found["friction_shear_angle_median_deg"] == pytest.approx(np.rad2deg(np.arccos(0.8)))
    nothing = contact_table([(0, 1, 0, 0, 2, 9.0, 0.0, 0.0)])
    assert np.isnan(force_figures(contact_samples(truth, nothing))["friction_shear_angle_median_deg"])


def test_the_worst_twentieth_by_hand(contact_table: Table, sheet: Sheet) -> None:
    """Errors of 0, 1, ... 20 %: the 95th percentile is the twentieth of them, 19 %."""
    frames = range(21)
    truth = contact_table([(frame, 1, 0, 0, 2.0, 10.0, 5.0, 0.0) for frame in frames])
    wrong = contact_table(
        [(f, 1, 0, 0, 2.0 + 0.02 * f, 10.0 + 0.1 * f, 5.0 + 0.03 * f, 0.04 * f) for f in frames]
    )
    samples = contact_samples(truth, wrong)
    assert contact_figures(samples)["depth_error_p95_mm"] == pytest.approx(0.38)
    found = force_figures(samples)
    assert found["normal_p95_N"] == pytest.approx(1.9)
    assert found["normal_p95_percent"] == pytest.approx(19)
    assert found["shear_p95_N"] == pytest.approx(0.95)
    assert found["shear_p95_percent"] == pytest.approx(19)
    depth_mm = np.zeros((21, 15))
    depth_mm[:, 7] = 2.0
    true = sheet(21, depth_mm=depth_mm, contacts=[(frame, 1, 0.0, 0.0, 2.0) for frame in frames])
    factor = 1.0 + 0.01 * np.arange(21.0)[:, None]
    peaks = depth_figures(depth_samples(true, replace(true, depth_mm=depth_mm * factor)))
    assert peaks["peak_p95_percent"] == pytest.approx(19)
    assert peaks["peak_percent"] == pytest.approx(10)


def test_a_force_that_is_not_given_is_no_error(contact_table: Table) -> None:
    truth = contact_table([(0, 1, 0, 0, 2, 10.0, 0.0, 0.0), (1, 1, 0, 0, 2, 10.0, 0.0, 0.0)])
    estimated = contact_table([(0, 1, 0, 0, 2, 11.0), (1, 1, 0, 0, 2)])
    found = force_figures(contact_samples(truth, estimated))
    assert found["normal_given_percent"] == 50
    assert found["shear_given_percent"] == 0
    assert found["normal_median_percent"] == pytest.approx(10)
    assert np.isnan(found["shear_median_N"])


# separation


def two(contact_table: Table, distance: float, weaker_N: float = 1.0, frame: int = 0) -> ContactRows:
    return contact_table([(frame, 1, -distance / 2, 0, 2.0, 1.0), (frame, 2, distance / 2, 0, 2.0, weaker_N)])


def test_two_contacts_are_resolved_by_two_estimates_and_not_by_one(contact_table: Table) -> None:
    truth = two(contact_table, 10.0)
    apart = contact_table([(0, 1, -4.5, 0, 2.0), (0, 2, 5.5, 0, 2.0)])
    merged = contact_table([(0, 1, 0.0, 0, 2.0)])
    assert separation_samples(truth, apart).is_resolved.tolist() == [True]
    assert separation_samples(truth, merged).is_resolved.tolist() == [False]
    assert separation_samples(truth, apart).distance_mm == pytest.approx([10.0])


def test_scattered_estimates_do_not_resolve_contacts(contact_table: Table) -> None:
    truth = two(contact_table, 10.0)
    strewn = contact_table([(0, n, x, 0, 2.0) for n, x in enumerate((-5.0, 0.0, 5.0))])
    far_ghost = contact_table([(0, n, x, 0, 2.0) for n, x in enumerate((-5.0, 5.0, 40.0))])
    assert separation_samples(truth, strewn).is_resolved.tolist() == [False]
    assert separation_samples(truth, far_ghost).is_resolved.tolist() == [True]


def test_near_contacts_need_estimates_nearer_than_half_their_distance(contact_table: Table) -> None:
    truth = two(contact_table, 4.0)
    both_right = contact_table([(0, 1, 2.0, 0, 2.0), (0, 2, 0.8, 0.0, 2.0)])
    assert separation_samples(truth, both_right).is_resolved.tolist() == [False]


def test_the_curve_counts_classes_and_holds_from_where_it_stays_high(contact_table: Table) -> None:
    apart = {6.0: 0.0, 8.0: 1.0, 10.0: 0.5, 12.0: 0.9, 14.0: 1.0}
    truths, found, frame = [], [], 0
    for distance, share in apart.items():
        for number in range(10):
            both = [(frame, 1, -distance / 2, 0, 2.0, 1.0), (frame, 2, distance / 2, 0, 2.0, 1.0)]
            truths += both
            found += both if number < 10 * share else [(frame, 1, 0.0, 0.0, 2.0, 1.0)]
            frame += 1
    curve = separation_curve(separation_samples(contact_table(truths), contact_table(found)), 1.0)
    assert curve.distance_mm == pytest.approx(tuple(apart))
    assert curve.share == pytest.approx(tuple(apart.values()))
    assert curve.frames == (10,) * 5
    assert curve.from_mm == 12.0
    blind = separation_curve(separation_samples(contact_table(truths), contact_table([])), 1.0)
    assert np.isnan(blind.from_mm)


def test_pairs_are_sorted_by_force_ratio(contact_table: Table) -> None:
    truth = two(contact_table, 10.0, weaker_N=0.31)
    samples = separation_samples(truth, truth)
    assert separation_curve(samples, 0.3).frames == (1,)
    assert separation_curve(samples, 1.0).frames == ()


def test_one_or_three_contacts_are_no_pair(contact_table: Table) -> None:
    three = contact_table([(0, n, 10.0 * n, 0, 2.0, 1.0) for n in range(3)])
    assert len(separation_samples(three, three).is_resolved) == 0


# latency


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


# uncertainty


def test_right_deviations_are_calibrated() -> None:
    chance = np.random.default_rng(2)
    std = chance.uniform(0.1, 2.0, 20000)
    found = uncertainty_calibration(std * chance.standard_normal(20000), std)
    assert found is not None
    assert found.chi2_per_dof == pytest.approx(1, abs=0.05)
    assert found.spread == pytest.approx(1, abs=0.03)
    assert found.coverage_68 == pytest.approx(0.68, abs=0.015)
    assert found.coverage_95 == pytest.approx(0.95, abs=0.01)
    assert found.coverage == pytest.approx(found.levels, abs=0.02)
    assert found.observed == pytest.approx(found.predicted, rel=0.1)


def test_deviations_of_half_the_error_are_overconfident() -> None:
    error = np.random.default_rng(3).standard_normal(20000)
    found = uncertainty_calibration(error, np.full(20000, 0.5))
    assert found is not None
    assert found.chi2_per_dof == pytest.approx(4, rel=0.05)
    assert found.spread == pytest.approx(2, rel=0.05)
    assert found.coverage_68 == pytest.approx(0.38, abs=0.02)  # P(|z| < 0.497)
    assert found.coverage_95 == pytest.approx(0.673, abs=0.02)  # P(|z| < 0.98)


def test_deviations_that_are_not_given_or_zero_do_not_count() -> None:
    std = np.ones(100)
    std[:10], std[10:20] = np.nan, 0.0
    found = uncertainty_calibration(np.ones(100), std)
    assert found is not None
    assert found.count == 80
    assert found.given == pytest.approx(0.8)
    assert uncertainty_calibration(np.ones(19), np.ones(19)) is None
    assert uncertainty_calibration(np.ones(100), np.full(100, np.nan)) is None
