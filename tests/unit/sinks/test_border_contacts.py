"""Contacts along the border of a view that may show only a part of the sheet."""

from dataclasses import replace

import numpy as np
import pytest

from flat_spline import FLAT
from layouts import lattice_layout
from manytouch.sinks.border_contacts import BorderContacts
from manytouch.values.sensor_file.assumed_sheet import assumed_sheet

AT_BORDER, INSIDE = ([34.0, 2.0], [-3.0, 21.0]), ([10.0, 4.0], [-12.0, -8.0])


@pytest.fixture
def counted(sensor, reading_of, contact_of):
    """The warnings after frames with contacts at these places."""

    def made(frames, columns=16, is_assumed=True, spline=FLAT):
        layout = lattice_layout(12, columns, (5.0, 4.0), radius_mm=0.8, polarity="dark", missing=[])
        sheet = replace(assumed_sheet(layout), is_assumed=is_assumed)
        seen = replace(sensor, layout=layout, sheet=sheet)
        counts = BorderContacts(seen)
        for places in frames:
            touching = tuple(contact_of(k, centre_mm=np.array(each)) for k, each in enumerate(places))
            reading = reading_of(0, touching, sensor=seen)
            counts.add(replace(reading, surface=replace(reading.surface, spline=spline)))
        return counts.warnings()

    return made


def test_several_contacts_along_the_border_in_many_frames_are_a_warning(counted):
    frames = [(), AT_BORDER, INSIDE, INSIDE]
    (sentence,) = counted(frames)
    assert sentence.startswith("1 of 3 frames with contacts have several along the border of the dots.")
    assert "--method perimeter" in sentence
    assert not counted([*frames, INSIDE])
    assert not counted([AT_BORDER[:1], AT_BORDER[1:]])
    assert not counted([()])


def test_only_assumed_sheets_that_describe_a_frame_count(counted):
    assert counted([AT_BORDER])
    assert not counted([AT_BORDER], is_assumed=False)
    assert not counted([AT_BORDER], spline=None)
    assert not counted([AT_BORDER], columns=5)
