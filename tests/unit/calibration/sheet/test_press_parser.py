"""Presses typed by a user: they are parsed, and errors are reported."""

import numpy as np
import pytest

from manytouch.calibration.sheet.press_parser import PressContext, parse_press
from manytouch.errors import SensorError
from manytouch.values import Sheet

SHEET = Sheet(size_mm=np.array([80.0, 60.0]), thickness_mm=2.0)
FILM = PressContext(input="presses.mp4", begin_s=0.0, end_s=12.0, sheet=SHEET)
CAMERA = PressContext(input="presses-1", begin_s=None, end_s=None, sheet=SHEET)


@pytest.mark.parametrize(
    ("text", "place", "force_N", "time_s", "radius_mm"),
    [
        ("18,-12 50 g 3.4 s", (18.0, -12.0), 0.05 * 9.81, 3.4, 2.0),
        ("18 -12 0.49N 3.2-3.8s", (18.0, -12.0), 0.49, 3.5, 2.0),
        (" -.5 ; +7.25  at 3 s with 490 mN, radius 5mm", (-0.5, 7.25), 0.49, 3.0, 5.0),
        ("0,0 3s", (0.0, 0.0), None, 3.0, 2.0),
        ("18mm, 12mm 0.1kg 12 s", (18.0, 12.0), 0.981, 12.0, 2.0),
    ],
)
def test_words_become_a_press(text, place, force_N, time_s, radius_mm):
    row = parse_press(text, 3, FILM)
    assert (row.line, row.input) == (3, "presses.mp4")
    assert (row.x_mm, row.y_mm, row.radius_mm) == (*place, radius_mm)
    assert row.force_N == (None if force_N is None else pytest.approx(force_N))
    assert row.time_s == pytest.approx(time_s)


def test_before_a_camera_no_time_is_needed():
    assert parse_press("18,-12 50 g", 1, CAMERA).time_s is None
    with pytest.raises(SensorError, match="no time is needed: the image is captured when you press Enter"):
        parse_press("18,-12 50 g 3 s", 1, CAMERA)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "start with the place x,y in mm from the centre of the sheet, such as 18,-12 50 g"),
        ("50 g 3 s", "start with the place"),
        ("18,3.4s", "start with the place"),
        ("18,-12 50 3 s", "50 has no unit: N, mN, g or kg for the force, s for the time, mm for the radius"),
        ("40,-12 50 g 3 s", r"x = 40 mm lies outside the sheet, which extends from -40 to 40 mm"),
        ("18,-31 50 g 3 s", r"y = -31 mm lies outside the sheet, which extends from -30 to 30 mm"),
        ("18,-12 50 g", r"the time is missing: add the time in presses.mp4, such as 3.4 s or 3.2-3.8 s"),
        ("18,-12 50 g 13 s", "13 s lies outside presses.mp4, which lasts from 0.0 to 12.0 s"),
        ("18,-12 50 g 11-13 s", "11-13 s reaches outside presses.mp4, which lasts from 0.0 to 12.0 s"),
        ("18,-12 50 g 3.8-3.2 s", "a time span must start before it ends: enter 3.2-3.8 s"),
        ("18,-12 0 g 3 s", "a force must be positive"),
        ("18,-12 -2 N 3 s", "a force must be positive"),
        ("18,-12 1-2 N 3 s", "a force must be one number, not a range"),
        ("18,-12 50 g 3 s radius 0 mm", "a radius must be positive"),
        ("18,-12 50 g 1 N 3 s", "2 forces are given, one is enough"),
        (
            "18,-12 50 lb 3 s",
            "50 has no unit: .*; 'lb' is not understood: enter a press as 18,-12 50 g 3.4 s",
        ),
        (
            "50,50 7 foo",
            r"x = 50 .*; y = 50 .*; 7 has no unit.*; 'foo' is not understood.*; the time is missing",
        ),
    ],
)
def test_a_wrong_line_is_refused_with_the_reason(text, sentence):
    with pytest.raises(SensorError, match=sentence):
        parse_press(text, 1, FILM)
