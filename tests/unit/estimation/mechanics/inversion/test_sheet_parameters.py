"""What wrong numbers of the sensor file do to contacts, that a wrong outline makes none, and the estimate of
an unknown pretension.
"""

from dataclasses import replace

import numpy as np
import pytest

from bent_sheets import YOUNG_MPA, bent, grid_of, sensor_of
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.contact_rules import ContactRules
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.inversion.sheet_parameters import PretensionEstimate, PretensionEstimator
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.geometry.camera import project
from manytouch.values import Contact, Sensor
from manytouch.values.sensor_file.assumed_sheet import ASSUMED_POISSON
from manytouch.values.sensor_file.default_std import ASSUMED_POISSON_STD
from pressed_sheet import pressed, slack_sensor

EXACT = {"thickness_std_mm": 1e-6, "young_std_MPa": 1e-6, "poisson_std": 1e-9}
EXACT_CAMERA = {"fx_std_px": 0.0, "translation_std_mm": np.zeros(3)}
FRAMES = 4
ESTIMATOR = MechanicsEstimator()


def with_outline(off_mm: float, std_mm: float) -> Sensor:
    """The sensor with each side of its outline farther outwards than it is, everything else exact."""
    sensor = slack_sensor()
    assert sensor.sheet is not None
    size_mm = sensor.sheet.size_mm + 2.0 * off_mm
    return replace(sensor, sheet=replace(sensor.sheet, size_mm=size_mm, outline_std_mm=std_mm, **EXACT))


def touching(
    sensor: Sensor, place_mm: tuple[float, float], force_mm2: float, rules: ContactRules | None = None
) -> list[Contact]:
    """Contacts of a press on the sheet as it is, by a sensor file."""
    estimator = MechanicsEstimator(contact_rules=rules or ContactRules())
    state = estimator.start(sensor)
    grids = [pressed(np.array([place_mm]), 0.0, 0)]
    grids += [pressed(np.array([place_mm]), force_mm2, 1 + seed) for seed in range(FRAMES)]
    for grid in grids:
        state, _, contacts = estimator.step(state, grid)
    return list(contacts.touching)


def test_the_deviation_of_a_force_next_to_the_clamp_contains_that_of_the_outline() -> None:
    place_mm, force_mm2, off_mm = (-28.0, 0.0), 0.06, 0.2
    (exact,), (stated,), (small,), (large,) = (
        touching(with_outline(off, std), place_mm, force_mm2)
        for off, std in ((0.0, 1e-6), (0.0, off_mm), (-off_mm, off_mm), (off_mm, off_mm))
    )
    sheet = slack_sensor().sheet
    assert sheet is not None
    assert sheet.young_MPa is not None
    changed_mm2 = 0.5 * abs(small.normal_force_over_E_mm2 - large.normal_force_over_E_mm2)
    added = np.sqrt(stated.std("normal_force") ** 2 - exact.std("normal_force") ** 2) / sheet.young_MPa
    assert changed_mm2 > 0.05 * force_mm2
    assert added == pytest.approx(changed_mm2, rel=0.25)


def with_inclination(turn_rad: float, std_rad: float) -> Sensor:
    """The sensor with its camera turned about y, registered to the sheet at rest, everything else exact."""
    sensor, turn = with_outline(0.0, 0.0), np.array([0.0, 1.0, 0.0])
    camera, layout = sensor.camera, sensor.layout
    assert layout is not None
    turned = replace(
        camera,
        rotation_vector=camera.rotation_vector + turn_rad * turn,
        rotation_vector_std=std_rad * turn,
        **EXACT_CAMERA,
    )
    layout = replace(layout, rest_px=project(camera, layout.rest_mm))
    return replace(sensor, camera=turned, layout=layout)


def test_the_deviation_of_shear_contains_that_of_the_inclination_of_the_camera() -> None:
    place_mm, force_mm2, off_rad = (4.0, 2.0), 0.1, 0.01
    (exact,), (stated,), (one_way,), (other_way,) = (
        touching(with_inclination(off, std), place_mm, force_mm2)
        for off, std in ((0.0, 0.0), (0.0, off_rad), (-off_rad, off_rad), (off_rad, off_rad))
    )
    for axis, name in enumerate(("shear_x", "shear_y")):
        added_N = np.sqrt(stated.std(name) ** 2 - exact.std(name) ** 2)
        changed_N = 0.5 * abs(one_way.force_N[axis] - other_way.force_N[axis])
        assert added_N == pytest.approx(changed_N, rel=0.15, abs=0.003)
    assert changed_N < 0.003  # across the inclination
    assert abs(one_way.force_N[0] - other_way.force_N[0]) > 0.05


def with_thickness(factor: float, std_share: float) -> Sensor:
    sensor = with_outline(0.0, 0.0)
    assert sensor.sheet is not None
    thickness_mm = sensor.sheet.thickness_mm
    changed = {"thickness_mm": factor * thickness_mm, "thickness_std_mm": std_share * thickness_mm}
    return replace(
        sensor,
        camera=replace(sensor.camera, rotation_vector_std=np.zeros(3), **EXACT_CAMERA),
        sheet=replace(sensor.sheet, **changed),
    )


def test_the_deviation_of_depth_contains_that_of_the_thickness() -> None:
    place_mm, force_mm2, share = (4.0, 2.0), 0.1, 0.1
    (exact,), (stated,), (thin,), (thick,) = (
        touching(with_thickness(1.0 + off, std), place_mm, force_mm2)
        for off, std in ((0.0, 1e-9), (0.0, share), (-share, share), (share, share))
    )
    changed_mm = 0.5 * abs(thin.depth_mm - thick.depth_mm)
    added_mm = np.sqrt(stated.std("depth") ** 2 - exact.std("depth") ** 2)
    assert changed_mm > 0.001
    assert added_mm == pytest.approx(changed_mm, rel=0.3)
    assert stated.std("torque") > 1.001 * exact.std("torque")


def with_poisson(poisson: float | None) -> Sensor:
    sensor = with_thickness(1.0, 1e-9)
    assert sensor.sheet is not None
    std = None if poisson is None else sensor.sheet.poisson_std
    return replace(sensor, sheet=replace(sensor.sheet, poisson=poisson, poisson_std=std))


def test_the_deviation_of_a_force_contains_that_of_a_ratio_that_is_not_stated() -> None:
    place_mm, force_mm2 = (4.0, 2.0), 0.1
    (exact,), (unstated,), (small,) = (
        touching(with_poisson(ratio), place_mm, force_mm2)
        for ratio in (ASSUMED_POISSON, None, ASSUMED_POISSON - ASSUMED_POISSON_STD)
    )
    changed_N = exact.force_N[2] - small.force_N[2]
    added_N = np.sqrt(unstated.std("normal_force") ** 2 - exact.std("normal_force") ** 2)
    assert changed_N < -0.02 * abs(exact.force_N[2])
    assert added_N == pytest.approx(abs(changed_N), rel=0.2)
    assert unstated.force_N == pytest.approx(exact.force_N)


def test_where_a_press_grows_its_deviations_by_parameters_grow_at_once() -> None:
    """The response to the parameters is computed in the frame after a full step; until then it is that of the
    weaker force, and the sheet becomes stiffer as it is pressed.
    """
    state, place_mm = ESTIMATOR.start(with_thickness(1.0, 0.2)), np.array([(4.0, 2.0)])
    found = []
    for seed, force_mm2 in enumerate((0.0, 0.04, 0.04, 0.15, 0.15, 0.15)):
        state, _, contacts = ESTIMATOR.step(state, pressed(place_mm, force_mm2, seed))
        found.append(list(contacts.touching))
    (grown,), (*_, last) = found[3], found[5]
    for name in ("normal_force", "shear_x", "depth"):
        assert 0.9 * last.std(name) < grown.std(name) < 2.0 * last.std(name)


def test_a_wrong_outline_is_no_contact() -> None:
    sensor, place_mm = with_outline(-0.3, 0.3), (4.0, 2.0)
    assert len(touching(sensor, place_mm, 0.15, ContactRules(outline_stds=0.0, sure_stds=0.0))) == 2
    (contact,) = touching(sensor, place_mm, 0.15)
    assert contact.centre_mm == pytest.approx(place_mm, abs=0.3)


def test_forces_beside_the_clamp_are_no_contact_with_an_exact_outline_either() -> None:
    sensor, place_mm = with_outline(-0.3, 0.0), (4.0, 2.0)
    assert len(touching(sensor, place_mm, 0.15, ContactRules(outline_stds=0.0, sure_stds=0.0))) == 2
    (contact,) = touching(sensor, place_mm, 0.15)
    assert contact.centre_mm == pytest.approx(place_mm, abs=0.3)


def test_what_presses_most_is_a_contact_also_where_the_outline_is_uncertain() -> None:
    place_mm, force_mm2 = (-28.0, 0.0), 0.06
    (contact,) = touching(with_outline(0.0, 1.5), place_mm, force_mm2)
    assert contact.normal_force_over_E_mm2 == pytest.approx(force_mm2, rel=0.1)
    assert contact.std("normal_force") > -0.25 * contact.force_N[2]


PLACE_MM = (6.0, -4.0)


def pressed_without_pretension(
    pretension_N_per_mm: float, forces_mm2: list[float]
) -> list[tuple[MechanicsState, list[Contact]]]:
    """States and contacts of presses on a sheet whose pretension the sensor file does not state."""
    true = ESTIMATOR.start(sensor_of(pretension_N_per_mm=pretension_N_per_mm)).model
    state, found = ESTIMATOR.start(sensor_of(pretension_N_per_mm=None)), []
    shape = {force: bent(true, (*PLACE_MM, force)) for force in set(forces_mm2)}
    for seed, force_mm2 in enumerate(forces_mm2):
        state, _, contacts = ESTIMATOR.step(state, grid_of(true, shape[force_mm2], seed=seed))
        found.append((state, list(contacts.touching)))
    return found


@pytest.mark.parametrize(
    ("pretension_N_per_mm", "force_mm2"), [(0.0, 0.5), (0.1, 1.0), (0.2, 1.5), (0.4, 2.5)]
)
def test_a_press_shows_an_unknown_pretension(pretension_N_per_mm: float, force_mm2: float) -> None:
    """Up to a strain of 3.7 %, 2 to 3 mm deep."""
    frames = pressed_without_pretension(
        pretension_N_per_mm, [share * force_mm2 for share in (0.0, 0.2, 0.6, 1.0, 1.0)]
    )
    state, (contact,) = frames[-1]
    true_mm, found = pretension_N_per_mm / YOUNG_MPA, state.pretension
    assert found.mean_mm == pytest.approx(true_mm, rel=0.15, abs=0.005)
    assert abs(found.mean_mm - true_mm) < found.std_mm
    assert contact.normal_force_over_E_mm2 == pytest.approx(force_mm2, rel=0.15)


@pytest.mark.parametrize("pretension_N_per_mm", [0.0, 0.4])
def test_the_first_force_has_the_deviation_of_the_unknown_pretension(pretension_N_per_mm: float) -> None:
    force_mm2 = 0.1 + pretension_N_per_mm
    _, (_, (contact,)) = pressed_without_pretension(pretension_N_per_mm, [0.0, force_mm2])
    off_mm2 = contact.normal_force_over_E_mm2 - force_mm2
    assert abs(off_mm2) > 0.2 * force_mm2
    assert abs(off_mm2) < 2.0 * contact.std("normal_force") / YOUNG_MPA


def test_a_light_press_does_not_show_the_pretension() -> None:
    before, after = (state for state, _ in pressed_without_pretension(0.2, [0.0, *3 * [0.1]])[::3])
    assert after.pretension == before.pretension


def updated(
    before: PretensionEstimate, model: InversionModel, at_mm: float, std_mm: float, frames: int
) -> PretensionEstimate:
    """After frames whose least misfit is at a pretension over E."""
    estimator = PretensionEstimator()
    for _ in range(frames):
        gradient = (model.shell.pretension_over_E_mm - at_mm) / std_mm**2
        before = estimator.update(before, model, gradient, 1.0 / std_mm**2)
    return before


def test_of_many_presses_the_last_strong_ones_count() -> None:
    model = ESTIMATOR.start(sensor_of()).model
    start = ESTIMATOR.start(sensor_of(pretension_N_per_mm=None)).pretension
    strong = updated(start, model, 0.1, 0.002, 5)
    assert strong.mean_mm == pytest.approx(0.1, rel=0.01)
    light = updated(strong, model, 0.06, 0.02, 50)
    assert light.mean_mm == pytest.approx(0.1, rel=0.05)
    later = updated(updated(strong, model, 0.1, 0.002, 1000), model, 0.08, 0.002, 40)
    assert later.mean_mm == pytest.approx(0.08, rel=0.02)
