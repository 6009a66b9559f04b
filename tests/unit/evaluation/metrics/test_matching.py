"""Pairs of truth and estimate."""

from collections.abc import Callable

import numpy as np
import pytest

from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows
from manytouch.evaluation.metrics.matching import assigned, match_contacts, nearest_dots

Table = Callable[..., ContactRows]


def test_as_many_pairs_as_can_be_before_the_least_distance() -> None:
    # greedily 0-0 (1.0) would leave 1 alone
    away = np.array([[1.0, 2.0], [1.5, 9.0], [8.0, 9.0]])
    assert assigned(away, 3.0).tolist() == [[0, 1], [1, 0]]
    # one pair of 0.1 is less than two of 2.9 together, and yet two are more
    assert assigned(np.array([[0.1, 2.9], [2.9, 9.0]]), 3.0).tolist() == [[0, 1], [1, 0]]


def test_the_gate_is_open_below_and_shut_at_its_own_value() -> None:
    away = np.array([[2.999, 50.0], [50.0, 3.0]])
    assert assigned(away, 3.0).tolist() == [[0, 0]]


def test_nan_is_never_near_and_nothing_pairs_with_nothing() -> None:
    assert assigned(np.full((2, 3), np.nan), 3.0).shape == (0, 2)
    assert assigned(np.zeros((0, 3)), 3.0).shape == (0, 2)


def test_the_order_of_rows_does_not_matter() -> None:
    chance = np.random.default_rng(1)
    away = chance.uniform(0, 6, (6, 4))
    turn = chance.permutation(6)
    pairs = {tuple(pair) for pair in assigned(away, 3.0).tolist()}
    turned = {(int(turn[row]), column) for row, column in assigned(away[turn], 3.0).tolist()}
    assert pairs == turned


def test_contacts_pair_within_their_frame_only(contact_table: Table) -> None:
    truth = contact_table([(0, 1, 0.0, 0.0, 2.0), (1, 1, 10.0, 0.0, 2.0)])
    estimated = contact_table([(0, 7, 10.0, 0.0, 2.0), (1, 7, 10.5, 0.0, 2.0)])
    pairs = match_contacts(truth, estimated)
    assert (pairs.true_row.tolist(), pairs.estimated_row.tolist()) == ([1], [1])


def test_a_contact_that_is_not_required_may_be_found(contact_table: Table) -> None:
    truth = contact_table([(0, 1, 0.0, 0.0, 0.1), (0, 2, 20.0, 0.0, 2.0)])
    estimated = contact_table([(0, 5, 0.5, 0.0, 0.2), (0, 6, 20.5, 0.0, 2.0), (0, 7, -30.0, 0.0, 2.0)])
    pairs = match_contacts(truth, estimated)
    assert pairs.is_required.tolist() == [False, True]
    assert pairs.is_counted.tolist() == [False, True, True]
    assert (pairs.true_row.tolist(), pairs.estimated_row.tolist()) == ([1], [1])


def test_an_estimate_may_be_further_off_on_a_large_contact(contact_table: Table) -> None:
    estimated = contact_table([(0, 5, 4.0, 0.0, 2.0)])
    for half_major_mm, found in ((19.0, 0), (21.0, 1)):
        truth = contact_table([(0, 1, 0.0, 0.0, 2.0)], half_major=half_major_mm, half_minor=5.0)
        assert len(match_contacts(truth, estimated).true_row) == found


def test_a_contact_is_split_by_an_estimate_on_it_that_has_no_contact_of_its_own(contact_table: Table) -> None:
    truth = contact_table(
        [(0, 1, 0.0, 0.0, 2.0), (0, 2, 9.0, 0.0, 2.0)], half_major=10.0, half_minor=4.0, orientation=np.pi / 2
    )
    for place, is_split in (
        ((0.0, 11.0), [True, False]),  # on its long axis
        ((-6.0, 0.0), [False, False]),  # outside of its short one
        ((8.0, 2.9), [False, True]),  # nearest to the other
    ):
        estimated = contact_table([(0, 5, 0.1, 0.0, 2.0), (0, 6, 9.0, 0.0, 2.0), (0, 7, *place, 2.0)])
        assert match_contacts(truth, estimated).is_split.tolist() == is_split
    ends = contact_table([(0, 5, 0.0, 8.0, 2.0), (0, 6, 0.0, -8.0, 2.0)])  # a bar found as its two ends
    pairs = match_contacts(truth, ends)
    assert len(pairs.true_row) == 0
    assert pairs.is_split.tolist() == [True, False]
    both = contact_table([(0, 5, 0.1, 0.0, 2.0), (0, 6, 9.0, 0.0, 2.0)])
    assert not match_contacts(truth, both).is_split.any()


def test_of_two_estimates_on_one_dot_the_nearer_is_right() -> None:
    which, away = nearest_dots(
        np.array([[0.0, 0.0], [40.0, 0.0]]), np.array([[3.0, 0.0], [-1.0, 0.0], [41.0, 0.0]]), 10.0
    )
    assert which.tolist() == [-1, 0, 1]
    assert away[1:] == pytest.approx([1.0, 1.0])


def test_an_estimate_beyond_the_gate_stands_for_no_dot() -> None:
    which, _ = nearest_dots(np.array([[0.0, 0.0]]), np.array([[10.5, 0.0]]), 10.0)
    assert which.tolist() == [-1]
    assert nearest_dots(np.zeros((0, 2)), np.array([[1.0, 1.0]]), 10.0)[0].tolist() == [-1]
