"""Young's modulus of a pad from presses with known forces."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from bonded_pad import YOUNG_MPA, pad_sensor
from manytouch.calibration.sheet.describe_calibration import describe
from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.pad import calibrate_pad
from manytouch.errors import SensorError
from manytouch.estimation import PadEstimator
from manytouch.estimation.pad.estimator import PadState
from manytouch.values import Sensor

PLACES_MM = ((1.3, -0.7), (-4.0, 2.0), (3.0, 3.5))
FORCES_N = (0.6, 1.0, 0.4)
START = PadEstimator.start
SHEARS_N = ((0.15, 0.0), (0.0, -0.25), (0.08, 0.08))


@pytest.fixture(scope="module")
def sensor() -> Sensor:
    return pad_sensor(
        young_MPa=0.5, young_std_MPa=0.15, poisson=None, thickness_std_mm=0.0, marker_depth_std_mm=0.0
    )


@pytest.fixture(autouse=True)
def started_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The response of the pad is computed once: a state is a value, and depends on the sensor alone."""
    monkeypatch.setattr(PadEstimator, "start", lambda _, sensor: started(sensor))


@functools.cache
def started(sensor: Sensor) -> PadState:
    return START(PadEstimator(), sensor)


@functools.cache
def presses(sensor: Sensor) -> list[KnownPress]:
    """Images of patches that a pad of 0.3 MPa shows under known weights on a tilted sensor."""
    estimator = PadEstimator()
    model = estimator.nominal_pad(sensor)
    found = []
    loads = zip(PLACES_MM, FORCES_N, SHEARS_N, strict=True)
    for number, (place_mm, force_N, shear_N) in enumerate(loads):
        shape = np.array([*place_mm, 0.9, 0.0, 0.9])
        column = np.array([force_N, *shear_N]) @ estimator.fitter.images(model, shape[None]).column[0, :3]
        noise_px = np.random.default_rng(number).normal(0.0, 0.01, (len(column) // 2, 2))
        found.append(
            KnownPress(
                name=f"press {number + 1}",
                place_mm=np.array(place_mm),
                radius_mm=2.2,
                displacement_px=(column / YOUNG_MPA).reshape(-1, 2) + noise_px,
                is_seen=np.ones(len(column) // 2, dtype=bool),
                noise_px=0.02,
                force_N=force_N,
                shear_N=np.array(shear_N),
            )
        )
    return found


def test_known_forces_give_the_modulus_with_its_deviation(sensor: Sensor) -> None:
    held = presses(sensor)
    moved = [replace(held[0], place_mm=np.array([8.0, 8.0])), *held[1:]]  # places are for messages only
    found = calibrate_pad(sensor, moved)
    assert found.sheet.young_MPa is not None
    assert found.sheet.young_std_MPa is not None
    assert abs(found.sheet.young_MPa - YOUNG_MPA) < 2.0 * found.sheet.young_std_MPa
    assert found.sheet.young_std_MPa < 0.12 * YOUNG_MPA
    assert np.abs(found.leave_one_out_error).max() < 0.2
    assert any("Young's modulus" in line for line in describe(found))
    assert found.sheet.poisson == PadEstimator().nominal_pad.poisson  # E holds with what was assumed
    (warning,) = found.warnings
    assert "press 1: the force acts" in warning
    odd = [
        replace(held[0], shear_N=np.array([0.0, 0.15])),
        *(replace(each, shear_N=1.6 * np.array(each.shear_N)) for each in held[1:]),
    ]
    first, second = calibrate_pad(sensor, odd).warnings
    assert "press 1: the shear points 9" in first
    assert "the shear forces give E = 0.4" in second
    still = [replace(held[0], displacement_px=0.0 * held[0].displacement_px), *held[1:]]
    with pytest.raises(SensorError, match="press 1 shows no contact"):
        calibrate_pad(sensor, still)


def test_presses_that_contradict_each_other_widen_the_deviation(sensor: Sensor) -> None:
    held = presses(sensor)
    found = calibrate_pad(sensor, [replace(held[0], force_N=1.2), *held[1:]])  # it was 0.6
    rms = np.sqrt(np.mean(np.log1p(found.leave_one_out_error) ** 2))
    assert rms > 0.4
    assert found.std["young_std_MPa"] >= rms * found.sheet.young_MPa
    (line,) = (each for each in describe(found) if "leave-one-out" in each)
    assert "(RMS)" in line


def test_presses_that_do_not_determine_the_modulus_are_refused(sensor: Sensor) -> None:
    held = presses(sensor)
    assert held[0].force_N is not None
    odd = [replace(held[0], force_N=0.02 * held[0].force_N), *held[1:]]
    with pytest.raises(SensorError, match=r"do not determine Young's modulus.*press 1 \(\+\d+ %\)"):
        calibrate_pad(sensor, odd)


@pytest.mark.slow
def test_a_modulus_far_from_the_sensor_file_is_a_warning() -> None:
    stated = pad_sensor(young_MPa=1.2, young_std_MPa=0.36, thickness_std_mm=0.0, marker_depth_std_mm=0.0)
    (far,) = calibrate_pad(stated, presses(stated)).warnings
    assert "differs by more than 3 deviations from the 1.2 ± 0.36 MPa" in far


def test_presses_without_forces_are_refused() -> None:
    silent = [
        KnownPress(
            name=f"press {number}",
            place_mm=np.zeros(2),
            radius_mm=2.0,
            displacement_px=np.zeros((63, 2)),
            is_seen=np.ones(63, dtype=bool),
            noise_px=0.02,
        )
        for number in range(3)
    ]
    with pytest.raises(SensorError, match="2 presses or more with a force in N"):
        calibrate_pad(pad_sensor(), silent)
