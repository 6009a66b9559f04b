"""The type checks of the tests: which calls of a function they check."""

import csv
import os
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from beartype.roar import BeartypeCallHintViolation
from jaxtyping import Float64, TypeCheckError

import type_checks
from manytouch.tracking import MarkerTracker
from manytouch.values import Surface
from manytouch.values.display.text import count_of
from manytouch.values.images.grey_levels import level_scale


@pytest.fixture(autouse=True)
def another_test() -> Iterator[None]:
    type_checks.begin_test()
    yield
    type_checks.begin_test()


def doubled(value: int) -> int:
    return 2 * value


def accepted(function, calls: int) -> list[int]:
    """Numbers, from 1, of those calls with a wrong type that are not refused."""
    found = []
    for number in range(1, calls + 1):
        try:
            function("a")
        except BeartypeCallHintViolation:
            pass
        else:
            found.append(number)
    return found


def test_the_first_calls_of_a_test_are_checked_and_then_a_sample():
    checked = type_checks.check(doubled)
    assert checked(2) == 4
    # one call came before
    unchecked = [call for call in range(type_checks.FIRST_CALLS + 1, 300) if call % type_checks.EVERY]
    assert accepted(checked, 298) == [call - 1 for call in unchecked]


def test_each_test_and_each_function_begins_again():
    one, other = type_checks.check(doubled), type_checks.check(doubled)
    first = type_checks.FIRST_CALLS
    assert accepted(one, first + 1) == [first + 1]
    assert accepted(other, first) == []
    type_checks.begin_test()
    again = type_checks.FIRST_CALLS_AGAIN
    assert accepted(one, first) == list(range(again + 1, first + 1))
    type_checks.begin_test()
    assert accepted(one, first) == list(range(again + 1, first + 1))


def test_a_function_that_few_calls_have_checked_is_checked_as_often_as_at_first():
    checked, first = type_checks.check(doubled), type_checks.FIRST_CALLS
    assert accepted(checked, first - 1) == []
    type_checks.begin_test()
    assert accepted(checked, first) == []


def test_a_wrong_result_is_refused_too():
    def half(value: int) -> int:
        return value / 2

    with pytest.raises(BeartypeCallHintViolation, match="half"):
        type_checks.check(half)(3)


def test_a_type_that_only_mypy_knows_is_left_out_and_the_others_are_checked():
    def length(values: "csv.DictReader[str]", number: int) -> int:  # a generic class from Python 3.12 on
        return len(list(values)) + number

    checked, rows = type_checks.check(length), csv.DictReader(["a,b"])
    assert checked(rows, 3) == 3
    # Python 3.12 evaluates all annotations, so that beartype checks them without jaxtyping
    expected = BeartypeCallHintViolation if sys.version_info >= (3, 12) else TypeCheckError
    with pytest.raises(expected, match="number"):
        checked(rows, "a")


def test_the_name_of_a_dimension_has_one_value_in_a_call_and_its_result():
    def total(one: Float64[np.ndarray, " n"], other: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        return np.concatenate([one, other])[: 3 if other[0] else None]

    checked, three = type_checks.check(total), np.arange(1.0, 4.0)
    assert len(checked(three, three)) == 3
    assert len(checked(np.ones(3), three)) == 3
    with pytest.raises(BeartypeCallHintViolation, match="other"):
        checked(three, np.ones(2))
    with pytest.raises(BeartypeCallHintViolation, match="return"):
        checked(three, np.zeros(3))


@pytest.mark.skipif("CHECK_TYPES" not in os.environ, reason="make test checks types, this run does not")
def test_functions_methods_and_dataclasses_of_the_package_are_checked():
    square = np.eye(3)
    with pytest.raises(BeartypeCallHintViolation, match="count_of"):
        count_of("two", "dots")
    with pytest.raises(BeartypeCallHintViolation, match="level_scale"):
        level_scale([[1.0]])
    with pytest.raises(BeartypeCallHintViolation, match="start"):
        MarkerTracker().start("sensor")
    with pytest.raises(BeartypeCallHintViolation, match="__init__"):
        Surface(position_mm=square[0], displacement_mm=square, covariance_mm2=np.zeros((3, 3, 3)))


def test_a_generator_has_dimensions_of_its_own():
    def rows(values: Float64[np.ndarray, " n"]) -> Iterator[float]:
        yield from values

    checked_rows = type_checks.check(rows)

    def summed(values: Float64[np.ndarray, " n"]) -> float:
        return sum(checked_rows(values[:2]))

    assert type_checks.check(summed)(np.ones(3)) == 2.0
    with pytest.raises(BeartypeCallHintViolation, match="rows"):
        next(checked_rows(np.ones(3, dtype=int)))
