"""Positions and displacements in the plane from a table, against the projection and plain numpy."""

import numpy as np
import pytest

from manytouch.geometry.camera import onto_plane
from manytouch.geometry.plane_kernels import displacements_in_plane, look_up
from manytouch.geometry.plane_table import plane_from_px, plane_table
from manytouch.values import Camera


@pytest.fixture(scope="module")
def camera() -> Camera:
    return Camera(
        width_px=320,
        height_px=200,
        fx_px=400.0,
        fy_px=410.0,
        cx_px=161.0,
        cy_px=98.0,
        distortion=np.array([-0.1, 0.02, 1e-3, -5e-4, 0.0]),
        rotation_vector=np.array([0.05, -0.08, 0.3]),
        translation_mm=np.array([1.0, -2.0, 80.0]),
    )


def test_displacements_and_covariances_equal_their_definitions(camera: Camera) -> None:
    chance = np.random.default_rng(0)
    rest_px = chance.uniform([20.0, 20.0], [300.0, 180.0], (60, 2))
    rest_mm = onto_plane(camera, rest_px)[:, :2]
    pixel = rest_px + chance.normal(0.0, 3.0, rest_px.shape)
    factor = chance.normal(0.0, 0.1, (60, 2, 2))
    covariance = factor @ factor.transpose(0, 2, 1)
    matrix = plane_from_px(camera, rest_px)
    nodes = plane_table(camera).nodes
    moved, found = displacements_in_plane(pixel, covariance, nodes, rest_mm, matrix)
    np.testing.assert_allclose(moved, onto_plane(camera, pixel)[:, :2] - rest_mm, atol=1e-5)
    np.testing.assert_allclose(found, matrix @ covariance @ matrix.transpose(0, 2, 1), atol=1e-12)


def test_pixels_that_are_not_known_have_no_position(camera: Camera) -> None:
    pixel = np.array([[np.nan, 3.0], [10.0, 20.0], [np.inf, 0.0]])
    found = look_up(pixel, plane_table(camera).nodes)
    np.testing.assert_array_equal(np.isfinite(found), [[False, False], [True, True], [False, False]])
