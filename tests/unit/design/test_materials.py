"""The stiffness of materials."""

import pytest

from manytouch.design.materials import MATERIALS, young_of_hardness_MPa


def test_stiffness_follows_from_hardness():
    assert young_of_hardness_MPa(60.0) == pytest.approx(3.6, rel=0.02)
    stiffness = [item.young_MPa for item in MATERIALS]
    assert stiffness == sorted(stiffness)
