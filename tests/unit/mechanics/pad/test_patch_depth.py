"""The depth under patches of pressure against contacts that are solved on the same layer."""

import numpy as np
import pytest
from scipy.special import ellipk

from bonded_pad import RigidFace, ball_on_layer
from manytouch.mechanics.pad.patch_depth import PatchDepthTable, patch_depth, patch_depth_table

BALL, FACE, RING = range(3)


@pytest.fixture(scope="module")
def layer() -> PatchDepthTable:
    return patch_depth_table(1.0, 0.48)


@pytest.mark.parametrize(
    ("radius", "error"), [(0.1, 1e-3), (0.25, 1e-3), (0.5, 1e-3), (1.0, 5e-3), (1.5, 0.015), (3.0, 0.03)]
)
def test_a_ball_is_as_deep_as_on_the_layer(layer: PatchDepthTable, radius: float, error: float) -> None:
    root, depth, _ = ball_on_layer(radius, 0.48)
    assert patch_depth(root, 0.0, root, BALL, layer) == pytest.approx(depth, rel=error)


@pytest.mark.parametrize("poisson", [0.45, 0.48])
@pytest.mark.parametrize(
    ("radius", "error"), [(0.1, 5e-3), (0.25, 5e-3), (0.5, 0.01), (1.0, 0.015), (1.5, 0.03)]
)
def test_a_rigid_face_is_as_deep_as_on_the_layer(radius: float, error: float, poisson: float) -> None:
    force, root, _, _ = RigidFace(radius, 1.0, poisson, sticks=False).moments
    found = patch_depth(root, 0.0, root, FACE, patch_depth_table(1.0, poisson))
    assert found == pytest.approx(1.0 / force, rel=error)


@pytest.mark.parametrize("ratio", [1.0, 3.0, 10.0])
def test_a_long_narrow_contact_has_the_depth_of_hertz_on_a_half_space(ratio: float) -> None:
    """3 (1 - nu^2) F K(m) / (2 pi E a), where 1 - m is the squared ratio of the half axes (H. Hertz 1882)."""
    half_mm, poisson = np.array([ratio, 1.0]), 0.3
    root_mm = half_mm / np.sqrt(5.0)
    found = patch_depth(root_mm[0], 0.0, root_mm[1], BALL, patch_depth_table(2e4, poisson))
    hertz = 1.5 * (1.0 - poisson**2) * ellipk(1.0 - ratio**-2) / (np.pi * half_mm[0])
    assert found == pytest.approx(hertz, rel=6e-3)


@pytest.mark.parametrize("kind", [BALL, FACE, RING])
def test_a_turned_contact_is_as_deep(layer: PatchDepthTable, kind: int) -> None:
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    root = np.linalg.cholesky(turn @ np.diag([0.9, 0.1]) @ turn.T)
    found = patch_depth(root[0, 0], root[1, 0], root[1, 1], kind, layer)
    assert found == pytest.approx(patch_depth(0.9**0.5, 0.0, 0.1**0.5, kind, layer), rel=2e-3)


def test_the_centre_of_a_ring_is_as_deep_as_by_points_on_it(layer: PatchDepthTable) -> None:
    at = 0.6 * np.sqrt(2.0)
    by_point = np.interp(at, layer.step * np.arange(len(layer.by_distance)), layer.by_distance) / at
    assert patch_depth(0.6, 0.0, 0.6, RING, layer) == pytest.approx(by_point, rel=1e-3)


def test_a_contact_wider_than_the_table_has_a_depth(layer: PatchDepthTable) -> None:
    depths = [patch_depth(root, 0.0, root, kind, layer) for root in (4.0, 8.0) for kind in (BALL, FACE)]
    assert np.all(np.array(depths) > 0.0)
    assert max(depths[2:]) < 0.5 * min(depths[:2])
