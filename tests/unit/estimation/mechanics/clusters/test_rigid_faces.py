"""Clusters of forces under one rigid face are one contact."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.design.choose import lattice
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.clusters.rigid_faces import RigidFaces
from manytouch.geometry.camera import project
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.values import Contacts, Sensor, Sheet, TrackedGrid
from manytouch.values.arrays import read_only
from straight import straight_camera

HALF_MM = 5.5  # from the middle of the face to each of two edges that press
NOISE_PX = 0.02


@pytest.fixture(scope="module")
def sensor() -> Sensor:
    sheet = Sheet(
        size_mm=np.array([72.0, 60.0]), thickness_mm=2.0, young_MPa=3.0, poisson=0.45, pretension_N_per_mm=0.0
    )
    return Sensor(
        name="slack",
        camera=straight_camera(1600, 1400, focal_px=2000.0, distance_mm=100.0),
        layout=lattice((72.0, 60.0), 3.0, 0.75, 0.0),
        sheet=sheet,
    )


def pressed(sensor: Sensor, place_mm: np.ndarray, force_mm2: float, seed: int) -> TrackedGrid:
    """Markers under an even pressure on small areas around places (k, 2), with noise."""
    model = MechanicsEstimator().start(sensor).model
    load = np.zeros((model.patch.node_count, 3))
    if force_mm2:
        each = np.tile([0.0, 0.0, -force_mm2 / len(place_mm)], (len(place_mm), 1))
        load = model.patch.load(place_mm, each)
    found = equilibrium(model.shell, load)
    assert found.status == "ok"
    assert sensor.layout is not None
    centre_px = project(sensor.camera, sensor.layout.rest_mm) + model.dots.displacement_px(
        found.coefficient_mm
    )
    count = len(centre_px)
    return TrackedGrid(
        position_px=read_only(centre_px + np.random.default_rng(seed).normal(0.0, NOISE_PX, (count, 2))),
        covariance_px2=read_only(np.tile(NOISE_PX**2 * np.eye(2), (count, 1, 1))),
        is_seen=read_only(np.ones(count, dtype=bool)),
        frames_unseen=read_only(np.zeros(count, dtype=np.int64)),
    )


def face_mm() -> np.ndarray:
    """All of a square face."""
    side = np.linspace(-HALF_MM, HALF_MM, 8)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


def edges_mm() -> np.ndarray:
    """Its two edges at right angles to x."""
    along = np.linspace(-2.0, 2.0, 5)
    return np.concatenate([np.column_stack([np.full(5, x), along]) for x in (-HALF_MM, HALF_MM)])


def contacts_of(sensor: Sensor, grids: list[TrackedGrid], faces: RigidFaces) -> Contacts:
    estimator = replace(MechanicsEstimator(), rigid_faces=faces)
    state = estimator.start(sensor)
    for grid in grids:
        state, _, contacts = estimator.step(state, grid)
    return contacts


@pytest.mark.parametrize(("began_as_one", "count"), [(True, 1), (False, 2)])
def test_a_face_that_comes_to_press_with_two_edges_stays_one_contact(
    sensor: Sensor, began_as_one: bool, count: int
) -> None:
    rest = [pressed(sensor, face_mm(), 0.0, seed) for seed in range(3)]
    flat = [pressed(sensor, face_mm(), 0.03, 10 + seed) for seed in range(4)] if began_as_one else []
    split = [pressed(sensor, edges_mm(), 0.08, 20 + seed) for seed in range(4)]
    contacts = contacts_of(sensor, [*rest, *flat, *split], RigidFaces())
    assert len(contacts.touching) == count
    total_mm2 = sum(contact.normal_force_over_E_mm2 for contact in contacts.touching)
    assert total_mm2 == pytest.approx(0.08, rel=0.06)
    if began_as_one:
        np.testing.assert_allclose(contacts.touching[0].centre_mm, 0.0, atol=0.5)
        assert (
            len(contacts_of(sensor, [*rest, *flat, *split], RigidFaces(same_centre_pitch=0.0)).touching) == 2
        )
