"""A small design that the tests of its parts share."""

import pytest

from manytouch.design.choose import design_sensor
from manytouch.design.requirements import Requirements


@pytest.fixture(scope="session")
def found():
    return design_sensor(Requirements(area_mm=(40.0, 25.0), thickness_mm=3.0, force_N=(0.1, 5.0)))
