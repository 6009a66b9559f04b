"""Projection and its inverse, distortion, and the sign of a press."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from manytouch.geometry.camera import cam_from_sheet, onto_plane, project, ray, undistorted
from manytouch.values import Camera


def camera(model: str = "pinhole", distortion: tuple[float, ...] = (0.0,) * 5, **changes: object) -> Camera:
    parameters: dict[str, object] = {
        "width_px": 1600,
        "height_px": 900,
        "fx_px": 1100.0,
        "fy_px": 1080.0,
        "cx_px": 790.0,
        "cy_px": 455.0,
        "rotation_vector": np.array([0.08, -0.05, 0.03]),
        "translation_mm": np.array([1.0, -2.0, 110.0]),
    }
    return Camera(model=model, distortion=np.array(distortion), **(parameters | changes))


CAMERAS = [
    camera(),
    camera(distortion=(-0.2, 0.05, 0.001, -0.002, 0.01)),
    camera("fisheye", (0.05, -0.01, 0.002, 0.0)),
]


@pytest.mark.parametrize("seen_by", CAMERAS, ids=["pinhole", "brown-conrady", "fisheye"])
@given(x=st.floats(-50, 50), y=st.floats(-30, 30), z=st.floats(-12, 0))
def test_a_point_comes_back_from_its_pixel(seen_by: Camera, x: float, y: float, z: float) -> None:
    point = np.array([[x, y, z]])
    np.testing.assert_allclose(onto_plane(seen_by, project(seen_by, point), z), point, atol=1e-4)


@pytest.mark.parametrize("k1", [-0.2, -0.05, 0.2])
def test_rays_of_the_corners_are_as_exact_as_those_of_the_middle(k1: float) -> None:
    seen_by = camera(distortion=(k1, 0.05, 0.001, -0.002, 0.01), rotation_vector=np.zeros(3))
    pixel = np.array([[800.0, 450.0], [20.0, 20.0], [1580.0, 880.0], [1580.0, 20.0], [np.nan, np.nan]])
    again = project(seen_by, onto_plane(seen_by, pixel, 0.0))
    np.testing.assert_allclose(again, pixel, atol=1e-3)


def test_nominal_pose_is_the_textbook_pinhole() -> None:
    nominal = camera(rotation_vector=np.zeros(3), translation_mm=np.array([0.0, 0.0, 100.0]))
    pixel = project(nominal, np.array([[10.0, -5.0, 0.0]]))
    np.testing.assert_allclose(pixel, [[790 + 1100 * 0.1, 455 - 1080 * 0.05]])


def test_a_pressed_point_moves_away_from_the_optical_axis() -> None:
    nominal = camera(rotation_vector=np.zeros(3), translation_mm=np.array([0.0, 0.0, 100.0]))
    rest, pressed = project(nominal, np.array([[20.0, 10.0, 0.0], [20.0, 10.0, -5.0]]))
    centre = np.array([790.0, 455.0])
    assert np.linalg.norm(pressed - centre) > np.linalg.norm(rest - centre)


def test_undistorted_pixels_are_those_of_the_camera_without_distortion() -> None:
    points = np.array([[30.0, -20.0, 0.0], [-40.0, 25.0, -3.0]])
    bent = camera(distortion=(-0.2, 0.05, 0.001, -0.002, 0.01))
    np.testing.assert_allclose(undistorted(bent, project(bent, points)), project(camera(), points), atol=1e-3)


def test_missing_pixels_stay_missing() -> None:
    for seen_by in CAMERAS:
        result = ray(seen_by, np.array([[np.nan, np.nan], [700.0, 400.0]]))
        assert np.isnan(result[0]).all()
        assert np.isfinite(result[1]).all()


def test_rotation_is_a_rotation() -> None:
    rotation, translation = cam_from_sheet(camera())
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_array_equal(translation, [1.0, -2.0, 110.0])


def test_no_points_give_no_points() -> None:
    assert project(camera(), np.zeros((0, 3))).shape == (0, 2)
    assert ray(camera(), np.zeros((0, 2))).shape == (0, 2)
