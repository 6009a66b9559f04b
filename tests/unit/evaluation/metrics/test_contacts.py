"""Contacts, and errors of their forces, where the right answer is known by hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows, EvaluatedRecording
from manytouch.evaluation.metrics.contacts import contact_figures, contact_samples, force_figures
from manytouch.evaluation.metrics.depth import depth_figures, depth_samples

Sheet = Callable[..., EvaluatedRecording]
Table = Callable[..., ContactRows]


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
