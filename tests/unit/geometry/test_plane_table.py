"""The table of places in the plane of the sheet agrees with the camera's own formulas."""

import numpy as np
import pytest

from manytouch.geometry.camera import mm_per_px, onto_plane
from manytouch.geometry.plane_table import plane_table
from manytouch.values import Camera

CAMERAS = {
    "pinhole": ("pinhole", (0.0,) * 5),
    "brown-conrady": ("pinhole", (-0.2, 0.05, 0.001, -0.002, 0.01)),
    "fisheye": ("fisheye", (0.05, -0.01, 0.002, 0.0)),
}


def camera(model: str, distortion: tuple[float, ...]) -> Camera:
    return Camera(
        model=model,
        width_px=1600,
        height_px=900,
        fx_px=1100.0,
        fy_px=1080.0,
        cx_px=790.0,
        cy_px=455.0,
        distortion=np.array(distortion),
        rotation_vector=np.array([0.08, -0.05, 0.03]),
        translation_mm=np.array([1.0, -2.0, 110.0]),
    )


@pytest.mark.parametrize("name", CAMERAS)
def test_places_are_right_to_a_ten_thousandth_of_a_pixel_all_over_the_image(name: str) -> None:
    seen_by = camera(*CAMERAS[name])
    pixel = np.random.default_rng(1).uniform([-0.5, -0.5], [1599.5, 899.5], (4000, 2))
    off_mm = np.abs(plane_table(seen_by)(pixel) - onto_plane(seen_by, pixel)[:, :2])
    assert off_mm.max() < 1e-4 * mm_per_px(seen_by)


def test_what_is_not_seen_has_no_place() -> None:
    pixel = np.array([[100.0, 50.0], [np.nan, np.nan], [100.0, 50.0]])
    place_mm = plane_table(camera(*CAMERAS["pinhole"]))(pixel)
    assert np.isnan(place_mm[1]).all()
    np.testing.assert_array_equal(place_mm[0], place_mm[2])
