"""Markers that are not back at rest at the end of a recording."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.sinks.files.rest.end_shift import END_FRAMES, MIN_FRAMES, EndShift
from manytouch.values import Status


@pytest.mark.parametrize(
    ("case", "is_odd"),
    [((6.0, False), True), ((6.0, True), False), ((0.1, False), False)],
)
def test_markers_that_do_not_come_back_are_a_warning(sensor, reading_of, contact_of, case, is_odd):
    shift_px, is_touched = case
    end = EndShift(sensor)
    generator = np.random.default_rng(5)
    for index in range(80):
        touching = (contact_of(1),) if 20 <= index < 40 or (index >= 40 and is_touched) else ()
        reading = reading_of(index, touching, shift_px=(shift_px if index >= 40 else 0.0, 0.0))
        noisy_px = reading.grid.position_px + generator.normal(0.0, 0.05, reading.grid.position_px.shape)
        end.add(replace(reading, grid=replace(reading.grid, position_px=noisy_px)))
    found = end.warnings(0.05)
    assert len(found) == is_odd
    for sentence in found:
        assert "from their rest positions at the end" in sentence
        assert f"{shift_px:.1f} px" in sentence
        assert "the sensor or the camera has moved, or something still touches" in sentence


def test_a_contact_begins_the_end_again_and_a_bad_frame_does_not(sensor, reading_of, contact_of):
    def warns(ending):
        end = EndShift(sensor)
        for index in range(MIN_FRAMES):
            end.add(reading_of(index))
        for reading in ending:
            end.add(reading)
        return bool(end.warnings(0.05))

    moved = [reading_of(100 + index, shift_px=(6.0, 0.0)) for index in range(END_FRAMES)]
    bad = reading_of(200, shift_px=(0.0, 0.0), status=Status.BLURRED)
    assert warns([*moved, bad])
    assert not warns([*moved, reading_of(200, (contact_of(1),))])
    assert not warns([*moved[1:], reading_of(200, (contact_of(1),)), *moved[1:]])
