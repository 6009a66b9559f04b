"""The class of the shape of a pressure, from exact nodal forces of known pressures and noise."""

import numpy as np
import pytest

from manytouch.estimation.mechanics.clusters.patch_kernels import add_ring
from manytouch.values import ContactShape
from synthetic_evidence import NODE, PATCH, evidence_of


@pytest.mark.parametrize(
    ("theta", "shape"),
    [
        ([1.0, 3.0, -2.0, 0.0, 0.0, 0.0], ContactShape.POINT),
        ([1.0, 3.0, -2.0, 5.0, 3.0, 0.0], ContactShape.LINE),
        ([1.0, 3.0, -2.0, 4.0, 1.0, 2.5], ContactShape.PATCH),
        ([1.0, 3.0, -2.0, 3.0, 0.0, 3.0], ContactShape.PATCH),
        ([1.0, 3.0, -2.0, 8.0], ContactShape.RING),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_the_shape_that_was_pressed_is_the_most_probable(theta, shape, seed) -> None:
    evidence = evidence_of(theta, seed)
    one = evidence.fit_one(0.9, np.array([2.5, -1.5]), 4.0 * np.eye(2))
    probability = evidence.shape_probability(one, min_ring_mm=3.2)
    assert probability.sum() == pytest.approx(1.0)
    assert tuple(ContactShape)[int(probability.argmax())] is shape
    assert probability.max() > 0.8


@pytest.mark.parametrize(
    ("centre_mm", "spread_mm2"), [((3.0, 5.0), 1.0), ((-2.0, -2.0), 4.0), ((8.0, 3.0), 9.0)]
)
def test_a_search_for_a_shape_that_ends_far_from_the_best_one_gives_a_point(centre_mm, spread_mm2) -> None:
    evidence = evidence_of([1.0, 3.0, -2.0, 0.0, 0.0, 0.0])
    root_mm = np.sqrt(spread_mm2 + 0.3)
    far, _ = evidence.fit(np.array([0.5, *centre_mm, root_mm, 0.0, root_mm]), [5e-4, *5 * [1e-3]])
    one = evidence.fit_one(0.5, np.array(centre_mm), spread_mm2 * np.eye(2))
    assert far > 10.0 * one.misfit, "the test shows nothing: the search succeeds"
    assert one.force_mm2 == pytest.approx(1.0, abs=3.0 * np.sqrt(one.covariance[0, 0]))
    assert one.centre_mm == pytest.approx([3.0, -2.0], abs=0.02)


def test_a_small_ring_is_a_patch() -> None:
    evidence = evidence_of([1.0, 3.0, -2.0, 2.0])
    one = evidence.fit_one(0.9, np.array([2.5, -1.5]), 4.0 * np.eye(2))
    assert evidence.shape_probability(one, min_ring_mm=3.2)[3] == 0.0


def test_the_nodal_forces_of_a_ring_have_its_sum_centre_and_moment() -> None:
    nodal = np.zeros(len(NODE))
    add_ring(evidence_of([1.0, 3.0, -2.0, 5.0]).combinations.grid, np.array([0.7, 3.0, -2.0, 5.0]), nodal)
    assert nodal.sum() == pytest.approx(0.7)
    centre_mm = nodal @ PATCH.place_mm / nodal.sum()
    np.testing.assert_allclose(centre_mm, [3.0, -2.0], atol=1e-9)
    arm_mm = PATCH.place_mm - centre_mm
    second = (nodal[:, None] * arm_mm).T @ arm_mm / nodal.sum()
    own = 4.0**2 / 3.0 - 2.0 * PATCH.shear_mm2
    np.testing.assert_allclose(second, (12.5 + own) * np.eye(2), rtol=2e-3, atol=0.02)
