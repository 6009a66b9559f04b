"""Which forces determine a modulus, and which moduli cause a warning."""

import numpy as np
import pytest

from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.modulus_check import modulus_warnings, require_determined
from manytouch.errors import SensorError
from manytouch.values import Sheet

PRESSES = [
    KnownPress(
        name=f"press {number}",
        place_mm=np.zeros(2),
        radius_mm=2.0,
        displacement_px=np.zeros((9, 2)),
        is_seen=np.ones(9, dtype=bool),
        noise_px=0.02,
    )
    for number in (1, 2, 3)
]
CLOSE, FAR = np.array([0.1, -0.1, np.nan]), np.array([0.2, 4.0, -0.6])
GEL = Sheet(size_mm=np.array([25.0, 21.0]), thickness_mm=4.0, young_MPa=0.4, young_std_MPa=0.12)


def test_a_modulus_is_refused_if_neither_it_nor_the_forces_are_known() -> None:
    with pytest.raises(SensorError, match=r"0\.03 ± 0\.04 MPa.*234 % \(RMS\).*press 2 \(\+400 %\)"):
        require_determined(PRESSES, 0.03, 0.04, FAR)
    require_determined(PRESSES, 0.03, 0.014, FAR)  # certain enough
    require_determined(PRESSES, 0.03, 0.04, CLOSE)  # with pretension or bending, but forces are known
    require_determined(PRESSES, 0.03, 0.04, np.full(3, np.nan))  # a single force


def test_forces_that_contradict_each_other_are_a_warning() -> None:
    (sentence,) = modulus_warnings(GEL, 0.4, 0.1, FAR)
    assert "234 % (RMS)" in sentence
    assert not modulus_warnings(GEL, 0.4, 0.1, CLOSE)


def test_a_modulus_far_from_the_stated_one_is_a_warning_in_both_directions() -> None:
    for factor, is_far in ((0.3, True), (0.5, False), (2.0, False), (3.3, True)):
        found = modulus_warnings(GEL, 0.4 * factor, 0.04 * factor, CLOSE)
        assert bool(found) == is_far, factor
    assert not modulus_warnings(GEL, None, None, np.full(3, np.nan))
