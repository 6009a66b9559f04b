"""Sheets that the tests of this room bend."""

import numpy as np
import pytest

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell.shell import Shell
from manytouch.values import Camera

PATCHES = {
    "clamped": SplinePatch(size_mm=(48.0, 36.0), elements=(11, 8)),
    "clamped, upright": SplinePatch(size_mm=(30.0, 48.0), elements=(7, 12), centre_mm=(2.0, -1.0)),
    "soft": SplinePatch(size_mm=(40.0, 36.0), elements=(9, 8), boundary="soft", centre_mm=(-3.0, 1.0)),
    "soft, upright": SplinePatch(size_mm=(24.0, 36.0), elements=(6, 9), boundary="soft"),
}


@pytest.fixture(params=list(PATCHES))
def patch(request: pytest.FixtureRequest) -> SplinePatch:
    return PATCHES[request.param]


@pytest.fixture
def shell(patch: SplinePatch) -> Shell:
    return Shell(patch=patch, thickness_mm=3.0, pretension_over_E_mm=0.05, bending_factor=0.9)


@pytest.fixture
def bent_mm(patch: SplinePatch) -> np.ndarray:
    """Coefficients of a press of about 5 mm, dragged a little and rough."""
    away = patch.place_mm - np.array(patch.centre_mm) - np.array([3.0, -2.0])
    bump = np.exp(-(away**2).sum(axis=1) / 60.0)
    rough = np.random.default_rng(5).normal(size=(patch.node_count, 3))
    return (np.outer(bump, [0.6, -0.4, -5.0]) + 0.05 * rough) * patch.is_free


@pytest.fixture
def camera() -> Camera:
    return Camera(
        width_px=1280,
        height_px=720,
        fx_px=1000.0,
        fy_px=1010.0,
        cx_px=640.0,
        cy_px=350.0,
        distortion=np.array([-0.05, 0.01, 5e-4, -3e-4, 1e-3]),
        rotation_vector=np.array([0.05, -0.08, 0.03]),
        translation_mm=np.array([1.0, -2.0, 90.0]),
    )


@pytest.fixture
def dots(shell: Shell, camera: Camera) -> MarkerImages:
    patch = shell.patch
    half = 0.5 * np.array(patch.size_mm) - 3.0
    x, y = (np.arange(-side, side + 1e-9, 4.0) for side in half)
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) + np.array(patch.centre_mm)
    rest_mm = np.column_stack([place, np.zeros(len(place))])
    return MarkerImages(shell=shell, camera=camera, rest_mm=rest_mm, radius_mm=np.full(len(place), 1.0))
