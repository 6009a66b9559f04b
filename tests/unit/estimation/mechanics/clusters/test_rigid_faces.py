"""Clusters of forces under one rigid face are one contact."""

import numpy as np
import pytest

from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.clusters.bars import BarRule
from manytouch.estimation.mechanics.clusters.evidence import Evidence
from manytouch.estimation.mechanics.clusters.force_clusters import (
    Clusters,
    EarlierClusters,
    PreviousContacts,
    cluster_moments,
)
from manytouch.estimation.mechanics.clusters.rigid_faces import RigidFaces
from pressed_sheet import THICKNESS_MM, contacts_of, pressed, slack_sensor
from synthetic_evidence import evidence_of

NO_CONTACT = np.zeros((0, 2))
NO_CLUSTERS = EarlierClusters.none()
MIDDLE_MM = np.array([[0.0, -1.4]])
FACES = RigidFaces()
HALF_MM = 5.5  # from the middle of the face to each of two edges that press


def face_mm() -> np.ndarray:
    """All of a square face."""
    side = np.linspace(-HALF_MM, HALF_MM, 8)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


def edges_mm(half_width_mm: float = 2.0) -> np.ndarray:
    """Its two edges at right angles to x."""
    along = np.linspace(-half_width_mm, half_width_mm, 5)
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


@pytest.mark.parametrize(
    ("half_width_mm", "edge_thickness", "count"), [(3.5, 0.75, 1), (3.5, 9.0, 2), (1.0, 0.75, 2)]
)
def test_a_block_whose_edges_press_first_is_one_contact(
    half_width_mm: float, edge_thickness: float, count: int
) -> None:
    """Edges 5.5 thicknesses apart that are long across the line between them; short ones look like balls."""
    rest = [pressed(face_mm(), 0.0, seed) for seed in range(3)]
    split = [pressed(edges_mm(half_width_mm), 0.08, 20 + seed) for seed in range(4)]
    faces = RigidFaces(edge_thickness=edge_thickness, bars=BarRule(min_f=-1e3))
    contacts = contacts_of([*rest, *split], faces)
    assert len(contacts.touching) == count
    if count == 1:
        np.testing.assert_allclose(contacts.touching[0].centre_mm, 0.0, atol=0.5)
        assert contacts.touching[0].normal_force_over_E_mm2 == pytest.approx(0.08, rel=0.06)


def test_edges_of_different_depth_are_two_contacts() -> None:
    """A weak edge and a strong one are two objects, however long both are."""
    rest = [pressed(face_mm(), 0.0, seed) for seed in range(3)]
    weak_mm, strong_mm = np.split(edges_mm(3.5), 2)
    place_mm = np.concatenate([weak_mm, *[strong_mm] * 2])
    split = [pressed(place_mm, 0.08, 20 + seed) for seed in range(4)]
    assert len(contacts_of([*rest, *split], RigidFaces(bars=BarRule(min_f=-1e3))).touching) == 2


@pytest.mark.parametrize(("kept_thickness", "count"), [(3.2, 1), (4.0, 2)])
def test_a_contact_that_comes_to_press_with_near_ends_stays_one(kept_thickness: float, count: int) -> None:
    """Ends 3.6 thicknesses apart, of which the markers say that they are two."""
    middle_mm = np.zeros((1, 2))
    ends_mm = np.array([[0.0, 1.8], [0.0, -1.8]]) * THICKNESS_MM
    rest = [pressed(middle_mm, 0.0, seed) for seed in range(3)]
    flat_mm = np.column_stack([np.zeros(15), np.linspace(-1.8, 1.8, 15) * THICKNESS_MM])
    flat = [pressed(flat_mm, 0.03, 10 + seed) for seed in range(4)]
    split = [pressed(ends_mm, 0.08, 20 + seed) for seed in range(4)]
    faces = RigidFaces(kept_thickness=kept_thickness, max_growth=0.0, bars=BarRule(min_f=-1e3))
    assert len(contacts_of([*rest, *flat, *split], faces).touching) == count


def joined(
    place_mm: np.ndarray,
    depth_mm: list[float],
    force_mm2: list[float],
    previous_mm: np.ndarray = NO_CONTACT,
    *,
    previous_s: float = 0.6,
    previous_mm2: float = 1.0,
    earlier: EarlierClusters = NO_CLUSTERS,
    evidence: Evidence | None = None,
    faces: RigidFaces = FACES,
    rise_mm: float = 0.0,
) -> Clusters:
    """What becomes of forces at some places of a sheet that is everywhere as deep as at the nearest place.

    But for the strip about x = 0, which is less deep by `rise_mm`.
    """
    model = MechanicsEstimator().start(slack_sensor()).model
    coefficient_mm = np.zeros((model.patch.node_count, 3))
    away_mm = np.linalg.norm(model.nodes.place_mm[:, None] - place_mm, axis=2)
    coefficient_mm[:, 2] = -np.array(depth_mm)[away_mm.argmin(axis=1)]
    coefficient_mm[np.abs(model.nodes.place_mm[:, 0]) <= 4.5, 2] += rise_mm
    node = away_mm.argmin(axis=0)
    nodal_mm2, label = np.zeros_like(coefficient_mm), np.full(len(coefficient_mm), -1)
    nodal_mm2[node, 2], label[node] = -np.array(force_mm2), np.arange(len(node))
    return faces(
        model,
        coefficient_mm,
        cluster_moments(model.nodes, nodal_mm2, label),
        lambda node: evidence,
        PreviousContacts(
            centre_mm=previous_mm,
            normal_mm2=np.full(len(previous_mm), previous_mm2),
            age_s=np.full(len(previous_mm), previous_s),
        ),
        earlier=earlier,
    )


@pytest.mark.parametrize(
    ("half_mm", "one_mm2", "centre_mm", "ratio", "count"),
    [
        (3.0, 0.31, 0.0, 1.0, 1),
        (3.0, 0.25, 0.0, 1.0, 2),  # the force has grown
        (3.0, 0.31, 2.0, 1.0, 2),  # the contact was elsewhere
        (3.0, 0.31, 0.0, 0.2, 2),
        (4.5, 0.31, 0.0, 1.0, 2),  # so far apart they are seen as two when they begin
    ],
)
def test_near_ends_stay_one_contact_while_its_force_does_not_grow(
    half_mm: float, one_mm2: float, centre_mm: float, ratio: float, count: int
) -> None:
    load = row_mm(half_mm, 2), [1.0, 1.0], [0.3 / (1.0 + ratio), 0.3 * ratio / (1.0 + ratio)]
    apart = joined(*load)
    middle_mm = apart.normal_mm2 @ apart.centre_mm / 0.3
    earlier = EarlierClusters(
        centre_mm=middle_mm[None] + [centre_mm, 0.0], one_mm2=np.array([one_mm2]), nodal_mm2=np.zeros(0)
    )
    found = joined(*load, earlier=earlier)
    assert (len(apart), len(found)) == (2, count)
    assert found.is_one_as_before.tolist() == ([True] if count == 1 else [False, False])
    nearer = RigidFaces(unchanged_thickness=half_mm)  # more than their distance of twice that, over 2 mm
    assert len(joined(*load, earlier=earlier, faces=nearer)) == 2


@pytest.mark.parametrize(("one_mm2", "count"), [(2.1, 2), (2.6, 1)])
def test_near_ends_that_the_markers_show_apart_are_one_only_while_they_are_released(
    one_mm2: float, count: int
) -> None:
    load = row_mm(3.5, 2), [1.0, 1.0], [1.0, 1.0]
    centre_mm = joined(*load).centre_mm.mean(axis=0)[None]
    earlier = EarlierClusters(centre_mm=centre_mm, one_mm2=np.array([one_mm2]), nodal_mm2=np.zeros(0))
    evidence = evidence_of([1.0, 3.5, 0.0, 1.0, -3.5, 0.0, 0.6])
    assert len(joined(*load, earlier=earlier, evidence=evidence)) == count


@pytest.mark.parametrize(
    ("one_mm2", "ratio", "count"),
    [
        (1.0, 0.15, 1),
        (0.8, 0.15, 2),  # the force has grown
        (1.0, 0.05, 2),
        (0.0, 0.4, 1),
    ],
)
def test_a_distant_end_may_be_relieved_while_the_force_does_not_grow(
    one_mm2: float, ratio: float, count: int
) -> None:
    """Another object lowers the sheet under one end of a body that does not move."""
    load = row_mm(8.0, 2), [1.0, 1.0], [1.0 / (1.0 + ratio), ratio / (1.0 + ratio)]
    apart = joined(*load, row_mm(8.0, 2))
    assert len(apart) == 2
    middle_mm = (apart.normal_mm2 @ apart.centre_mm)[None]
    earlier = EarlierClusters(centre_mm=middle_mm, one_mm2=np.array([one_mm2]), nodal_mm2=np.zeros(0))
    assert len(joined(*load, middle_mm, earlier=earlier)) == count


@pytest.mark.parametrize(("one_mm2", "count"), [(2.0, 1), (1.5, 2), (0.0, 2)])
def test_distant_ends_that_the_markers_show_apart_are_one_only_while_the_force_does_not_grow(
    one_mm2: float, count: int
) -> None:
    """A model that is wrong in the same way as before is no new evidence."""
    load = row_mm(4.5, 2), [1.0, 1.0], [1.0, 1.0]
    middle_mm = joined(*load, row_mm(4.5, 2)).centre_mm.mean(axis=0)[None]
    earlier = EarlierClusters(centre_mm=middle_mm, one_mm2=np.array([one_mm2]), nodal_mm2=np.zeros(0))
    evidence = evidence_of([1.0, 4.5, 0.0, 1.0, -4.5, 0.0, 0.6])
    faces = RigidFaces(bars=BarRule(max_ends_f=0.0))
    assert len(joined(*load, middle_mm, earlier=earlier, evidence=evidence, faces=faces)) == count


@pytest.mark.parametrize(
    ("rise_mm", "one_mm2", "count"),
    [
        (0.07, 1.0, 1),
        (0.07, 0.8, 2),  # the force has grown
        (0.07, 0.0, 2),
        (0.15, 1.0, 2),
    ],
)
def test_the_sheet_between_two_ends_may_rise_a_little_while_the_force_does_not_grow(
    rise_mm: float, one_mm2: float, count: int
) -> None:
    load = row_mm(8.0, 2), [1.0, 1.0], [0.5, 0.5]
    middle_mm = joined(*load, row_mm(8.0, 2)).centre_mm.mean(axis=0)[None]
    earlier = EarlierClusters(centre_mm=middle_mm, one_mm2=np.array([one_mm2]), nodal_mm2=np.zeros(0))
    assert len(joined(*load, middle_mm, earlier=earlier, rise_mm=rise_mm)) == count


@pytest.mark.parametrize("depth_mm", [0.8, 1.2])
def test_ends_that_were_one_faint_contact_stay_one_next_to_a_body_of_another_depth(depth_mm: float) -> None:
    """A body of about the same depth may have been a part of what was seen as one contact."""
    place_mm = np.concatenate([row_mm(8.0, 2), [[0.0, 12.0]]])
    force_mm2, before_mm = [0.01, 0.01, 0.03], np.array([[0.0, -1.4], [0.0, 12.9]])
    faces = RigidFaces(pair_rise_share=0.3)  # for a sheet with a step between its two depths
    found = joined(place_mm, [1.0, 1.0, depth_mm], force_mm2, before_mm, previous_mm2=0.005, faces=faces)
    assert found.normal_mm2 == pytest.approx([0.03, 0.02])
    found = joined(place_mm, [1.0, 1.0, 1.0], force_mm2, before_mm, previous_mm2=0.005)
    assert len(found) == 3


def row_mm(half_mm: float, count: int) -> np.ndarray:
    return np.column_stack([np.linspace(-half_mm, half_mm, count), np.zeros(count)])


@pytest.mark.parametrize("half_mm", [6.0, 21.0])
@pytest.mark.parametrize("depths_mm", [(1.0, 1.0, 1.0, 1.0), (1.0, 0.5, 0.8, 0.3)])
def test_four_forces_in_a_row_are_one_bar_if_the_sheet_is_flat_under_them(
    half_mm: float, depths_mm: tuple[float, ...]
) -> None:
    found = joined(row_mm(half_mm, 4), list(depths_mm), [0.01] * 4)
    assert len(found) == (1 if len(set(depths_mm)) == 1 else 4)


@pytest.mark.parametrize(
    ("before", "previous_s", "count"), [((), 0.6, 1), ((0,), 0.6, 1), ((0, 3), 0.27, 4), ((0, 3), 0.2, 1)]
)
def test_four_forces_on_a_plane_are_one_face_unless_two_of_them_have_been_apart(
    before: tuple[int, ...], previous_s: float, count: int
) -> None:
    place_mm = np.array([[-10.0, -6.0], [10.0, -6.0], [10.0, 6.0], [-10.0, 6.0]])
    found = joined(place_mm, [1.0] * 4, [0.01] * 4, place_mm[list(before)], previous_s=previous_s)
    assert len(found) == count


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize(("previous_s", "is_one"), [(0.2, True), (0.27, False)])
def test_forces_are_one_face_only_if_they_began_together(count: int, previous_s: float, is_one: bool) -> None:
    """One of them has been a contact for some time, at its own place."""
    place_mm = np.array([[-8.0, -6.0], [8.0, -6.0], [8.0, 6.0]])[:count]
    found = joined(place_mm, [1.0] * count, [0.01] * count, place_mm[:1], previous_s=previous_s)
    assert len(found) == (1 if is_one else count)


def test_a_contact_that_comes_to_press_with_distant_ends_began_as_one() -> None:
    """It has been there for many frames, but at the middle of the two."""
    place_mm = row_mm(8.0, 2)
    assert len(joined(place_mm, [1.0] * 2, [0.01] * 2, np.zeros((1, 2)))) == 1


@pytest.mark.parametrize(
    ("place_mm", "count"),
    [
        ([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]], 1),
        ([[-20.0, -8.0], [0.0, -8.0], [0.0, 12.0], [20.0, 12.0]], 4),
    ],
)
def test_each_corner_of_a_face_is_flat_with_two_others(place_mm: list[list[float]], count: int) -> None:
    """Bodies that are near each other one by one may have depths on one plane by chance."""
    found = joined(np.array(place_mm), [1.0] * 4, [0.01, 0.05, 0.01, 0.4])
    assert len(found) == count


@pytest.mark.parametrize(
    ("place_mm", "force_mm2", "count"),
    [
        ([[8.0, 0.0], [30.0, 0.0]], [0.01, 0.06], 1),
        ([[8.0, 0.0], [30.0, 0.0]], [0.01, 0.01], 2),
        ([[-11.0, 0.0], [11.0, 0.0]], [0.01, 0.06], 2),
        ([[8.0, -5.0], [8.0, 5.0], [30.0, 0.0]], [0.01, 0.01, 0.06], 1),
    ],
)
def test_an_end_near_the_clamp_needs_more_force(
    place_mm: list[list[float]], force_mm2: list[float], count: int
) -> None:
    """The sheet gives way seven times less 3 thicknesses from its outline than near its middle."""
    assert len(joined(np.array(place_mm), [1.0] * len(place_mm), force_mm2)) == count


@pytest.mark.parametrize(
    ("depth_mm", "before_mm", "count"),
    [
        (0.91, MIDDLE_MM, 1),
        (0.91, NO_CONTACT, 2),
        (0.85, MIDDLE_MM, 2),
    ],
)
def test_a_body_with_two_ends_may_tilt(depth_mm: float, before_mm: np.ndarray, count: int) -> None:
    """Ends of different depths stay one contact, but do not become one."""
    faces = RigidFaces(pair_rise_share=0.1)  # for a sheet with a step between its two depths
    found = joined(row_mm(8.0, 2), [1.0, depth_mm], [0.01] * 2, before_mm, faces=faces)
    assert len(found) == count


@pytest.mark.parametrize(("depth_mm", "count"), [(0.91, 2), (0.85, 3)])
def test_a_body_with_two_ends_may_tilt_next_to_another(depth_mm: float, count: int) -> None:
    place_mm, before_mm = (
        np.concatenate([row_mm(8.0, 2), [[0.0, 12.0]]]),
        np.array([[0.0, -1.4], [0.0, 12.9]]),
    )
    faces = RigidFaces(pair_rise_share=0.3)  # for a sheet with steps between its depths
    found = joined(place_mm, [1.0, depth_mm, 1.4], [0.01, 0.01, 0.03], before_mm, faces=faces)
    assert len(found) == count


@pytest.mark.parametrize("count", [2, 3])
def test_fewer_forces_that_were_apart_stay_apart(count: int) -> None:
    place_mm = row_mm(14.0, count)
    found = joined(place_mm, [1.0] * count, [0.01] * count, place_mm, previous_s=0.07)
    assert len(found) == count
    assert len(joined(place_mm, [1.0] * count, [0.01] * count)) == 1


ENDS_MM = np.array([[5.5, -1.4], [-5.5, -1.4]])


@pytest.mark.parametrize(
    ("before_mm", "before_mm2", "count"),
    [
        ([[0.0, -1.4], [0.0, 14.0]], 0.1, 2),
        ([[-2.5, -1.4], [0.0, 14.0]], 0.1, 2),  # it was seen nearer to one end
        ([[-2.5, -1.4], [0.0, 14.0]], 0.03, 3),  # it may have been seen as one because it was faint
        ([[-4.8, -1.4], [0.0, 14.0]], 0.1, 3),  # the contact was that at one end
        ([[0.0, 14.0]], 0.1, 3),
    ],
)
def test_two_ends_that_were_one_contact_stay_one_next_to_another_body(
    before_mm: list[list[float]], before_mm2: float, count: int
) -> None:
    """The other body is a little deeper, so that the three are no face."""
    place_mm = np.concatenate([ENDS_MM, [[0.0, 14.0]]])
    found = joined(
        place_mm, [1.0, 1.0, 1.07], [0.06, 0.05, 0.05], np.array(before_mm), previous_mm2=before_mm2
    )
    assert len(found) == count
    assert found.normal_mm2.sum() == pytest.approx(0.16)


def test_a_contact_between_two_others_is_not_what_they_were() -> None:
    place_mm = np.concatenate([ENDS_MM, [[0.0, -1.4]]])
    found = joined(place_mm, [1.0, 1.0, 1.5], [0.06, 0.05, 0.05], place_mm[2:], previous_mm2=0.1)
    assert len(found) == 3


@pytest.mark.parametrize(("force_mm2", "count"), [(0.002, 2), (0.008, 5)])
def test_a_weak_force_in_a_line_with_a_bar_does_not_divide_it(force_mm2: float, count: int) -> None:
    found = joined(row_mm(12.0, 5), [1.0, 1.0, 1.0, 1.0, 0.3], [*4 * [0.01], force_mm2])
    assert len(found) == count
    assert found.normal_mm2.sum() == pytest.approx(0.04 + force_mm2)


@pytest.mark.parametrize(("y_mm", "force_mm2", "count"), [(2.0, 0.002, 1), (9.0, 0.002, 2), (9.0, 0.008, 3)])
def test_a_weak_force_within_a_face_is_a_part_of_it(y_mm: float, force_mm2: float, count: int) -> None:
    place_mm = np.array([[-8.0, 1.0], [8.0, 1.0], [0.0, y_mm]])
    found = joined(place_mm, [1.0, 0.96, 0.9], [0.01, 0.01, force_mm2])
    assert len(found) == count
    assert found.normal_mm2.sum() == pytest.approx(0.02 + force_mm2)


def test_the_outline_of_two_places_is_a_rectangle_by_the_moments_of_the_pressure() -> None:
    rest = [pressed(face_mm(), 0.0, seed) for seed in range(3)]
    flat = [pressed(face_mm(), 0.03, 10 + seed) for seed in range(4)]
    (contact,) = contacts_of(
        [*rest, *flat, *(pressed(edges_mm(), 0.08, 20 + seed) for seed in range(4))]
    ).touching
    assert contact.outline is not None
    (ring,) = contact.outline
    assert len(ring.point_mm) == 4
    # the half axes of the ellipse with the same moments times the root of sqrt(3) / 4
    sides_mm = np.linalg.norm(ring.point_mm - np.roll(ring.point_mm, 1, axis=0), axis=1)
    assert np.sort(sides_mm)[[0, -1]] == pytest.approx(
        3.0**0.25 * np.array([contact.half_minor_mm, contact.half_major_mm]), rel=1e-6
    )
    assert contact.area_mm2 == pytest.approx(float(sides_mm[:2].prod()))
    assert abs(contact.area_mm2 - 2.0 * HALF_MM * 4.0) < 2.0 * contact.std("area")
