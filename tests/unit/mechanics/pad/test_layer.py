"""The response of a bonded layer against its closed form and its limits."""

import numpy as np
import pytest

from bonded_pad import POISSON, THICKNESS_MM, gaussian_on_layer, layer_face
from manytouch.mechanics.pad.layer import layer_response, point_depth, radial_table

WAVES = np.array([0.01, 0.05, 0.2, 0.5, 1.0, 2.0, 4.0])


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45, 0.499])
def test_the_face_follows_the_closed_form(poisson: float) -> None:
    found = layer_response(WAVES, THICKNESS_MM, poisson)
    across, along, normal, squeezed = layer_face(WAVES, THICKNESS_MM, poisson)
    np.testing.assert_allclose(found.across, across, rtol=1e-10)
    np.testing.assert_allclose(found.along, along, rtol=1e-8)
    np.testing.assert_allclose(found.normal, normal, rtol=1e-6)
    np.testing.assert_allclose(found.squeezed, squeezed, rtol=1e-6)
    np.testing.assert_allclose(found.lifted, squeezed, rtol=1e-6)  # Maxwell and Betti


def test_a_thin_incompressible_layer_is_squeezed_by_the_gradient_of_the_pressure() -> None:
    wave, shear, poisson = np.array([0.01]), 0.5 / 1.4999, 0.49999
    found = layer_response(wave, 1.0, poisson)
    assert found.along[0] == pytest.approx(1.0 / shear, rel=1e-3)
    assert found.squeezed[0] == pytest.approx(0.5 * wave[0] / (shear * wave[0]) * wave[0], rel=0.35)


def test_a_short_wave_is_that_of_a_half_space() -> None:
    wave, shear = np.array([10.0]), 0.5 / (1.0 + POISSON)
    found = layer_response(wave, THICKNESS_MM, POISSON)
    assert found.normal[0] == pytest.approx((1.0 - POISSON) / (shear * wave[0]), rel=1e-6)
    assert found.squeezed[0] == pytest.approx(-(1.0 - 2.0 * POISSON) / 2.0 / (shear * wave[0]), rel=1e-6)


def test_the_bonded_face_does_not_move() -> None:
    found = layer_response(WAVES, THICKNESS_MM, POISSON, THICKNESS_MM)
    for part in (found.across, found.along, found.normal, found.squeezed, found.lifted):
        np.testing.assert_allclose(part, 0.0, atol=1e-9)


@pytest.mark.parametrize("root_mm", [0.6, 1.5])
def test_radial_tables_are_fourier_sums(root_mm: float) -> None:
    point_mm = np.array([[0.0, 0.0], [1.0, 0.0], [1.5, 2.0], [-3.0, 1.0], [5.0, -4.0]])
    away_mm, angle = np.hypot(*point_mm.T), np.arctan2(point_mm[:, 1], point_mm[:, 0])
    table = radial_table(away_mm, np.array([root_mm]), THICKNESS_MM, POISSON)[0]
    press = gaussian_on_layer(point_mm, root_mm, is_shear=False)
    found = np.column_stack([table[:, 0] * np.cos(angle), table[:, 0] * np.sin(angle), table[:, 1]])
    np.testing.assert_allclose(found, press, atol=3e-3 * np.abs(press).max())
    shear = gaussian_on_layer(point_mm, root_mm, is_shear=True)
    along = table[:, 2] + table[:, 3] * np.cos(2.0 * angle)
    found = np.column_stack([along, table[:, 3] * np.sin(2.0 * angle), table[:, 4] * np.cos(angle)])
    np.testing.assert_allclose(found, shear, atol=3e-3 * np.abs(shear).max())


def _field(point_mm: np.ndarray, root_mm: float, load: str) -> np.ndarray:
    """(k, 3) displacement of points by a Gaussian at the origin, from tables without dots."""
    away_mm, angle = np.hypot(*point_mm.T), np.arctan2(point_mm[:, 1], point_mm[:, 0])
    table = radial_table(away_mm, np.array([root_mm]), THICKNESS_MM, POISSON, 0.4)[0]
    return _of_table(table, angle, load)


def _of_table(table: np.ndarray, angle: np.ndarray, load: str) -> np.ndarray:
    if load == "press":
        return np.column_stack([table[:, 0] * np.cos(angle), table[:, 0] * np.sin(angle), table[:, 1]])
    along = table[:, 2] + table[:, 3] * np.cos(2.0 * angle)
    return np.column_stack([along, table[:, 3] * np.sin(2.0 * angle), table[:, 4] * np.cos(angle)])


@pytest.mark.parametrize("load", ["press", "shear"])
@pytest.mark.parametrize("away", [(0.0, 0.0), (0.9, 0.5), (2.0, -1.0)])
def test_a_dot_moves_with_the_centroid_of_its_area(away: tuple[float, float], load: str) -> None:
    """Outlines that move by a small part of the displacement; the depth is the mean over the disc."""
    radius_mm, root_mm, small = 0.7, 0.6, 1e-5
    turn = 2.0 * np.pi * np.arange(4000) / 4000
    rim_mm = np.array(away) + radius_mm * np.column_stack([np.cos(turn), np.sin(turn)])
    moved_mm = rim_mm + small * _field(rim_mm, root_mm, load)[:, :2]

    def centroid(corner_mm: np.ndarray) -> np.ndarray:
        following = np.roll(corner_mm, -1, axis=0)
        cross = corner_mm[:, 0] * following[:, 1] - following[:, 0] * corner_mm[:, 1]
        return np.asarray((cross[:, None] * (corner_mm + following)).sum(axis=0) / (3.0 * cross.sum()))

    place, weight = np.polynomial.legendre.leggauss(12)
    ring = radius_mm * np.sqrt(0.5 * (place + 1.0))
    inside = np.stack([np.outer(ring, np.cos(turn[::100])), np.outer(ring, np.sin(turn[::100]))], axis=-1)
    depth = _field((inside + away).reshape(-1, 2), root_mm, load)[:, 2].reshape(12, -1).mean(axis=1)
    expected = [*((centroid(moved_mm) - centroid(rim_mm)) / small), 0.5 * weight @ depth]
    distance_mm, angle = np.array([np.hypot(*away)]), np.array([np.arctan2(away[1], away[0])])
    table = radial_table(
        distance_mm, np.array([root_mm]), THICKNESS_MM, POISSON, 0.4, dot_radius_mm=radius_mm
    )
    found = _of_table(table[0], angle, load)[0]
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("root_mm", [0.3, 1.0, 3.0])
def test_the_depth_by_a_point_adds_up_to_that_of_a_gaussian(root_mm: float) -> None:
    away_mm = np.linspace(0.0, 8.0 * root_mm, 4001)
    by_point = point_depth(away_mm, THICKNESS_MM, POISSON)
    density = np.exp(-0.5 * (away_mm / root_mm) ** 2) / root_mm**2
    (table,) = radial_table(np.zeros(1), np.array([root_mm]), THICKNESS_MM, POISSON)
    assert np.trapezoid(density * by_point, away_mm) == pytest.approx(table[0, 1], rel=2e-3)
