"""The class of the shape of a pressure, from exact nodal forces of known pressures and noise."""

import numpy as np
import pytest

from manytouch.estimation.mechanics.clusters.evidence import Combinations, Evidence
from manytouch.estimation.mechanics.clusters.patch_kernels import add_ring
from manytouch.geometry.spline import basis
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.values import ContactShape

PATCH = SplinePatch(size_mm=(64.0, 48.0), elements=(16, 12))
NODE = np.arange(PATCH.node_count)
NOISE_MM2 = 2e-3


def evidence_of(theta: list[float], seed: int = 0) -> Evidence:
    """A likelihood around the nodal forces of a pressure with some parameters."""
    grid = NODE.reshape(PATCH.shape)
    along_x = grid if PATCH.is_x_slow else grid.T
    knot_mm = [
        basis.knots(PATCH.size_mm[axis], PATCH.elements[axis]) + PATCH.corner_mm[axis] for axis in range(2)
    ]
    white = np.eye(len(NODE)) / NOISE_MM2
    evidence = Evidence(
        combinations=Combinations(
            white=white,
            white_of_mean=white,
            knot_x_mm=knot_mm[0],
            knot_y_mm=knot_mm[1],
            node=NODE,
            local=np.ascontiguousarray(np.pad(along_x, PATCH.dropped, constant_values=-1)),
        ),
        aim=np.zeros(len(NODE)),
        patch=PATCH,
        columns=np.zeros((0, len(NODE))),
    )
    noise = np.random.default_rng(seed).standard_normal(len(NODE))
    seen = evidence._nodal(np.array(theta)) / NOISE_MM2 + noise
    return Evidence(
        **{name: getattr(evidence, name) for name in Evidence.__slots__ if name != "aim"}, aim=seen
    )


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


def test_a_small_ring_is_a_patch() -> None:
    evidence = evidence_of([1.0, 3.0, -2.0, 2.0])
    one = evidence.fit_one(0.9, np.array([2.5, -1.5]), 4.0 * np.eye(2))
    assert evidence.shape_probability(one, min_ring_mm=3.2)[3] == 0.0


def test_the_nodal_forces_of_a_ring_have_its_sum_centre_and_moment() -> None:
    nodal = np.zeros(len(NODE))
    add_ring(evidence_of([1.0, 3.0, -2.0, 5.0])._grid(), np.array([0.7, 3.0, -2.0, 5.0]), nodal)
    assert nodal.sum() == pytest.approx(0.7)
    centre_mm = nodal @ PATCH.place_mm / nodal.sum()
    np.testing.assert_allclose(centre_mm, [3.0, -2.0], atol=1e-9)
    arm_mm = PATCH.place_mm - centre_mm
    second = (nodal[:, None] * arm_mm).T @ arm_mm / nodal.sum()
    own = 4.0**2 / 3.0 - 2.0 * PATCH.shear_mm2
    np.testing.assert_allclose(second, (12.5 + own) * np.eye(2), rtol=2e-3, atol=0.02)
