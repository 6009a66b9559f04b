"""Clusters of forces under one rigid face are one contact."""

import numpy as np
import pytest

from manytouch.estimation.mechanics.clusters.rigid_faces import RigidFaces
from pressed_sheet import contacts_of, pressed

HALF_MM = 5.5  # from the middle of the face to each of two edges that press


def face_mm() -> np.ndarray:
    """All of a square face."""
    side = np.linspace(-HALF_MM, HALF_MM, 8)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


def edges_mm() -> np.ndarray:
    """Its two edges at right angles to x."""
    along = np.linspace(-2.0, 2.0, 5)
    return np.concatenate([np.column_stack([np.full(5, x), along]) for x in (-HALF_MM, HALF_MM)])


@pytest.mark.parametrize(("began_as_one", "count"), [(True, 1), (False, 2)])
def test_a_face_that_comes_to_press_with_two_edges_stays_one_contact(began_as_one: bool, count: int) -> None:
    rest = [pressed(face_mm(), 0.0, seed) for seed in range(3)]
    flat = [pressed(face_mm(), 0.03, 10 + seed) for seed in range(4)] if began_as_one else []
    split = [pressed(edges_mm(), 0.08, 20 + seed) for seed in range(4)]
    contacts = contacts_of([*rest, *flat, *split], RigidFaces())
    assert len(contacts.touching) == count
    total_mm2 = sum(contact.normal_force_over_E_mm2 for contact in contacts.touching)
    assert total_mm2 == pytest.approx(0.08, rel=0.06)
    if began_as_one:
        np.testing.assert_allclose(contacts.touching[0].centre_mm, 0.0, atol=0.5)
        assert len(contacts_of([*rest, *flat, *split], RigidFaces(same_centre_pitch=0.0)).touching) == 2
