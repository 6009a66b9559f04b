"""How many frames have a force that differs from 0, in summary.json and on the terminal."""

from dataclasses import replace

import numpy as np
import pytest

from bonded_pad import pad_sensor
from manytouch.sinks.clear_forces import ClearForceCount, is_clear


@pytest.fixture
def pressing(contact_of):
    """A contact with a normal force and its standard deviation."""

    def made(force_N, std_N, number=1):
        covariance = np.full((8, 8), np.nan)
        covariance[5, 5] = std_N**2
        contact = contact_of(number, force_N=np.array([0.0, 0.0, -force_N]), covariance=covariance)
        assert contact.std("normal_force") == pytest.approx(std_N)
        return contact

    return made


def test_a_value_is_clear_beyond_two_deviations():
    assert is_clear(2.1, 1.0)
    assert is_clear(-2.1, 1.0)
    assert not is_clear(1.9, 1.0)
    assert is_clear(0.1, np.nan)


def test_frames_are_counted_and_not_contacts(pressing, contact_of):
    counts = ClearForceCount()
    counts.add(())
    counts.add((contact_of(),))  # its force is not known
    assert counts.to_dict() is None
    assert counts.sentence() is None
    counts.add((pressing(3.0, 1.0), pressing(1.0, 0.2, 2)))
    counts.add((pressing(15.1, 6.6),))
    counts.add((pressing(19.0, 40.0),))
    assert counts.to_dict() == {
        "frames": 3,
        "frames_beyond_two_deviations": 2,
        "largest_N": 15.1,
        "largest_std_N": 6.6,
    }
    assert counts.sentence() == (
        "forces: 2 of 3 frames with contacts have one beyond two deviations; largest such 15.1 ± 6.6 N"
    )
    assert not counts.warnings(pad_sensor())


def test_forces_of_which_none_differs_from_0_are_a_warning_with_a_remedy(pressing):
    counts = ClearForceCount()
    counts.add((pressing(19.0, 40.0),))
    assert counts.to_dict() == {
        "frames": 1,
        "frames_beyond_two_deviations": 0,
        "largest_N": None,
        "largest_std_N": None,
    }
    assert counts.sentence() == "forces: 0 of 1 frame with contacts has one beyond two deviations"
    (sentence,) = counts.warnings(pad_sensor())
    assert "calibrate sheet" in sentence
    assert "narrower foot" in sentence
    (nominal,) = counts.warnings(replace(pad_sensor(), provenance={"nominal": True}))
    assert "calibrate rest, then calibrate sheet" in nominal
