"""Bill of materials and assembly guide."""

from dataclasses import replace

from manytouch.design.parts.casing import (
    CasingChoices,
)
from manytouch.design.parts.guide import screw_length_mm

CHOICES = CasingChoices()


def test_the_screw_reaches_the_nut(found):
    assert screw_length_mm(found, CHOICES) == 12
    assert screw_length_mm(found, replace(CHOICES, clamp_mm=6.0)) == 16
