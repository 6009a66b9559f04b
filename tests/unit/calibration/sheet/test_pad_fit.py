"""Thickness of a pad and depth of its markers from presses with known forces."""

from dataclasses import replace

import numpy as np
import pytest

from bonded_pad import POISSON, THICKNESS_MM, YOUNG_MPA, pad_sensor
from manytouch.calibration.sheet.describe_calibration import describe
from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.pad import calibrate_pad
from manytouch.calibration.sheet.pad_fit import MODEL_STD, fit_pad
from manytouch.errors import SensorError
from manytouch.estimation import PadEstimator
from manytouch.estimation.pad.contacts.pad_contacts import PadContacts
from manytouch.evaluation.suite.calibrated.pad_sensor import calibration_presses
from manytouch.evaluation.suite.pads.pad_sensors import true_pad
from manytouch.evaluation.suite.pads.recording import pad_states
from manytouch.geometry.refraction import rest_px
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Sensor

DEPTH_MM, NOISE_PX = 0.5, 0.003
EXACT = {"thickness_std_mm": 0.0, "marker_depth_std_mm": 0.0}
LINEAR = PadEstimator(pad_contacts=PadContacts(stiffening=0.0, sticking=0.0, sticking_power=0.0))


def presses(sensor: Sensor) -> list[KnownPress]:
    """Presses of several widths on the pad of `sensor`, as images of its linear model."""
    assert sensor.sheet is not None
    model, found = LINEAR.nominal_pad(sensor), []
    loads = zip((0.5, 0.8, 1.1, 1.4, 1.7), (0.05, 0.10, 0.15, 0.25, 0.35), strict=True)
    for number, (root_mm, force_N) in enumerate(loads):
        place_mm = np.array([-1.3 + 0.9 * number, 0.7 - 0.4 * number])
        parameters = np.array([*place_mm, root_mm, 0.0, root_mm])
        column = LINEAR.fitter.images(model, parameters[None]).column[0]
        moved_px = (force_N / YOUNG_MPA * (column[0] - 0.06 * column[4])).reshape(-1, 2)
        found.append(
            KnownPress(
                name=f"press {number + 1}",
                place_mm=place_mm,
                radius_mm=2.0,
                displacement_px=moved_px
                + np.random.default_rng(number).normal(0.0, NOISE_PX, moved_px.shape),
                is_seen=np.ones(len(moved_px), dtype=bool),
                noise_px=NOISE_PX,
                force_N=force_N,
            )
        )
    return found


@pytest.fixture(scope="module")
def known() -> list[KnownPress]:
    return presses(pad_sensor(thickness_mm=THICKNESS_MM, marker_depth_mm=DEPTH_MM))


def stated(**changed: float) -> Sensor:
    numbers = {"thickness_std_mm": 0.2, "marker_depth_std_mm": 0.1, "poisson_std": 0.0, "young_std_MPa": 0.1}
    return pad_sensor(**(numbers | changed))


def test_the_depth_of_the_markers_is_fitted_and_described(known: list[KnownPress]) -> None:
    found = calibrate_pad(stated(marker_depth_mm=0.7, marker_depth_std_mm=0.2, thickness_std_mm=0.0), known)
    sheet = found.sheet
    assert sheet.marker_depth_std_mm is not None
    assert sheet.marker_depth_mm is not None
    assert abs(sheet.marker_depth_mm - DEPTH_MM) < min(0.08, 2.0 * sheet.marker_depth_std_mm)
    assert sheet.marker_depth_std_mm < np.hypot(0.15, MODEL_STD[1] * THICKNESS_MM)
    assert found.sheet.poisson == POISSON
    assert set(found.std) == {"young_std_MPa", "marker_depth_std_mm"}
    assert any(line.startswith("depth of the markers 0.") for line in describe(found))


@pytest.fixture(scope="module")
def solid() -> tuple[Sensor, list[KnownPress]]:
    """The pad `gel` of the suite, pressed by a ball with and without friction; forces are exact."""
    found: list[KnownPress] = []
    cases = calibration_presses("gel")
    true = true_pad(cases[0], width_px=320, centre_noise_px=0.02)
    assert true.layout is not None
    at_rest_px = rest_px(true, true.layout)
    for case in cases:
        for markers, _ in pad_states(case):
            still = SolidScene(
                name="press", time_s=np.array([0.0, 1.0]), states=(markers, markers), duration_s=1.0
            )
            moved_px = Simulator(sensor=true, scene=still).truth(0).grid.position_px - at_rest_px
            found.append(
                KnownPress(
                    name=f"press {len(found) + 1}",
                    place_mm=np.array(case.press.bodies[0].at_mm),
                    radius_mm=2.0,
                    displacement_px=moved_px,
                    is_seen=np.ones(len(moved_px), dtype=bool),
                    noise_px=0.02,
                    force_N=float(markers.contacts[0].normal_force_N),
                )
            )
    return true, found


def given(true: Sensor, **changed: float) -> Sensor:
    assert true.sheet is not None
    stds = {"thickness_std_mm": 0.2, "marker_depth_std_mm": 0.1, "poisson_std": 0.01, "young_std_MPa": 0.1}
    return replace(true, sheet=replace(true.sheet, **(stds | changed)))


@pytest.mark.slow
@pytest.mark.parametrize(("thickness_mm", "depth_mm"), [(4.25, 0.4), (3.75, 0.6)])
def test_presses_of_a_solid_show_thickness_and_depth(
    solid: tuple[Sensor, list[KnownPress]], thickness_mm: float, depth_mm: float
) -> None:
    true, held = solid
    found = fit_pad(PadEstimator(), given(true, thickness_mm=thickness_mm, marker_depth_mm=depth_mm), held)
    sheet = found.sheet
    assert sheet.thickness_std_mm is not None
    assert sheet.thickness_std_mm < np.hypot(0.1, MODEL_STD[0] * THICKNESS_MM)
    assert abs(sheet.thickness_mm - 4.0) < 0.6 * abs(thickness_mm - 4.0)
    assert abs(sheet.thickness_mm - 4.0) < 2.0 * sheet.thickness_std_mm
    assert true.sheet is not None
    assert true.sheet.young_MPa is not None
    assert abs(found.log_young - np.log(true.sheet.young_MPa)) < 0.08
    assert np.nanmax(np.abs(found.leave_one_out)) < 0.15


@pytest.mark.slow
def test_forces_that_contradict_each_other_widen_all_deviations(
    solid: tuple[Sensor, list[KnownPress]],
) -> None:
    true, held = solid
    force_N = held[0].force_N
    assert force_N is not None
    agreed = fit_pad(PadEstimator(), given(true), held)
    odd = fit_pad(PadEstimator(), given(true), [replace(held[0], force_N=1.5 * force_N), *held[1:]])
    for name in ("thickness_std_mm", "marker_depth_std_mm"):
        assert getattr(odd.sheet, name) > 1.2 * getattr(agreed.sheet, name)
    assert odd.log_young_std > 2.0 * agreed.log_young_std


def test_what_the_file_states_exactly_stays(known: list[KnownPress]) -> None:
    sheet = fit_pad(LINEAR, stated(thickness_mm=4.2, **EXACT), known).sheet
    assert (sheet.thickness_mm, sheet.marker_depth_mm) == (4.2, DEPTH_MM)
    assert (sheet.thickness_std_mm, sheet.marker_depth_std_mm) == (0.0, 0.0)


def test_a_force_is_predicted_from_the_others(known: list[KnownPress]) -> None:
    exact = stated(**EXACT)
    found = fit_pad(LINEAR, exact, known)
    others = fit_pad(LINEAR, exact, known[1:])
    assert known[0].force_N is not None
    alone = known[0].force_N / found.pressed.force_over_E_mm2[0]
    assert found.leave_one_out[0] == pytest.approx(others.log_young - np.log(alone), abs=1e-9)
    silent = [replace(known[0], force_N=None), *known[1:]]
    without = fit_pad(LINEAR, exact, silent)
    assert np.isnan(without.leave_one_out[0])
    assert without.log_young == pytest.approx(others.log_young, abs=1e-12)


def test_a_press_without_contact_is_an_error(known: list[KnownPress]) -> None:
    still = [*known, replace(known[0], name="press 6", displacement_px=0.0 * known[0].displacement_px)]
    with pytest.raises(SensorError, match="press 6 shows no contact"):
        fit_pad(LINEAR, stated(**EXACT), still)
