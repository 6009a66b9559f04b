"""Sensors of the group `pads_calibrated`: their presses ship, and the calibration finds the modulus."""

import pytest

from manytouch.evaluation.suite.calibrated.pad_sensor import (
    PLACES,
    calibrated_pad,
    calibration_presses,
    drawn_pad,
)
from manytouch.evaluation.suite.given import given_sensor
from manytouch.evaluation.suite.pads.cases import PADS
from manytouch.evaluation.suite.pads.recording import pad_states
from manytouch.evaluation.suite.suite import cases


@pytest.mark.parametrize("pad", PADS)
def test_the_presses_of_each_pad_ship_and_are_held_at_three_forces(pad: str) -> None:
    found = calibration_presses(pad)
    assert len(found) == len(PLACES)
    for case in found:
        forces_N = [face.contacts[0].normal_force_N for _, face in pad_states(case)]
        assert len(forces_N) == 3
        assert 0.0 < forces_N[0] < forces_N[1] < forces_N[2]
        assert case.deepest_mm <= 0.25 * case.thickness_mm + 0.005


def test_nominal_files_differ_from_the_truth_and_state_it() -> None:
    """Of seven pads with four numbers each, most errors are within two deviations, and not all within one."""
    stds = []
    for pad in PADS:
        case = calibration_presses(pad)[0]
        sheet = drawn_pad(case).sheet
        assert sheet is not None
        for name, std in (
            ("young_MPa", sheet.young_std_MPa),
            ("thickness_mm", sheet.thickness_std_mm),
            ("poisson", sheet.poisson_std),
            ("marker_depth_mm", sheet.marker_depth_std_mm),
        ):
            assert std is not None
            stds.append(abs(getattr(sheet, name) - getattr(case, name)) / std)
    assert sum(each > 1.0 for each in stds) >= 3
    assert sum(each < 2.0 for each in stds) >= 0.85 * len(stds)


@pytest.mark.slow
@pytest.mark.parametrize("pad", ["gel", "thin", "stiff"])
def test_a_calibration_finds_the_modulus_of_the_solids(pad: str) -> None:
    """The files that it begins with are wrong by up to 45 % of E."""
    true = float(str(PADS[pad]["young_MPa"]))
    sensor = calibrated_pad(pad)
    found = sensor.sheet
    assert found is not None
    assert found.young_MPa == pytest.approx(true, rel=0.15)
    assert found.young_std_MPa is not None
    assert abs(found.young_MPa - true) < 2.0 * found.young_std_MPa
    assert found.young_std_MPa < 0.15 * true
    of_it = [case for case in cases(("pads_calibrated",)) if getattr(case, "pad", "") == pad]
    assert of_it
    assert given_sensor(of_it[0]) is sensor
