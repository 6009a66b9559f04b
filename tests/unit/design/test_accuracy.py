"""Predicted accuracy, and its change with other dimensions."""

import csv
from dataclasses import replace

import cv2
import numpy as np
import pytest

from exact_sheet import EXACT
from manytouch.design.accuracy import (
    predicted_accuracy,
    press_deviations,
    scale_design,
    typical_force_N,
)
from manytouch.design.choose import design_sensor
from manytouch.design.deflection import fingertip
from manytouch.design.prototype import FINGERTIP, TIP, ObservedPress, Prototype, observe_press
from manytouch.design.requirements import Requirements
from manytouch.design.write import write_prediction
from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.simulation.scene.deformation import contact_from_row
from manytouch.simulation.solve_scene import STATES_VARIABLE


@pytest.fixture(autouse=True, scope="module")
def states(tmp_path_factory):
    folder = tmp_path_factory.mktemp("states")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATES_VARIABLE, str(folder))
        yield folder


@pytest.fixture(scope="module")
def found():
    return design_sensor(Requirements(area_mm=(40.0, 25.0), thickness_mm=3.0, force_N=(0.5, 4.0)))


def stress_free(sheet):
    """The sheet as the prototype has it; the pretension of a design is not known."""
    return replace(sheet, pretension_N_per_mm=0.0)


def coarse_prototype(sensor):
    """A prototype with few elements, for laws that hold on any mesh."""
    fine = Prototype.of(sensor)
    return replace(fine, model=replace(fine.model, element_mm=4.0))


@pytest.fixture(scope="module")
def prototype(found):
    return coarse_prototype(found.sensor)


@pytest.mark.slow
def test_a_prototype_moves_the_markers_approximately_as_the_shell_does(found):
    pressed = Prototype.of(found.sensor).press(FINGERTIP, np.array([5.0, -4.0]), 2.0)
    assert pressed.contact.centre_mm == pytest.approx([5.0, -4.0], abs=0.3)
    assert 1.5 < pressed.contact.depth_mm < 2.0
    fresh = MechanicsEstimator().start(replace(found.sensor, sheet=stress_free(found.sensor.sheet)))
    shape = _shape(fresh, pressed.contact.centre_mm, pressed.contact.normal_force_N)
    wanted = fresh.model.dots.displacement_px(shape)
    off = np.linalg.norm(pressed.displacement_px - wanted, axis=1)
    assert off.max() < 0.2 * np.linalg.norm(wanted, axis=1).max()
    assert pressed.displacement_px[wanted[:, 0] > 5.0, 0].min() > 0.0


def test_pins_show_the_slope_that_flush_markers_do_not(found, prototype):
    high = replace(found.sensor, layout=replace(found.sensor.layout, height_mm=3.0))
    flush, pins = (
        replace(prototype, sensor=sensor).press(FINGERTIP, np.zeros(2), 1.5)
        for sensor in (found.sensor, high)
    )
    assert np.abs(pins.displacement_px).max() > 1.5 * np.abs(flush.displacement_px).max()


def test_a_mirrored_press_is_the_press_at_the_mirrored_place(found, prototype):
    solved = prototype.solve(TIP, np.array([8.0, 5.0]), 1.0)
    mirrored = observe_press(found.sensor, solved, np.array([-1.0, 1.0]))
    there = prototype.press(TIP, np.array([-8.0, 5.0]), 1.0)
    assert mirrored.displacement_px == pytest.approx(there.displacement_px, abs=2e-3)
    assert mirrored.contact.centre_mm == pytest.approx(there.contact.centre_mm, abs=1e-3)
    assert np.abs(there.displacement_px).max() > 1.0


def test_presses_are_cached_for_all_designs_with_the_same_sheet(found, prototype, states):
    place, depth_mm = np.array([[12.0, 3.0]]), prototype.fingertip_depths_mm(np.array([[12.0, 3.0]]), 1.0)
    pressed = prototype.press(FINGERTIP, place[0], depth_mm[0])
    assert pressed.contact.normal_force_N == pytest.approx(1.0, rel=0.2)
    solved = len(list(states.iterdir()))
    farther = coarse_prototype(scale_design(found, stand_off=1.4))
    assert farther.fingertip_depths_mm(place, 1.0) == depth_mm
    again = farther.press(FINGERTIP, place[0], depth_mm[0])
    assert again.contact.centre_mm == pytest.approx(pressed.contact.centre_mm)
    assert np.abs(again.displacement_px).max() < 0.9 * np.abs(pressed.displacement_px).max()
    assert len(list(states.iterdir())) == solved
    coarse_prototype(scale_design(found, thickness=1.4)).press(FINGERTIP, place[0], depth_mm[0])
    assert len(list(states.iterdir())) > solved


def _shape(fresh, place_mm, force_N):
    model = fresh.model
    points, weight = fingertip(1.5)
    force_over_E_mm2 = np.outer(weight, [0.0, 0.0, -force_N / model.young_MPa])
    load = model.patch.load(place_mm + points, force_over_E_mm2)
    return equilibrium(model.shell, load).coefficient_mm


def test_errors_are_those_of_the_method_with_noise(found):
    method = MechanicsEstimator()
    sheet = replace(stress_free(found.sensor.sheet), **EXACT)
    fresh = method.start(replace(found.sensor, sheet=sheet))
    shape = _shape(fresh, np.zeros(2), 1.0)
    row = [0.0, 0.0, -1.0, 0.0, 7.0, 0.0, 0.0, 1.0]
    seen = fresh.model.dots.displacement_px(shape)

    def deviations(row):
        random = np.random.default_rng(0)
        return press_deviations(
            method,
            fresh,
            ObservedPress(displacement_px=seen, contact=contact_from_row(np.array(row))),
            random,
        )

    force, depth, position, depth_off, force_off = deviations(row)
    assert (force, depth) == (1.0, 1.0)
    assert position < 0.1
    assert force_off < 0.05
    moved = deviations([*row[:5], 1.0, 0.0, 1.0])
    assert moved[2] == pytest.approx(np.sqrt(0.5), rel=0.1)
    deeper = deviations([*row[:7], 1.5])
    assert abs(deeper[3] - depth_off) == pytest.approx(0.5, rel=0.2)
    stronger = deviations([0.0, 0.0, -1.5, *row[3:]])
    assert stronger[4] == pytest.approx(0.5, abs=0.05)
    assert np.isnan(press_deviations(method, fresh, None, np.random.default_rng(0))).all()


@pytest.mark.slow
def test_the_prediction_is_accurate_and_deepest_in_the_middle(found):
    messages = []
    predicted = predicted_accuracy(
        found.sensor,
        area_mm=(40.0, 25.0),
        force_N=typical_force_N(found),
        places=(2, 2),
        on_message=messages.append,
    )
    assert predicted.place_mm.tolist() == [[0.0, 0.0], [20.0, 0.0], [0.0, 12.5], [20.0, 12.5]]
    assert predicted.force_N == pytest.approx(np.full(4, np.sqrt(2.0)), rel=0.3)
    assert predicted.depth_mm.argmax() == 0
    assert np.all(predicted.depth_std_mm < 0.1 * predicted.depth_mm)
    assert np.all((predicted.position_std_mm > 0.0) & (predicted.position_std_mm < 1.2))
    sheet = Prototype.of(found.sensor).calibrate(np.random.default_rng(0)).sheet
    assert sheet.thickness_mm == pytest.approx(3.0, rel=0.1)  # with a flat foot 18 % too thick
    position, depth, force = predicted.rms
    assert position == pytest.approx(np.sqrt(np.mean(predicted.position_std_mm**2)))
    assert depth == pytest.approx(1e3 * np.sqrt(np.mean(predicted.depth_std_mm**2)))
    assert 0.1 < force < 20.0
    assert len(messages) == 8


def test_factors_change_their_dimension_only(found):
    assert scale_design(found, thickness=2.0).sheet.thickness_mm == 6.0
    farther = scale_design(found, stand_off=1.5).camera.translation_mm[2]
    assert farther == pytest.approx(1.5 * found.sensor.camera.translation_mm[2])
    assert scale_design(found).layout is found.sensor.layout


@pytest.mark.slow
def test_the_prediction_is_written_and_drawn(found, tmp_path):
    predicted = write_prediction(found, tmp_path)
    assert np.isfinite(predicted.rms).all()
    rows = list(csv.DictReader((tmp_path / "accuracy.csv").read_text().splitlines()))
    assert len(rows) == 12
    assert float(rows[0]["depth_std_mm"]) > 0
    for name in ("accuracy.png", "tradeoff.png"):
        assert cv2.imread(str(tmp_path / name)).std() > 10
