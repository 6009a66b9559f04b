"""Numbers with their standard deviations, as people read them."""

import math

import pytest

from manytouch.values.display.text import with_std


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (4.267, 0.7, "4.27 ± 0.70"),
        (0.01250, 0.0075, "0.01 ± 0.01"),
        (0.01230, 0.0030, "0.012 ± 0.003"),
        (0.00813, 0.00077, "0.008 ± 0.001"),
        (0.00813, 1e-12, "0.008130 ± 0.000000"),
        (1.0, 0.0, "1.00 ± 0.00"),
        (0.74, math.nan, "0.74"),
        (-0.0004, math.nan, "-0.0004"),
        (0.0, math.nan, "0.00"),
        (math.nan, 0.1, "–"),
    ],
)
def test_a_deviation_is_not_shown_as_zero(value: float, std: float, text: str) -> None:
    assert with_std(value, std) == text


def test_more_digits_and_another_word_for_what_is_not_known() -> None:
    assert with_std(1.5, 0.2, 3) == "1.500 ± 0.200"
    assert with_std(math.inf, 0.2, unknown="unknown") == "unknown"
