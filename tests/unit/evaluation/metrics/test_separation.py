"""Two contacts that are found as two, where the right answer is known by hand."""

from collections.abc import Callable

import numpy as np
import pytest

from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows
from manytouch.evaluation.metrics.separation import separation_curve, separation_samples

Table = Callable[..., ContactRows]


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
