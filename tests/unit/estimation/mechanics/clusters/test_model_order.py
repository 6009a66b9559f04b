"""Number and centres of contacts, from exact nodal forces of known loads."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from manytouch.estimation.mechanics.clusters.evidence import Combinations, Evidence
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters, ForceClusters
from manytouch.estimation.mechanics.clusters.model_order import ModelOrder
from manytouch.estimation.mechanics.clusters.patch_kernels import node_grid
from manytouch.geometry.spline.patch import SplinePatch
from spline_loads import PATCH, SHAPE, SHEAR_MM2
from spline_loads import SHEARED as NODES
from spline_loads import pressed as pressed_thin

pressed = partial(pressed_thin, shear_mm2=SHEAR_MM2)
CLUSTER, ORDER = ForceClusters(merge_share=0.3), ModelOrder()
NONE_BEFORE = np.zeros((0, 2))
NOISE_MM2 = 2e-3


def evidence_of(force_mm2: np.ndarray, noise_mm2: float = NOISE_MM2, patch: SplinePatch = PATCH):
    """A likelihood that is centred on the force of each node, with some noise."""
    seen_mm2 = force_mm2[:, 2] + np.random.default_rng(1).normal(0.0, noise_mm2, len(force_mm2))

    def evidence_at(node: np.ndarray) -> Evidence:
        local = np.full(len(force_mm2), -1, dtype=np.int64)
        local[node] = np.arange(len(node))
        return Evidence(
            combinations=Combinations(
                white=np.eye(len(node)) / noise_mm2,
                white_of_mean=np.eye(len(node)) / noise_mm2,
                node=node,
                grid=node_grid(PATCH, local.reshape(SHAPE)),
            ),
            aim=-seen_mm2[node] / noise_mm2,
            patch=patch,
        )

    return evidence_at


def split(force_mm2: np.ndarray, previous_mm: np.ndarray = NONE_BEFORE) -> Clusters:
    return ORDER(NODES, force_mm2, CLUSTER(NODES, force_mm2), previous_mm, evidence_at=evidence_of(force_mm2))


@pytest.mark.parametrize("share", [1.0, 0.3])
@pytest.mark.parametrize("angle", [0.0, 0.6, np.pi / 2])
@pytest.mark.parametrize("half_mm", [3.6, 4.5])
def test_two_narrow_presses_are_two_contacts(share: float, angle: float, half_mm: float) -> None:
    way = half_mm * np.array([np.cos(angle), np.sin(angle)])
    force = pressed((*(way + 1.0), 1.0, 1.0), (*(1.0 - way), 1.0, share))
    assert len(CLUSTER(NODES, force)) == 1
    found = split(force)
    assert len(found) == 2
    ends = found.centre_mm if share < 1.0 else found.centre_mm[np.argsort(-found.centre_mm @ way)]
    np.testing.assert_allclose(ends, [way + 1.0, 1.0 - way], atol=0.2)
    np.testing.assert_allclose(np.sort(found.normal_mm2), np.sort([1.0, share]), rtol=0.08)
    assert set(np.unique(found.label)) == {-1, 0, 1}


@pytest.mark.parametrize(("shift_mm", "count"), [(0.0, 2), (38.0, 2), (46.0, 1)])
def test_two_contacts_of_which_one_is_not_on_the_sheet_are_one(shift_mm: float, count: int) -> None:
    """The sheet is 88 mm wide: shifted by 46 mm, it ends between the two presses."""
    force = pressed((-4.0, 0.0, 1.0, 1.0), (4.0, 0.0, 1.0, 1.0))
    patch = replace(PATCH, centre_mm=(shift_mm, 0.0))
    found = ORDER(
        NODES, force, CLUSTER(NODES, force), NONE_BEFORE, evidence_at=evidence_of(force, patch=patch)
    )
    assert len(found) == count


def test_one_press_of_any_width_is_one_contact() -> None:
    for radius in (1.0, 4.0, 7.0):
        assert len(split(pressed((3.0, 2.0, radius, 1.0)))) == 1


@pytest.mark.parametrize("half_mm", [5.0, pytest.param(6.0, marks=pytest.mark.slow), 8.0])
def test_a_flat_finger_is_one_contact(half_mm: float) -> None:
    chance = np.random.default_rng(int(half_mm))
    for _ in range(6):
        angle, (x, y) = chance.uniform(0.0, np.pi), chance.uniform(-2.0, 2.0, 2)
        along = np.linspace(-half_mm, half_mm, 13)
        bar = pressed(*((x + s * np.cos(angle), y + s * np.sin(angle), 3.0, 0.1) for s in along))
        assert len(CLUSTER(NODES, bar)) == 1
        assert len(split(bar)) == 1


@pytest.mark.parametrize(
    ("min_bar_stds", "bar_from_clamp", "is_face"), [(2.5, 1.0, True), (1e4, 1.0, False), (2.5, 40.0, False)]
)
def test_a_bar_whose_force_is_not_determined_or_that_is_at_the_clamp_is_a_patch(
    min_bar_stds: float, bar_from_clamp: float, is_face: bool
) -> None:
    bar = pressed(*((s, 0.0, 2.0, 0.1 + 0.1 * (abs(s) > 7.0)) for s in np.linspace(-9.0, 9.0, 13)))
    order = ModelOrder(min_bar_stds=min_bar_stds, bar_from_clamp=bar_from_clamp)
    found = order(NODES, bar, CLUSTER(NODES, bar), NONE_BEFORE, evidence_at=evidence_of(bar))
    assert found.is_face.tolist() == [is_face]
    assert found.normal_mm2[0] == pytest.approx(-bar[:, 2].sum(), rel=0.05)
    assert np.isfinite(found.covariance).all()


def test_a_weak_part_is_not_a_contact() -> None:
    assert len(split(pressed((-4.0, 0.0, 1.0, 1.0), (4.0, 0.0, 1.0, 0.06)))) == 1


def test_two_contacts_of_the_previous_frame_have_lower_limits() -> None:
    force = pressed((-4.0, 0.0, 1.0, 1.0), (4.0, 0.0, 1.0, 0.14))
    assert len(split(force)) == 1
    assert len(split(force, np.array([[-4.0, 0.0], [4.0, 0.0]]))) == 2
    assert len(split(force, np.array([[-4.0, 0.0], [30.0, 0.0]]))) == 1


def test_other_clusters_keep_centre_and_force() -> None:
    force = pressed((-20.0, -10.0, 2.0, 3.0), (8.0, 8.0, 1.0, 1.0), (16.0, 8.0, 1.0, 1.0))
    before, after = CLUSTER(NODES, force), split(force)
    assert (len(before), len(after)) == (2, 3)
    np.testing.assert_allclose(after.centre_mm[0], before.centre_mm[0], atol=0.02)
    np.testing.assert_allclose(after.normal_mm2, [3.0, 1.0, 1.0], rtol=0.02)


def test_a_centre_follows_the_evidence_and_not_the_prior() -> None:
    true = pressed((1.3, 0.8, 1.0, 1.0), shear=(0.1, 0.05))
    drawn = true.copy()
    highest = int(np.argmin(true[:, 2]))
    drawn[:, 2] *= 0.8
    drawn[highest, 2] += 0.2 * true[:, 2].sum()
    clusters = CLUSTER(NODES, drawn)
    found = ORDER(NODES, drawn, clusters, NONE_BEFORE, evidence_at=evidence_of(true))
    assert np.linalg.norm(clusters.centre_mm[0] - [1.3, 0.8]) > 0.2
    np.testing.assert_allclose(found.centre_mm[0], [1.3, 0.8], atol=0.05)
    assert found.torque_mm3[0] == pytest.approx(0.0, abs=0.01)


def test_a_patch_that_lies_beyond_the_nodes_of_the_evidence_does_not_count() -> None:
    """Nothing limits its force there: the forces of the nodes are those of the cluster."""
    whole = pressed((0.0, 0.0, 6.0, 1.0))
    is_seen = NODES.place_mm[:, 0] < 2.0
    part = np.where(is_seen[:, None], whole, 0.0)
    evidence_at = evidence_of(whole)
    clusters = CLUSTER(NODES, part)
    found = ORDER(
        NODES, part, clusters, NONE_BEFORE, evidence_at=lambda node: evidence_at(node[is_seen[node]])
    )
    assert 0.55 < clusters.normal_mm2[0] < 0.75
    assert found.normal_mm2[0] == pytest.approx(clusters.normal_mm2[0])
    np.testing.assert_array_equal(found.centre_mm, clusters.centre_mm)
    assert not np.isfinite(found.fitted_mm2).any()


@pytest.mark.parametrize(("half_mm", "count"), [(5.5, 2), (6.0, 1)])
def test_two_contacts_that_press_beyond_the_nodes_of_the_evidence_are_one(half_mm: float, count: int) -> None:
    """Nothing limits the force of the second one beyond x = 6 mm, half-way between two nodes."""
    whole = pressed((-half_mm, 0.0, 1.0, 1.0), (half_mm, 0.0, 1.0, 1.0))
    is_seen = NODES.place_mm[:, 0] < 6.0
    part = np.where(is_seen[:, None], whole, 0.0)
    clusters, evidence_at = CLUSTER(NODES, part), evidence_of(whole)
    assert len(clusters) == 1
    found = ORDER(
        NODES, part, clusters, NONE_BEFORE, evidence_at=lambda node: evidence_at(node[is_seen[node]])
    )
    assert len(found) == count


def test_clusters_without_evidence_do_not_change() -> None:
    force = pressed((-4.5, 0.0, 1.0, 1.0), (4.5, 0.0, 1.0, 1.0))
    clusters = CLUSTER(NODES, force)
    found = ORDER(NODES, force, clusters, NONE_BEFORE, evidence_at=lambda _: None)
    np.testing.assert_array_equal(found.centre_mm, clusters.centre_mm)


@pytest.mark.parametrize("radius_mm", [3.0, 5.0])
def test_the_area_of_a_wide_press(radius_mm: float) -> None:
    found = split(pressed((1.3, 0.8, radius_mm, 1.0)))
    assert found.area_mm2[0] == pytest.approx(np.pi * radius_mm**2, rel=0.1)
    assert 0.0 < found.area_std_mm2[0] < 0.3 * found.area_mm2[0]


@pytest.mark.parametrize("press", [(0.5, 1.0), (5.0, 0.5)])
def test_a_patch_has_the_force_of_the_evidence(press: tuple[float, float]) -> None:
    """And not that of the nodal forces, which the sparse prior makes too small."""
    true = pressed((1.3, 0.8, *press))
    clusters = CLUSTER(NODES, 0.7 * true)
    found = ORDER(NODES, 0.7 * true, clusters, NONE_BEFORE, evidence_at=evidence_of(true))
    assert clusters.normal_mm2[0] == pytest.approx(0.7 * press[1], rel=0.08)
    assert found.normal_mm2[0] == pytest.approx(press[1], rel=0.02)
    assert np.nansum(found.fitted_mm2) == pytest.approx(found.normal_mm2[0], rel=0.01)
    assert abs(found.normal_mm2[0] - press[1]) < 4.0 * np.sqrt(found.covariance[0, 0, 0])


def test_a_point_or_a_weak_press_has_an_uncertain_area() -> None:
    point, weak = split(pressed((1.3, 0.8, 0.5, 0.5))), split(pressed((1.3, 0.8, 4.0, 0.07)))
    assert point.area_mm2[0] < 3.0 * point.area_std_mm2[0]
    assert weak.area_std_mm2[0] > 0.1 * weak.area_mm2[0]
