"""Bars, which press with their ends, are one contact, two balls are two, and shear moves no centre."""

import numpy as np
import pytest

from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.clusters.bars import MIN_F, BarRule, f_of_two
from manytouch.estimation.mechanics.clusters.evidence import Evidence
from manytouch.estimation.mechanics.clusters.face_fits import fit_bar, fit_elliptic_face
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters, cluster_moments
from manytouch.estimation.mechanics.clusters.patch_kernels import (
    ALONG,
    NodeGrid,
    add_bar,
    add_patches,
    bar_profile,
    node_grid,
)
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from pressed_sheet import THICKNESS_MM, contacts_of, disc_mm, pressed, slack_sensor
from spline_loads import PATCH, SHAPE, SHEAR_MM2, nodal_press
from synthetic_evidence import evidence_of

BAR = np.array([0.8, 5.1, -3.2, 6.0, 2.5, 1.4, 0.3, 0.9])


def slack_grid() -> tuple[NodeGrid, int]:
    nodes = np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    return node_grid(PATCH, nodes), nodes.size


def test_the_nodal_forces_of_a_bar() -> None:
    grid, nodes = slack_grid()
    nodal = np.zeros(nodes)
    add_bar(grid, BAR, nodal)
    across, share_across = np.polynomial.legendre.leggauss(3)
    side = BAR[5] * np.array([-BAR[4], BAR[3]]) / np.hypot(BAR[3], BAR[4])
    place = BAR[1:3] + ALONG[:, None, None] * BAR[3:5] + across[:, None] * side
    each = BAR[0] * np.outer(bar_profile(BAR), 0.5 * share_across)
    wanted = nodal_press(place.reshape(-1, 2), each.ravel(), SHEAR_MM2)
    np.testing.assert_allclose(nodal, wanted.ravel(), atol=1e-12)
    assert nodal.sum() == pytest.approx(BAR[0])


@pytest.mark.parametrize("seed", range(3))
def test_a_bar_is_found_again(seed: int) -> None:
    true = [1.0, 3.0, -2.0, 9.0, 4.0, 2.0, -0.4, 1.2]
    evidence = evidence_of(true, seed)
    pair = evidence.fit_two(np.array([0.5, 0.5]), np.array([[-3.0, -5.0], [9.0, 1.0]]), 2.0)
    bar = fit_bar(evidence, pair)
    mean = bar_profile(np.array(true)) @ ALONG
    error = [bar.force_mm2 - 1.0, *(bar.centre_mm - [3.0 + 9.0 * mean, -2.0 + 4.0 * mean])]
    assert (np.abs(error) < 3.5 * np.sqrt(np.diag(bar.covariance)[:3])).all()
    np.testing.assert_allclose(bar.outline_mm.mean(axis=0), [3.0, -2.0], atol=0.3)
    assert np.linalg.norm(bar.outline_mm[0] - bar.outline_mm[3]) == pytest.approx(
        2 * np.hypot(9.0, 4.0), rel=0.03
    )
    assert bar.nodal_mm2.sum() == pytest.approx(bar.force_mm2, rel=1e-6)
    assert f_of_two(evidence, pair.misfit, bar) < 0.0


def test_the_nodal_forces_of_an_elliptic_face() -> None:
    """Under even pressure they are about those of the ellipse; a loaded edge widens it."""
    ellipse = np.array([0.8, 5.1, -3.2, 2.0, 0.7, 1.4])
    grid, nodes = slack_grid()
    even, face, loaded = np.zeros((3, nodes))
    add_patches(ellipse, grid, even)
    add_patches(np.array([*ellipse, 0.0, 0.0, 0.0]), grid, face)
    add_patches(np.array([*ellipse, 1.5, 0.0, 0.0]), grid, loaded)
    np.testing.assert_allclose(face, even, atol=0.04 * even.max())
    assert loaded.sum() == pytest.approx(0.8)
    assert loaded.max() < 0.97 * even.max()


@pytest.mark.parametrize("seed", range(3))
def test_a_face_that_presses_with_its_edge_is_found_again(seed: int) -> None:
    evidence = evidence_of([1.0, 3.0, -2.0, 4.0, 0.0, 4.0, 1.2, 0.0, 0.0], seed)
    one = evidence.fit_one(0.9, np.array([2.5, -1.5]), 9.0 * np.eye(2))
    face = fit_elliptic_face(evidence, one)
    assert one.misfit - face.misfit > 100.0
    error = [face.force_mm2 - 1.0, *(face.centre_mm - [3.0, -2.0])]
    assert (np.abs(error) < 3.5 * np.sqrt(np.diag(face.covariance)[:3])).all()
    radius_mm = np.linalg.norm(face.outline_mm - face.centre_mm, axis=1)
    np.testing.assert_allclose(radius_mm, 8.0, rtol=0.05)


def test_an_even_disc_is_no_face_with_a_loaded_edge() -> None:
    evidence = evidence_of([1.0, 3.0, -2.0, 4.0, 0.0, 4.0])
    one = evidence.fit_one(0.9, np.array([2.5, -1.5]), 9.0 * np.eye(2))
    assert one.misfit - fit_elliptic_face(evidence, one).misfit < 10.0


@pytest.mark.parametrize("seed", range(3))
def test_two_points_are_no_bar(seed: int) -> None:
    evidence = evidence_of([0.5, -3.0, -5.0, 0.5, 9.0, 1.0, 0.4], seed)
    pair = evidence.fit_two(np.array([0.5, 0.5]), np.array([[-3.0, -5.0], [9.0, 1.0]]), 0.5)
    assert f_of_two(evidence, pair.misfit, fit_bar(evidence, pair)) > 10.0 * MIN_F


def bar_mm() -> np.ndarray:
    """Places of even weight on 12 x 3 mm: three times as dense at both ends as in the middle."""
    share = (np.arange(41) + 0.5) / 41
    dense = np.interp(
        share, np.cumsum(1.0 + 2.0 * np.linspace(-1, 1, 41) ** 2) / 68.35, np.linspace(-6, 6, 41)
    )
    return np.stack(np.meshgrid(dense, [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 2)


def balls_mm(gap_mm: float) -> np.ndarray:
    return np.concatenate([disc_mm(0.5 * side * gap_mm, 0.0, 1.0) for side in (-1, 1)])


@pytest.mark.parametrize(("place_mm", "count"), [(bar_mm(), 1), (balls_mm(6.0), 2), (balls_mm(12.0), 2)])
def test_the_number_of_contacts(place_mm: np.ndarray, count: int) -> None:
    grids = [pressed(place_mm, force_mm2, seed) for seed, force_mm2 in enumerate([0.0] * 3 + [0.08] * 4)]
    contacts = contacts_of(grids)
    assert len(contacts.touching) == count
    total_mm2 = sum(contact.normal_force_over_E_mm2 for contact in contacts.touching)
    assert total_mm2 == pytest.approx(0.08, rel=0.06)
    if count == 1:
        (contact,) = contacts.touching
        np.testing.assert_allclose(contact.centre_mm, 0.0, atol=0.4)
        assert 5.0 < contact.half_major_mm < 9.0
        assert abs(contact.orientation_rad) < 0.1


def test_shear_and_the_centre_of_a_contact_with_friction() -> None:
    """A shear on the face of the contact acts on the middle surface with the couple of half a thickness."""
    ratio = 0.6
    place_mm = disc_mm(4.0 + 0.5 * THICKNESS_MM * ratio, -3.0, 1.5)
    grids = [pressed(place_mm, 0.05 * min(seed, 1), seed, 0.05 * ratio) for seed in (0, 0, 1, 2, 3, 4)]
    (contact,) = contacts_of(grids).touching
    assert contact.shear_over_E_mm2[0] == pytest.approx(0.05 * ratio, rel=0.15)
    assert abs(contact.shear_over_E_mm2[1]) < 0.05 * 0.05
    np.testing.assert_allclose(contact.centre_mm, [4.0, -3.0], atol=0.15)


def two_places() -> tuple[InversionModel, Evidence, Clusters, float]:
    """Two equal forces 4 thicknesses apart along x, each a cluster of one node, and their F against a bar."""
    half_mm = 2.0 * THICKNESS_MM
    evidence = evidence_of([1.0, half_mm, 0.0, 1.0, -half_mm, 0.0, 0.6])
    model = MechanicsEstimator().start(slack_sensor()).model
    force_mm2, label = np.zeros((model.patch.node_count, 3)), np.full(model.patch.node_count, -1)
    for number, x_mm in enumerate((half_mm, -half_mm)):
        node = np.linalg.norm(model.nodes.place_mm - [x_mm, 0.0], axis=1).argmin()
        force_mm2[node, 2], label[node] = -1.0, number
    clusters = cluster_moments(model.nodes, force_mm2, label)
    pair = evidence.fit_two(clusters.normal_mm2, clusters.centre_mm, 1.0)
    return model, evidence, clusters, f_of_two(evidence, pair.misfit, fit_bar(evidence, pair))


@pytest.mark.parametrize(
    ("was_two", "was_one", "seen_apart_thickness", "is_bar"),
    [
        (False, False, 2.9, False),
        (True, False, 2.9, False),
        (False, True, 2.9, True),
        (False, True, 9.0, False),
    ],
)
def test_one_contact_becomes_two_only_if_they_could_begin_as_one_or_the_markers_are_clear(
    was_two: bool, was_one: bool, seen_apart_thickness: float, is_bar: bool
) -> None:
    model, evidence, clusters, f = two_places()
    assert f > 100.0
    rule = BarRule(min_f=0.5 * f, seen_apart_thickness=seen_apart_thickness)
    found = rule(model, clusters, np.arange(2), lambda node: evidence, was_two=was_two, was_one=was_one)
    assert found is is_bar
    unchanged = rule(
        model,
        clusters,
        np.arange(2),
        lambda node: evidence,
        was_two=was_two,
        was_one=was_one,
        is_unchanged=True,
    )
    assert unchanged is was_one
    clear = BarRule(min_f=0.1 * f, seen_apart_thickness=seen_apart_thickness)
    assert not clear(model, clusters, np.arange(2), lambda node: evidence, was_two=was_two, was_one=was_one)


@pytest.mark.parametrize(
    ("near_thickness", "was_two", "is_bar"), [(4.5, False, True), (4.5, True, False), (3.5, False, False)]
)
def test_near_contacts_are_two_only_if_the_markers_are_clear(
    near_thickness: float, was_two: bool, is_bar: bool
) -> None:
    """F is twice the usual limit."""
    model, evidence, clusters, f = two_places()
    rule = BarRule(min_f=0.5 * f, near_thickness=near_thickness)
    found = rule(model, clusters, np.arange(2), lambda node: evidence, was_two=was_two, was_one=False)
    assert found is is_bar


@pytest.mark.parametrize(
    ("min_f", "max_ends_f", "may_be_ends", "is_bar"),
    [
        (0.1, 2.0, True, None),
        (0.1, 0.5, True, False),  # too clear for the ends of a face
        (0.1, 2.0, False, False),
        (2.0, 0.5, True, True),
    ],
)
def test_distant_patches_may_be_the_ends_of_a_face_unless_they_are_clear(
    min_f: float, max_ends_f: float, may_be_ends: bool, is_bar: bool | None
) -> None:
    model, evidence, clusters, f = two_places()
    rule = BarRule(min_f=min_f * f, max_ends_f=max_ends_f * f)
    earlier = {"was_two": False, "was_one": False, "may_be_ends": may_be_ends}
    assert rule(model, clusters, np.arange(2), lambda node: evidence, **earlier) is is_bar


def test_a_bar_beyond_the_nodes_decides_nothing_about_distant_patches() -> None:
    model, evidence, clusters, _ = two_places()
    earlier = {"was_two": False, "was_one": False, "may_be_ends": True}
    rule = BarRule(max_ends_f=0.0, min_inside=2.0)
    assert rule(model, clusters, np.arange(2), lambda node: evidence, **earlier) is None
    assert BarRule(max_ends_f=0.0)(model, clusters, np.arange(2), lambda node: evidence, **earlier) is False
