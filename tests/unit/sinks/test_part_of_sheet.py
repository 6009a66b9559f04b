"""Sides at which an assumed sheet goes on beyond the dots."""

from dataclasses import replace

import numpy as np
import pytest

from flat_spline import FLAT
from layouts import lattice_layout
from manytouch.sinks.part_of_sheet import PartOfSheet
from manytouch.values.sensor_file.assumed_sheet import assumed_sheet

LAYOUT = lattice_layout(12, 16, (5.0, 4.0), radius_mm=0.8, polarity="dark", missing=[])


@pytest.fixture
def warnings_of(sensor, reading_of):
    """The warnings after frames whose sheets extend so many pitches beyond the outermost dots."""

    def made(*margins, is_assumed=True):
        seen = replace(sensor, layout=LAYOUT, sheet=replace(assumed_sheet(LAYOUT), is_assumed=is_assumed))
        part = PartOfSheet(seen)
        for margin in margins:
            sheet = assumed_sheet(LAYOUT, np.array(margin))
            spline = replace(FLAT, size_mm=tuple(sheet.size_mm), centre_mm=tuple(sheet.centre_mm))
            reading = reading_of(0, (), sensor=seen)
            part.add(replace(reading, surface=replace(reading.surface, spline=spline)))
        part.add(reading_of(1, (), sensor=seen))
        return part.warnings()

    return made


def test_sides_at_which_the_sheet_goes_on_are_named(warnings_of):
    whole = [[1.0, 1.0], [1.0, 3.0]]
    assert warnings_of(whole) == []
    (sentence,) = warnings_of(whole, [[1.0, 5.0], [1.0, 3.0]])
    assert sentence.startswith("the sheet goes on beyond the right side of the dots, as presses show:")
    (sentence,) = warnings_of([[5.0, 1.0], [1.0, 1.0]], [[5.0, 1.0], [5.0, 5.0]], whole)
    assert sentence.startswith("the sheet goes on beyond the left, upper and lower sides of the dots,")
    assert "--sensor" in sentence


def test_a_stated_sheet_may_extend_far_beyond_its_dots(warnings_of):
    assert warnings_of([[5.0, 5.0], [5.0, 5.0]], is_assumed=False) == []
