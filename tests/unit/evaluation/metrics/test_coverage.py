"""Shares within intervals, from one sample of each contact."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import comb

from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows
from manytouch.evaluation.metrics.contacts import contact_figures, contact_samples, region_figures
from manytouch.evaluation.metrics.coverage import coverage_of, coverages

Table = Callable[..., ContactRows]


def test_right_deviations_are_within_the_band_and_narrow_ones_are_not() -> None:
    error = np.random.default_rng(3).standard_normal(400)
    right = coverage_of(error, np.ones(400))
    assert right is not None
    assert right.is_right
    assert right.coverage_50 == pytest.approx(0.5, abs=0.07)
    assert right.coverage_90 == pytest.approx(0.9, abs=0.04)
    assert right.chi2_per_dof == pytest.approx(1.0, abs=0.2)
    for factor in (0.5, 2.0):
        wrong = coverage_of(error, np.full(400, factor))
        assert wrong is not None
        assert not wrong.is_right


@pytest.mark.parametrize("contacts", [5, 20, 137])
def test_the_band_is_that_of_the_binomial_distribution(contacts: int) -> None:
    found = coverage_of(np.zeros(contacts), np.ones(contacts))
    assert found is not None
    low, high = (round(bound * contacts) for bound in (found.low_95, found.high_95))
    number = np.arange(contacts + 1)
    probability = comb(contacts, number) * 0.95**number * 0.05 ** (contacts - number)
    assert probability[:low].sum() < 0.005 <= probability[: low + 1].sum()
    assert probability[:high].sum() < 0.995 <= probability[: high + 1].sum() + 1e-12


def test_two_components_of_a_contact_are_one_sample() -> None:
    error = np.zeros(40)
    one, two = coverage_of(error, np.ones(40)), coverage_of(error, np.ones(40), components=2)
    assert one is not None
    assert two is not None
    assert (one.contacts, two.contacts) == (40, 20)
    assert two.high_95 - two.low_95 > one.high_95 - one.low_95
    assert coverage_of(np.zeros(4), np.ones(4)) is None


def test_the_last_frame_of_each_contact_counts(contact_table: Table) -> None:
    true = [(frame, contact, 20.0 * contact, 0.0, 1.0, 1.0) for frame in range(3) for contact in range(6)]
    given = [(f, c, x, y, d, n + (9.0 if f < 2 else 0.1)) for f, c, x, y, d, n in true]
    samples = contact_samples(contact_table(true), contact_table(given, force_std=0.2))
    assert samples.is_last.sum() == 6
    found = coverages(samples)["force"]
    assert found is not None
    assert (found.contacts, found.coverage_50, found.chi2_per_dof) == (6, 1.0, pytest.approx(0.25))


def test_faint_contacts_have_figures_of_their_own(contact_table: Table) -> None:
    truth = contact_table([(0, 1, 0.0, 0.0, 0.2), (0, 2, 20.0, 0.0, 0.4), (0, 3, 40.0, 0.0, 0.1)])
    estimated = contact_table([(0, 1, 0.0, 0.0, 0.19), (0, 3, 40.0, 0.0, 0.1)])
    found = contact_figures(contact_samples(truth, estimated))
    assert found["faint_recall_percent"] == pytest.approx(50.0)
    assert found["faint_depth_bias_percent"] == pytest.approx(-5.0)
    assert found["recall_percent"] == 0.0


def test_areas_are_compared_where_the_true_pressure_was_read_out(contact_table: Table) -> None:
    one = [(0, 1, 0.0, 0.0, 2.0)]
    estimated = contact_table(one, area=120.0, half_major=6.6, half_minor=4.0, orientation=-1.5)
    truth = contact_table(one, area=100.0, half_major=6.0, half_minor=4.0, orientation=1.55)
    found = region_figures(contact_samples(truth, estimated))
    assert found["area_median_percent"] == pytest.approx(20.0)
    assert found["half_major_median_percent"] == pytest.approx(10.0)
    assert found["angle_median_deg"] == pytest.approx(np.rad2deg(np.pi - 3.05))
    touched = contact_table(one, area=100.0)  # the area that touches, of a file without regions
    assert np.isnan(region_figures(contact_samples(touched, estimated))["area_median_percent"])
