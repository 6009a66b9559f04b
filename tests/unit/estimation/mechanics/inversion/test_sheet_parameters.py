"""What a wrong outline in the sensor file does to forces, and that it makes no contacts."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.contact_rules import ContactRules
from manytouch.values import Contact, Sensor
from pressed_sheet import pressed, slack_sensor

EXACT = {"thickness_std_mm": 1e-6, "young_std_MPa": 1e-6, "poisson_std": 1e-9}
FRAMES = 4


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


def test_a_wrong_outline_is_no_contact() -> None:
    sensor, place_mm = with_outline(-0.3, 0.3), (4.0, 2.0)
    assert len(touching(sensor, place_mm, 0.15, ContactRules(outline_stds=0.0))) == 2
    (contact,) = touching(sensor, place_mm, 0.15)
    assert contact.centre_mm == pytest.approx(place_mm, abs=0.3)


def test_forces_beside_the_clamp_are_no_contact_with_an_exact_outline_either() -> None:
    sensor, place_mm = with_outline(-0.3, 0.0), (4.0, 2.0)
    assert len(touching(sensor, place_mm, 0.15, ContactRules(outline_stds=0.0))) == 2
    (contact,) = touching(sensor, place_mm, 0.15)
    assert contact.centre_mm == pytest.approx(place_mm, abs=0.3)
