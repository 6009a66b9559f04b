"""Images of discs against the points of their outlines, one by one."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.geometry.camera import project
from manytouch.mechanics.markers.discs import POINTS
from manytouch.mechanics.markers.images import Face, MarkerImages
from manytouch.values import Camera


def curve_centroid_px(point_px: np.ndarray) -> np.ndarray:
    """Centroid of the trigonometric polynomial through points: Green's theorem with its derivatives there."""
    order = np.fft.fftfreq(len(point_px), 1.0 / len(point_px))[:, None]
    order[len(point_px) // 2] = 0.0  # this cosine has its extremes at the points
    x, y = (point_px - point_px[0]).T
    dx, dy = np.fft.ifft(1j * order * np.fft.fft(point_px, axis=0), axis=0).real.T
    area = (x * dy - y * dx).sum()
    return np.asarray(point_px[0] + np.array([(x**2 * dy).sum(), -(y**2 * dx).sum()]) / area)


@pytest.mark.parametrize("radius_mm", [0.4, 3.0])
@pytest.mark.parametrize("is_fisheye", [False, True])
def test_the_centroid_is_that_of_the_curve_through_the_points_of_an_outline(
    dots: MarkerImages, camera: Camera, bent_mm: np.ndarray, radius_mm: float, is_fisheye: bool
) -> None:
    """Also where a disc is wider than an element, so that its points have no node in common."""
    shell = replace(dots.shell, shear_factor=0.0)  # the fibres of a disc have the tilt of its centre
    if is_fisheye:
        camera = replace(camera, model="fisheye", distortion=np.array([0.05, -0.01, 0.002, 0.0]))
    chosen = slice(None, None, 3)
    seen = replace(
        dots,
        shell=shell,
        camera=camera,
        rest_mm=dots.rest_mm[chosen],
        radius_mm=np.full_like(dots.radius_mm[chosen], radius_mm),
    )
    angle = 2.0 * np.pi / POINTS * np.arange(POINTS)
    circle = radius_mm * np.column_stack([np.cos(angle), np.sin(angle)])

    def centroids_px(coefficient_mm: np.ndarray) -> np.ndarray:
        found = []
        for centre_mm in seen.rest_mm:
            outline_mm = centre_mm[:2] + circle
            moved_mm = Face(shell=shell, point_mm=outline_mm).displacement(coefficient_mm)
            found.append(curve_centroid_px(project(camera, moved_mm + np.pad(outline_mm, ((0, 0), (0, 1))))))
        return np.array(found)

    expected = centroids_px(bent_mm) - centroids_px(np.zeros_like(bent_mm))
    assert np.abs(expected).max() > 5.0
    np.testing.assert_allclose(seen.displacement_px(bent_mm), expected, atol=1e-8)
