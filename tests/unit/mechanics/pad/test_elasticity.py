"""The response of a pad with free sides against the layer, and its symmetries and derivatives."""

import numpy as np
import pytest

from bonded_pad import POISSON, THICKNESS_MM, gaussian_on_layer, gaussian_points
from manytouch.geometry.spline.patch import Nodal, SplinePatch
from manytouch.mechanics.pad.elasticity import PadResponse, pad_response

PATCH = SplinePatch(size_mm=(25.0, 21.0), elements=(19, 15), boundary="soft")
SMALL = SplinePatch(size_mm=(10.0, 8.0), elements=(7, 5), boundary="soft")
ROOT_MM = 1.5
MARKER_MM = np.array([[0.0, 0.0], [1.0, 0.0], [1.5, 2.0], [-3.0, 1.0]])


@pytest.fixture(scope="module")
def response() -> PadResponse:
    return pad_response(PATCH, THICKNESS_MM, POISSON, MARKER_MM)


def gaussian(patch: SplinePatch, axis: int) -> Nodal:
    place_mm, weight = gaussian_points((0.0, 0.0), ROOT_MM)
    return patch.load(place_mm, weight[:, None] * np.eye(3)[axis])


@pytest.mark.parametrize("axis", [0, 2])
def test_far_from_its_sides_a_pad_is_a_layer(response: PadResponse, axis: int) -> None:
    found = np.tensordot(response.marker, gaussian(PATCH, axis), axes=2)
    expected = gaussian_on_layer(MARKER_MM, ROOT_MM, is_shear=axis == 0)
    np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())


def test_the_face_passes_the_markers_on_it(response: PadResponse) -> None:
    coefficient = np.tensordot(response.face, gaussian(PATCH, 2), axes=2)
    found = PATCH.at(MARKER_MM).displacement(coefficient)
    np.testing.assert_allclose(found, np.tensordot(response.marker, gaussian(PATCH, 2), axes=2), atol=1e-10)


def test_the_face_is_symmetric(response: PadResponse) -> None:
    flat = response.face.reshape(3 * PATCH.node_count, -1)
    np.testing.assert_allclose(flat, flat.T, atol=1e-9 * np.abs(flat).max())


@pytest.mark.parametrize("depth_mm", [0.0, 0.7])
def test_derivatives_by_the_parameters_of_the_pad(depth_mm: float) -> None:
    def response(thickness_mm: float, poisson: float, depth_mm: float) -> PadResponse:
        return pad_response(SMALL, thickness_mm, poisson, MARKER_MM, depth_mm)

    found = response(THICKNESS_MM, POISSON, depth_mm)
    step = 1e-4
    for by_marker, by_depth, change in (
        (found.by_poisson, found.depth_by_poisson, (0.0, step, 0.0)),
        (found.by_thickness, found.depth_by_thickness, (step, 0.0, 0.0)),
        (found.by_marker_depth, np.zeros_like(found.depth_by_poisson), (0.0, 0.0, step)),
    ):
        more, less = (
            response(THICKNESS_MM + sign * change[0], POISSON + sign * change[1], depth_mm + sign * change[2])
            for sign in (1.0, -1.0)
        )
        marker = (more.marker - less.marker) / (2.0 * step)
        np.testing.assert_allclose(by_marker, marker, atol=1e-3 * np.abs(marker).max())
        depth = (more.face - less.face)[:, 2, :, 2] / (2.0 * step)
        np.testing.assert_allclose(by_depth, depth, atol=max(1e-3 * np.abs(depth).max(), 1e-9))


def test_even_numbers_of_elements_are_refused() -> None:
    even = SplinePatch(size_mm=(10.0, 8.0), elements=(8, 5), boundary="soft")
    with pytest.raises(ValueError, match=r"odd numbers of elements, not \(8, 5\)"):
        pad_response(even, THICKNESS_MM, POISSON, MARKER_MM)
