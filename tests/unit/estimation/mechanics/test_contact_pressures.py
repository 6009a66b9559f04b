"""The pressure of the contacts on the nodes of the sheet."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.clusters.force_clusters import cluster_moments
from manytouch.estimation.mechanics.contact_pressures import with_contact_pressures
from manytouch.geometry.sheet_face import sheet_face
from manytouch.values import Contacts, Surface
from pressed_sheet import pressed, started

PLACES_MM = np.array([[-12.0, 4.0], [-12.0, 5.5], [12.0, -4.0]])


def pressed_surface() -> tuple[Surface, Contacts]:
    estimator, state = MechanicsEstimator(), started()
    frames = [pressed(PLACES_MM, 0.0, seed) for seed in range(3)]
    for grid in [*frames, *(pressed(PLACES_MM, 0.06, 10 + seed) for seed in range(3))]:
        state, surface, contacts = estimator.step(state, grid)
    assert len(contacts.touching) == 2
    return surface, contacts


def test_the_pressure_sums_up_to_the_forces_of_the_contacts() -> None:
    surface, contacts = pressed_surface()
    assert surface.spline is not None
    x_mm, y_mm = (np.arange(-half, half, 0.25) + 0.125 for half in (36.0, 30.0))
    place_mm = np.stack(np.meshgrid(x_mm, y_mm), axis=-1).reshape(-1, 2)
    pressure_MPa = sheet_face(surface.spline, place_mm).pressure_MPa(surface.spline)
    total_N = sum(contact.normal_force_N for contact in contacts.touching)
    assert pressure_MPa.sum() * 0.25**2 == pytest.approx(total_N, rel=0.002)


def test_nodes_that_press_have_what_is_missing_in_the_sum() -> None:
    """A force that pulls next to a contact counts in the sum; a contact without a cluster changes nothing.

    A cluster that is no contact yet keeps its force, however strong it is.
    """
    surface, contacts = pressed_surface()
    nodes, spline = started().model.nodes, surface.spline
    assert spline is not None
    label, force_mm2 = np.full(len(nodes.place_mm), -1), np.zeros((len(nodes.place_mm), 3))
    for number, contact in enumerate(contacts.touching):
        nearest = np.argsort(np.linalg.norm(nodes.place_mm - contact.centre_mm, axis=1))
        label[nearest[:4]], force_mm2[nearest[:4], 2] = number, -0.01
        force_mm2[nearest[4], 2] = 0.004
    waiting = np.argmin(np.linalg.norm(nodes.place_mm - [-2.0, -20.0], axis=1))
    label[waiting], force_mm2[waiting, 2] = 2, -0.3
    clusters = cluster_moments(nodes, force_mm2, label)
    before = replace(surface, spline=replace(spline, force_over_E_mm2=force_mm2))
    first, second = contacts.touching
    other = replace(first, id=9, centre_mm=np.array([30.0, 24.0]))
    given = (replace(first, normal_force_over_E_mm2=0.05), replace(second, normal_force_over_E_mm2=0.03))
    after = with_contact_pressures(before, nodes, clusters, Contacts(contacts=(*given, other)))
    assert after.spline is not None
    press_mm2 = -after.spline.force_over_E_mm2[:, 2]
    for number, contact in enumerate(given):
        is_near = np.linalg.norm(nodes.place_mm - contact.centre_mm, axis=1) < 10.0
        assert press_mm2[is_near].sum() == pytest.approx(contact.normal_force_over_E_mm2)
        np.testing.assert_allclose(press_mm2[label == number], press_mm2[label == number].mean())
    assert press_mm2[waiting] == 0.3
    assert press_mm2.sum() == pytest.approx(0.08 + 0.3)
    assert (press_mm2[label < 0] <= 0.0).all()
