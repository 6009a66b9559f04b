"""The sheet that a calibration at rest starts from."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.calibration.untouched import stated_sheet
from manytouch.errors import SensorError
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Sheet

SENSOR = demo_sensor()
PAD = Sheet(size_mm=np.array([20.0, 16.0]), thickness_mm=4.0, boundary="bonded", marker_depth_mm=1.0)


def test_a_size_without_a_thickness_is_refused_and_not_dropped() -> None:
    with pytest.raises(SensorError, match="90 x 70 mm, is given without its thickness"):
        stated_sheet(SENSOR, (90.0, 70.0), None)


def test_a_sheet_is_that_of_the_file_or_wholly_given() -> None:
    assert stated_sheet(SENSOR, None, None) is None
    assert stated_sheet(SENSOR, None, 2.0) is None
    given = stated_sheet(SENSOR, (90.0, 70.0), 2.0)
    assert given is not None
    assert (given.boundary, given.size_mm.tolist(), given.thickness_mm) == ("clamped", [90.0, 70.0], 2.0)


def test_each_of_size_and_thickness_replaces_that_of_a_pad() -> None:
    known = replace(SENSOR, sheet=PAD)
    wide, thin = stated_sheet(known, (25.0, 16.0), None), stated_sheet(known, None, 3.0)
    assert wide is not None
    assert thin is not None
    assert (wide.size_mm.tolist(), wide.thickness_mm, wide.marker_depth_mm) == ([25.0, 16.0], 4.0, 1.0)
    assert (thin.size_mm.tolist(), thin.thickness_mm, thin.marker_depth_mm) == ([20.0, 16.0], 3.0, 1.0)
