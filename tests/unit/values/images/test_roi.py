"""A region of interest is valid once it exists."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from manytouch.errors import SourceError
from manytouch.values import Roi

SIZES = st.integers(1, 5000)
PLACES = st.integers(0, 5000)


@given(PLACES, PLACES, SIZES, SIZES)
def test_a_region_unpacks_to_its_numbers_and_fits_the_smallest_image_around_it(
    x: int, y: int, width: int, height: int
) -> None:
    region = Roi(x, y, width, height)
    assert tuple(region) == (x, y, width, height)
    assert str(region) == f"{x},{y},{width},{height}"
    region.require_inside(x + width, y + height, "the input")
    for size in ((x + width - 1, y + height), (x + width, y + height - 1)):
        with pytest.raises(SourceError, match=f"has {size[0]} x {size[1]}"):
            region.require_inside(*size, "the input")


@pytest.mark.parametrize("numbers", [(-1, 0, 10, 10), (0, -1, 10, 10), (0, 0, 0, 10), (0, 0, 10, 0)])
def test_an_empty_or_negative_region_is_refused(numbers: tuple[int, int, int, int]) -> None:
    with pytest.raises(SourceError, match=",".join(map(str, numbers))):
        Roi(*numbers)
