"""The indenters' distances: slopes, lengths, and a few places where they are known."""

import numpy as np
import pytest

from manytouch.simulation.fem.contact.indenters import (
    ConvexBody,
    Fingertip,
    Indenter,
    LyingCylinder,
    Ring,
    RoundPunch,
    Sphere,
    SquarePunch,
    convex_hull,
    signed_distance,
)

CUBE = np.array([[x, y, z] for x in (-3.0, 3.0) for y in (-2.0, 2.0) for z in (1.0, 5.0)])
SHAPES: list[Indenter] = [
    Sphere(radius_mm=5.0),
    Fingertip(semi_axes_mm=(7.0, 10.0, 6.0)),
    RoundPunch(radius_mm=4.0),
    SquarePunch(side_mm=(8.0, 6.0)),
    LyingCylinder(radius_mm=3.0, length_mm=12.0),
    convex_hull(CUBE, edge_radius_mm=0.4),
]
RING = Ring(radius_mm=6.0, wire_radius_mm=1.2)
smooth = pytest.mark.parametrize("indenter", [RING, *SHAPES], ids=lambda shape: type(shape).__name__)
named = pytest.mark.parametrize("indenter", SHAPES, ids=lambda shape: type(shape).__name__)


def near_surface(indenter: Indenter) -> np.ndarray:
    point = np.random.default_rng(1).uniform(-12.0, 12.0, (3000, 3))
    distance, _, _ = signed_distance(indenter, point)
    return point[(distance > -0.35) & (distance < 3.0)]


@smooth
def test_slopes_agree_with_differences(indenter: Indenter) -> None:
    point, step = near_surface(indenter), 1e-6
    assert len(point) > 100
    _, gradient, hessian = signed_distance(indenter, point)
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        above, below = signed_distance(indenter, point + shift), signed_distance(indenter, point - shift)
        np.testing.assert_allclose((above[0] - below[0]) / (2 * step), gradient[:, axis], atol=1e-6)
        np.testing.assert_allclose((above[1] - below[1]) / (2 * step), hessian[:, :, axis], atol=1e-5)


@smooth
def test_distances_are_lengths(indenter: Indenter) -> None:
    """A distance grows by one mm per mm; a soft maximum between faces by less."""
    _, gradient, _ = signed_distance(indenter, near_surface(indenter))
    length = np.linalg.norm(gradient, axis=1)
    if isinstance(indenter, ConvexBody):
        assert length.max() < 1.0 + 1e-9
    else:
        np.testing.assert_allclose(length, 1.0, atol=1e-9)


@named
def test_the_lowest_point_is_the_origin(indenter: Indenter) -> None:
    below = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -2.0]])
    distance, gradient, _ = signed_distance(indenter, below)
    np.testing.assert_allclose(distance, [0.0, 2.0], atol=1e-3)
    np.testing.assert_allclose(gradient[1], [0.0, 0.0, -1.0], atol=1e-5)
    floor = np.random.default_rng(0).uniform(-15.0, 15.0, (500, 3)) * [1.0, 1.0, 0.0]
    assert signed_distance(indenter, floor)[0].min() > -1e-3


def test_a_ring_touches_on_its_circle_only() -> None:
    at = np.array([[6.0, 0.0, 0.0], [0.0, -6.0, -1.0], [0.0, 0.0, 1.2], [7.2, 0.0, 1.2]])
    np.testing.assert_allclose(signed_distance(RING, at)[0], [0.0, 1.0, 4.8, 0.0], atol=1e-12)


def test_known_distances() -> None:
    at = np.array([[10.0, 0.0, 5.0]])
    assert signed_distance(Sphere(radius_mm=5.0), at)[0][0] == pytest.approx(5.0)
    assert signed_distance(RoundPunch(radius_mm=4.0), at)[0][0] == pytest.approx(6.0)
    assert signed_distance(SquarePunch(side_mm=(8.0, 6.0)), at)[0][0] == pytest.approx(6.0)
    assert signed_distance(LyingCylinder(radius_mm=5.0, length_mm=12.0), at)[0][0] == pytest.approx(4.0)
    assert signed_distance(Fingertip(semi_axes_mm=(7.0, 10.0, 5.0)), at)[0][0] == pytest.approx(3.0)


def test_an_ellipsoid_of_equal_axes_is_a_ball() -> None:
    point = near_surface(SHAPES[0])
    ball, ellipsoid = (
        signed_distance(SHAPES[0], point),
        signed_distance(Fingertip(semi_axes_mm=(5.0, 5.0, 5.0)), point),
    )
    for one, other in zip(ball, ellipsoid, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


@pytest.mark.parametrize("edge", [0.0, 5.0])
def test_an_impossible_edge_is_refused(edge: float) -> None:
    with pytest.raises(ValueError, match="edge_radius_mm"):
        RoundPunch(radius_mm=4.0, edge_radius_mm=edge)
