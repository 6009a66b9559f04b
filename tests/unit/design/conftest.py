"""A small design that the tests of its parts share, and deflections that are computed once."""

from collections.abc import Iterator
from functools import cache

import pytest

from manytouch.design import choose
from manytouch.design.choose import design_sensor
from manytouch.design.deflection import deflection_curve
from manytouch.design.requirements import Requirements


@pytest.fixture(scope="session", autouse=True)
def curves() -> Iterator[None]:
    """Requirements of the same sheets share their curves, which are values."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choose, "deflection_curve", cache(deflection_curve))
        yield


@pytest.fixture(scope="session")
def found():
    return design_sensor(Requirements(area_mm=(40.0, 25.0), thickness_mm=3.0, force_N=(0.1, 5.0)))
