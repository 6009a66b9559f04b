"""Words for numbers in messages and in the text of values."""

import math

MOST_DIGITS = 6


def count_of(count: int, noun: str) -> str:
    """A count with its noun, such as "1 contact" or "2 contacts"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def with_std(value: float, std: float, digits: int = 2, unknown: str = "–") -> str:
    """A number with its standard deviation, if that is known.

    It has more decimals than `digits` where the deviation, or without one the number, would be shown as zero.

    Args:
        value: the number.
        std: of it; NaN if it is not known.
        digits: least number of decimals.
        unknown: instead of a number that is not finite.
    """
    if not math.isfinite(value):
        return unknown
    smallest = std if math.isfinite(std) else abs(value)
    while smallest > 0.0 and digits < MOST_DIGITS and float(f"{smallest:.{digits}f}") == 0.0:
        digits += 1
    return f"{value:.{digits}f}" + (f" ± {std:.{digits}f}" if math.isfinite(std) else "")
