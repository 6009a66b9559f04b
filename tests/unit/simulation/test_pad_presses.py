"""Presses on a pad without pictures: truth of markers, contact face and contacts."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.errors import SensorError
from manytouch.geometry.refraction import project_through_window
from manytouch.simulation.demo_sensor import demo_sensor, pad_sensor
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.pad_presses import PressedPad, solve_pad
from manytouch.simulation.scene.pad import pad_solid

SENSOR = pad_sensor()
PLACE_MM, DEPTHS_MM = np.array([2.0, -1.0]), (0.4, 0.8)
PATH_MM = np.array([[*PLACE_MM, depth_mm] for depth_mm in DEPTHS_MM])
LOADING = Loading(touches=(press(Sphere(radius_mm=5.0), thickness_mm=4.0, path_mm=PATH_MM),))


@pytest.fixture(scope="module")
def states(tmp_path_factory: pytest.TempPathFactory) -> list[PressedPad]:
    assert SENSOR.sheet is not None
    model = pad_solid(SENSOR.sheet, LOADING, element_mm=3.0, contact_element_mm=1.2, layers=2)
    return list(solve_pad(SENSOR, LOADING, model=model, folder=tmp_path_factory.mktemp("states")))


def test_states_have_contacts_and_depths_of_the_contact_face(states: list[PressedPad]) -> None:
    for state, depth_mm in zip(states, DEPTHS_MM, strict=True):
        (contact,) = state.contacts
        assert state.status == "ok"
        assert contact.depth_mm == pytest.approx(depth_mm, abs=0.04)
        assert state.face_depth_mm(PLACE_MM[None])[0] == pytest.approx(contact.depth_mm, abs=0.02)
        np.testing.assert_allclose(contact.centre_mm, PLACE_MM, atol=0.1)
        assert contact.area_mm2 == pytest.approx(np.pi * 5.0 * depth_mm, rel=0.5)
        assert np.isnan(state.face_depth_mm(np.array([[12.6, 0.0]]))[0])
    assert states[1].contacts[0].normal_force_N > 2.5 * states[0].contacts[0].normal_force_N


def test_markers_move_with_the_solid_at_their_depth(states: list[PressedPad]) -> None:
    assert SENSOR.layout is not None
    assert SENSOR.sheet is not None
    for state in states:
        rest_mm = SENSOR.layout.rest_mm
        np.testing.assert_allclose(
            state.marker_mm, state.markers.displacement_mm(np.ascontiguousarray(rest_mm[:, :2]))
        )
        under = np.linalg.norm(rest_mm[:, :2] - PLACE_MM, axis=1).argmin()
        depth_mm = state.face_depth_mm(np.ascontiguousarray(rest_mm[under, None, :2]))[0]
        assert 0.5 * depth_mm < -state.marker_mm[under, 2] < depth_mm
        outward = ((rest_mm[:, :2] - PLACE_MM) * state.marker_mm[:, :2]).sum(axis=1)
        near = np.linalg.norm(rest_mm[:, :2] - PLACE_MM, axis=1) < 4.0
        assert np.all(outward[near & (np.arange(len(rest_mm)) != under)] > 0.0)
        middle_px = project_through_window(SENSOR.camera, SENSOR.sheet, rest_mm + state.marker_mm)
        np.testing.assert_allclose(
            state.marker_px, middle_px, atol=0.25
        )  # a bent disc's centroid is not its middle


def test_only_a_bonded_pad_of_known_stiffness_is_pressed() -> None:
    assert SENSOR.sheet is not None
    soft = replace(SENSOR, sheet=replace(SENSOR.sheet, young_MPa=None))
    for sensor in (demo_sensor(), soft):
        with pytest.raises(SensorError, match="cannot be pressed as a pad"):
            next(solve_pad(sensor, LOADING))
    with pytest.raises(SensorError, match=r"needs \[markers\]"):
        next(solve_pad(replace(SENSOR, layout=None), LOADING))
