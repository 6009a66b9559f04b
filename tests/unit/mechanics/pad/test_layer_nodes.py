"""The response of a layer to forces on the nodes of a spline against closed forms."""

import numpy as np
import pytest

from bonded_pad import POISSON, THICKNESS_MM
from manytouch.mechanics.pad.layer import layer_response
from manytouch.mechanics.pad.layer_nodes import layer_node_response


@pytest.mark.parametrize("depth_mm", [0.0, 1.0])
def test_a_load_on_all_nodes_moves_the_layer_evenly(depth_mm: float) -> None:
    step_mm = (1.3, 0.9)
    response = layer_node_response(step_mm, (9, 11), THICKNESS_MM, POISSON, depth_mm)
    sheared = 2.0 * (1.0 + POISSON)
    pressed = (1.0 + POISSON) * (1.0 - 2.0 * POISSON) / (1.0 - POISSON)
    expected_mm = (THICKNESS_MM - depth_mm) * np.diag([sheared, sheared, pressed])
    np.testing.assert_allclose(np.prod(step_mm) * response.sum(axis=(0, 1)), expected_mm, atol=1e-10)


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize("depth_mm", [0.0, 0.5])
@pytest.mark.parametrize("number", [1, 3])
def test_a_wave_of_forces_moves_the_layer_like_a_wave_of_traction(
    along: int, depth_mm: float, number: int
) -> None:
    step_mm, counts = np.array([1.3, 1.1]), (32, 36)
    response = layer_node_response((1.3, 1.1), counts, THICKNESS_MM, POISSON, depth_mm)
    turn = 2.0 * np.pi * number / counts[along]
    wave = np.fft.fft2(response, axes=(0, 1))[(number, 0) if along == 0 else (0, number)]
    # nodal forces of a traction exp(i k x), and the spline at a node
    wave *= np.prod(step_mm) * np.sinc(turn / (2.0 * np.pi)) ** 4 * (4.0 + 2.0 * np.cos(turn)) / 6.0
    exact = layer_response(np.array([turn / step_mm[along]]), THICKNESS_MM, POISSON, depth_mm)
    across = 1 - along
    expected = np.zeros((3, 3), dtype=complex)
    expected[along, along], expected[across, across] = exact.along[0], exact.across[0]
    expected[2, 2] = exact.normal[0]
    expected[along, 2], expected[2, along] = 1j * exact.squeezed[0], -1j * exact.lifted[0]
    np.testing.assert_allclose(wave, expected, atol=3e-3 * np.abs(expected).max())
