"""Snell's law through pad and window: limits, reversibility, and one ray worked out step by step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from manytouch.errors import SensorError
from manytouch.geometry.camera import cam_from_sheet, onto_plane, project
from manytouch.geometry.refraction import apparent_mm, onto_plane_through_window, project_through_window
from manytouch.values import Camera, Sheet


def camera(model: str = "pinhole", distortion: tuple[float, ...] = (0.0,) * 5, **changes: object) -> Camera:
    parameters: dict[str, object] = {
        "width_px": 640,
        "height_px": 480,
        "fx_px": 400.0,
        "fy_px": 390.0,
        "cx_px": 322.0,
        "cy_px": 236.0,
        "rotation_vector": np.array([0.06, -0.04, 0.03]),
        "translation_mm": np.array([0.5, -0.4, 24.0]),
    }
    return Camera(model=model, distortion=np.array(distortion), **(parameters | changes))


def pad(**changes: object) -> Sheet:
    parameters: dict[str, object] = {
        "size_mm": np.array([25.0, 21.0]),
        "thickness_mm": 4.0,
        "boundary": "bonded",
        "marker_depth_mm": 0.5,
        "window_mm": 3.0,
        "window_index": 1.49,
        "pad_index": 1.41,
    }
    return Sheet(**(parameters | changes))


STRAIGHT = camera(rotation_vector=np.zeros(3), translation_mm=np.array([0.0, 0.0, 24.0]))
CAMERAS = [
    camera(),
    camera(distortion=(-0.1, 0.02, 0.001, -0.002, 0.0)),
    camera("fisheye", (0.05, -0.01, 0.002, 0.0)),
]
POINTS = np.array([[9.0, -7.0, 0.0], [-11.0, 4.0, -1.2], [0.3, 0.1, 0.4], [2.0, 9.0, -2.0]])


@pytest.mark.parametrize("seen_by", CAMERAS, ids=["pinhole", "brown-conrady", "fisheye"])
@given(x=st.floats(-12, 12), y=st.floats(-10, 10), z=st.floats(-3, 0.5))
def test_a_point_comes_back_from_its_pixel(seen_by: Camera, x: float, y: float, z: float) -> None:
    point = np.array([[x, y, z]])
    pixel = project_through_window(seen_by, pad(), point)
    np.testing.assert_allclose(onto_plane_through_window(seen_by, pad(), pixel, z), point, atol=1e-4)


@pytest.mark.parametrize("seen_by", CAMERAS, ids=["pinhole", "brown-conrady", "fisheye"])
def test_rays_are_straight_where_nothing_refracts(seen_by: Camera) -> None:
    expected = project(seen_by, POINTS)
    for plain in (pad(window_index=1.0, pad_index=1.0), pad(window_mm=None, window_index=None)):
        np.testing.assert_allclose(project_through_window(seen_by, plain, POINTS), expected, atol=1e-9)
    plane = onto_plane_through_window(seen_by, pad(window_mm=None), expected[:1], 0.0)
    np.testing.assert_allclose(plane, onto_plane(seen_by, expected[:1], 0.0))


def test_near_the_axis_depths_are_divided_by_the_index() -> None:
    offset = 1e-4
    pixel = project_through_window(STRAIGHT, pad(), np.array([[offset, 0.0, -1.0]]))
    apparent_distance_mm = (24.0 - 3.5 - 3.0) + 3.0 / 1.49 + (3.5 - 1.0) / 1.41
    assert pixel[0, 0] - 322.0 == pytest.approx(400.0 * offset / apparent_distance_mm, rel=1e-6)


def test_an_oblique_ray_bends_at_each_face() -> None:
    sine_in_air = 0.6
    lateral_mm = (
        17.5 * np.tan(np.arcsin(sine_in_air))
        + 3.0 * np.tan(np.arcsin(sine_in_air / 1.49))
        + 3.5 * np.tan(np.arcsin(sine_in_air / 1.41))
    )
    pixel = project_through_window(STRAIGHT, pad(), np.array([[0.0, lateral_mm, 0.0]]))
    np.testing.assert_allclose(pixel, [[322.0, 236.0 + 390.0 * 0.75]], atol=1e-9)


def test_light_takes_the_quickest_way() -> None:
    """Fermat's principle: the optical path is least where the ray crosses the faces."""
    sheet, point = pad(), np.array([8.0, -6.0, -0.5])
    rotation, translation = cam_from_sheet(camera())
    origin = -translation @ rotation
    heights, indices = np.array([point[2] + 3.5, 3.0, -6.5 - origin[2]]), np.array([1.41, 1.49, 1.0])
    apparent = apparent_mm(camera(), sheet, point[None])[0]
    slope = (apparent[:2] - origin[:2]) / (apparent[2] - origin[2])
    at_window = origin[:2] + slope * heights[2]
    sine = np.linalg.norm(slope) / np.sqrt(1 + slope @ slope)
    inside = np.tan(np.arcsin(sine / 1.49)) * slope / np.linalg.norm(slope)
    crossings = np.array([at_window + inside * heights[1], at_window])

    def path(shift: np.ndarray) -> float:
        ways = np.diff(np.vstack([point[:2], crossings + shift, origin[:2]]), axis=0)
        return float(indices @ np.hypot(np.linalg.norm(ways, axis=1), heights))

    for direction in np.random.default_rng(0).normal(size=(20, 2, 2)):
        assert path(np.zeros((2, 2))) < path(0.01 * direction)


def test_a_grazing_point_converges() -> None:
    far = np.array([[300.0, 0.0, 0.0]])
    pixel = project_through_window(STRAIGHT, pad(), far)
    np.testing.assert_allclose(onto_plane_through_window(STRAIGHT, pad(), pixel), far, rtol=1e-9)


def test_missing_points_stay_missing() -> None:
    pixel = project_through_window(STRAIGHT, pad(), np.array([[np.nan] * 3, [1.0, 1.0, 0.0]]))
    np.testing.assert_array_equal(np.isnan(pixel), [[True, True], [False, False]])
    assert project_through_window(STRAIGHT, pad(), np.zeros((0, 3))).shape == (0, 2)


def test_a_camera_inside_the_window_is_refused() -> None:
    inside = camera(translation_mm=np.array([0.0, 0.0, 5.0]), rotation_vector=np.zeros(3))
    with pytest.raises(SensorError, match=r"5 mm behind the markers, but pad and window reach 6\.5 mm"):
        project_through_window(inside, pad(), POINTS)
