"""The noise of markers at rest."""

import numpy as np
import pytest

from manytouch.sinks.files.rest.rest_noise import RestNoise
from manytouch.values import Status


def noise_of(readings, markers=24):
    noise = RestNoise(markers)
    for reading in readings:
        noise.add(reading)
    return noise.per_marker_px()


def shaken(reading_of, count, sigma_px, **settings):
    chance = np.random.default_rng(3)
    return [reading_of(i, shift_px=tuple(chance.normal(0, sigma_px, 2)), **settings) for i in range(count)]


def test_noise_is_the_deviation_of_one_coordinate(reading_of):
    noise = noise_of(shaken(reading_of, 400, 0.2))
    assert np.isnan(noise[9])  # the missing one
    assert noise[np.arange(24) != 9] == pytest.approx(0.2, rel=0.1)


def test_creep_and_touches_that_were_not_found_are_not_noise(reading_of):
    chance = np.random.default_rng(5)
    at_rest = [tuple(chance.normal(0, 0.1, 2)) for _ in range(300)]
    there = noise_of([reading_of(i, shift_px=shift) for i, shift in enumerate(at_rest)])[0]
    creep = [(0.003 * i + x, y) for i, (x, y) in enumerate(at_rest)]
    touched = [(x + 20 * (100 <= i < 160 and i % 7), y) for i, (x, y) in enumerate(at_rest)]
    for moved in (creep, touched):
        noise = noise_of([reading_of(i, shift_px=shift) for i, shift in enumerate(moved)])[0]
        assert noise == pytest.approx(there, rel=0.2)


def test_noise_does_not_count_that_the_sheet_rests_elsewhere_after_a_press(reading_of, contact_of):
    before = [reading_of(i, shift_px=(0.1 * (i % 3), 0.0)) for i in range(9)]
    press = [reading_of(10, (contact_of(),), shift_px=(30.0, 0.0))]
    after = [reading_of(i, shift_px=(7 + 0.1 * (i % 3), 5.0)) for i in range(11, 17)]
    there = noise_of(before)[0]
    assert there > 0
    assert noise_of(before + press + after)[0] == pytest.approx(there, rel=1e-9)


def test_frames_that_failed_are_no_rest(reading_of):
    failed = [reading_of(i, shift_px=(9.0 * i, 0.0), status=Status.BLURRED) for i in (2, 3, 4)]
    assert np.nanmax(noise_of([reading_of(0), *failed, reading_of(5), reading_of(6), reading_of(7)])) == 0.0
