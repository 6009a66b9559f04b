"""The response of a bonded layer against its closed form and its limits."""

import numpy as np
import pytest

from bonded_pad import POISSON, THICKNESS_MM, gaussian_on_layer, layer_face
from manytouch.mechanics.pad.layer import layer_response, radial_table

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
