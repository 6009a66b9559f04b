"""Equations 2 to 4: the stand-off of the camera."""

import math

import pytest

from manytouch.design.stand_off import focal_px, stand_off, vfov_rad


def test_the_stand_off_is_the_greatest_of_three():
    angles = {"hfov_rad": math.radians(90.0), "vfov_rad": math.radians(60.0)}
    wide = stand_off(view_mm=(200.0, 50.0), least_focus_mm=30.0, **angles)
    assert (wide.distance_mm, wide.limit) == (pytest.approx(100.0), "width")
    high = stand_off(view_mm=(20.0, 100.0), least_focus_mm=30.0, **angles)
    assert (high.distance_mm, high.limit) == (pytest.approx(50.0 * math.sqrt(3.0)), "height")
    near = stand_off(view_mm=(20.0, 10.0), least_focus_mm=30.0, **angles)
    assert (near.distance_mm, near.limit) == (30.0, "focus")


def test_fields_of_view_belong_to_square_pixels():
    assert focal_px(2000, math.radians(90.0)) == pytest.approx(1000.0)
    assert vfov_rad(2000, 1000, math.radians(90.0)) == pytest.approx(2 * math.atan(0.5))
