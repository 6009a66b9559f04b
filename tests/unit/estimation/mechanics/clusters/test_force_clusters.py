"""Clusters of nodal forces: force, place and size of loads whose nodal forces are known exactly."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters, EarlierClusters, ForceClusters
from spline_loads import NODES, SHAPE, SHEAR_MM2, SHEARED, pressed

FIND = ForceClusters()


def test_one_press_has_exactly_its_force_place_and_area() -> None:
    found = FIND(NODES, pressed((7.3, -4.1, 4.5, 0.8), shear=(0.2, -0.1)))
    assert len(found) == 1
    np.testing.assert_allclose(found.centre_mm[0], [7.3, -4.1], atol=1e-9)
    np.testing.assert_allclose(found.force_mm2[0], [0.16, -0.08, -0.8], atol=1e-12)
    assert found.area_mm2[0] == pytest.approx(np.pi * 4.5**2, rel=2e-3)
    assert found.torque_mm3[0] == pytest.approx(0.0, abs=1e-12)


def test_a_press_on_a_sheared_sheet() -> None:
    """Outer nodes have small tensile forces, which are left out."""
    force = pressed((7.3, -4.1, 4.5, 0.8), shear=(0.2, -0.1), shear_mm2=SHEAR_MM2)
    assert 0.0 < force[:, 2].max() < 0.05 * -force[:, 2].min()
    found = FIND(SHEARED, force)
    np.testing.assert_allclose(found.centre_mm[0], [7.3, -4.1], atol=0.06)
    np.testing.assert_allclose(found.force_mm2[0], [0.16, -0.08, -0.8], rtol=0.04)
    assert found.area_mm2[0] == pytest.approx(np.pi * 4.5**2, rel=0.2)


def test_a_couple_of_tangential_forces_is_a_torque() -> None:
    force = pressed((-8.0, 3.0, 4.0, 1.0))
    arm = NODES.place_mm[:, 0] + 8.0
    force[:, 1] = 0.1 * -force[:, 2] * arm
    inertia = float((-force[:, 2] * arm**2).sum())
    found = FIND(NODES, force)
    assert found.torque_mm3[0] == pytest.approx(0.1 * inertia, rel=1e-9)


def test_the_strongest_comes_first_and_two_that_are_apart_are_two() -> None:
    found = FIND(NODES, pressed((-16.0, 0.0, 3.0, 0.5), (12.0, 8.0, 3.0, 1.5)))
    np.testing.assert_allclose(-found.force_mm2[:, 2], [1.5, 0.5], rtol=1e-6)
    np.testing.assert_allclose(found.centre_mm, [[12.0, 8.0], [-16.0, 0.0]], atol=1e-6)
    assert set(np.unique(found.label)) == {-1, 0, 1}


@pytest.mark.parametrize(("gap_mm", "count"), [(5.0, 1), (14.0, 2)])
def test_a_shallow_saddle_joins(gap_mm: float, count: int) -> None:
    force = pressed((-gap_mm / 2, 0.0, 3.0, 1.0), (gap_mm / 2, 0.0, 3.0, 1.0))
    found = FIND(NODES, force)
    assert len(found) == count
    assert -found.force_mm2[:, 2].sum() == pytest.approx(2.0)


@pytest.mark.parametrize(("between", "count"), [(0.0, 2), (0.15, 1)])
def test_a_gap_without_forces_divides_although_the_strong_contact_fills_it_when_smoothed(
    between: float, count: int
) -> None:
    force = np.zeros((*SHAPE, 3))
    row, column = SHAPE[0] // 2, SHAPE[1] // 2
    rows = [[0.14, 0.02, 0.0, 0.0, 0.0], [0.36, 0.21, between, 1.84, 1.11], [0.04, 0.03, 0.0, 3.1, 1.8]]
    force[row - 1 : row + 2, column - 2 : column + 3, 2] = -np.array(rows)
    found = FIND(NODES, force.reshape(-1, 3))
    assert len(found) == count
    assert -found.force_mm2[:, 2].sum() == pytest.approx(np.sum(rows))


def test_weak_clusters_and_those_near_the_clamp_are_left_out() -> None:
    strong, weak, ghost = (0.0, 0.0, 3.0, 2.0), (20.0, 20.0, 3.0, 0.05), (41.0, 0.0, 2.0, 0.5)
    found = FIND(NODES, pressed(strong, weak, ghost))
    assert len(found) == 1
    assert set(np.unique(found.label)) == {-1, 0}


def test_no_forces_make_no_clusters() -> None:
    found = FIND(NODES, np.zeros((SHAPE[0] * SHAPE[1], 3)))
    assert isinstance(found, Clusters)
    assert len(found) == 0
    assert len(FIND(NODES, -pressed((0.0, 0.0, 4.0, 1.0)))) == 0


def test_both_orders_of_the_nodes_are_treated_alike() -> None:
    turn = np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE).T.ravel()
    turned = replace(NODES, shape=SHAPE[::-1], place_mm=NODES.place_mm[turn])
    force = pressed((-16.0, 4.0, 3.0, 0.5), (12.0, 8.0, 5.0, 1.5))
    found, other = FIND(NODES, force), FIND(turned, force[turn])
    np.testing.assert_allclose(other.centre_mm, found.centre_mm)
    np.testing.assert_allclose(other.area_mm2, found.area_mm2)
    np.testing.assert_array_equal(other.label, found.label[turn])


def test_a_weak_press_near_a_strong_one_keeps_its_outer_nodes() -> None:
    # nodes behind the weak peak must not join the strong one, whose slope surrounds it
    force = pressed((-8.0, 0.0, 3.0, 1.0), (8.0, 0.0, 3.0, 0.3))
    force[:, 2] -= 0.004 * np.exp(-0.5 * ((NODES.place_mm / 12.0) ** 2).sum(axis=1))
    found = FIND(NODES, force)
    assert len(found) == 2
    behind = NODES.place_mm[found.label == 0, 0]
    assert behind.max() < 6.0
    np.testing.assert_allclose(found.centre_mm, [[-8.0, 0.0], [8.0, 0.0]], atol=0.8)


def test_the_force_with_which_a_contact_was_one_is_that_of_the_last_steady_frame() -> None:
    def followed(
        earlier: EarlierClusters, force: float, x_mm: float = 0.0, *, held: bool = False
    ) -> EarlierClusters:
        nodal = pressed((x_mm, 0.0, 3.0, force))
        clusters = FIND(NODES, nodal)
        clusters = replace(clusters, is_one_as_before=np.array([held]))
        return earlier.followed_by(clusters, nodal[:, 2], 1.0)

    first = followed(EarlierClusters.none(), 1.0)
    assert first.one_mm2.tolist() == [0.0]
    steady = followed(first, 1.2)
    np.testing.assert_allclose(steady.one_mm2, [1.2], rtol=1e-6)
    np.testing.assert_allclose(followed(steady, 3.0).one_mm2, [1.2], rtol=1e-6)  # a sudden press
    np.testing.assert_allclose(followed(steady, 1.3, held=True).one_mm2, [1.2], rtol=1e-6)
    np.testing.assert_allclose(followed(steady, 0.9).one_mm2, [0.9], rtol=1e-6)
    assert followed(steady, 1.2, 8.0).one_mm2.tolist() == [0.0]  # another contact
