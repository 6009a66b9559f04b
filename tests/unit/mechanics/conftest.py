"""Sheets that the tests of the mechanics deform."""

import numpy as np
import pytest

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell.shell import Shell
from manytouch.values import Camera
from patches import PATCHES, bent


@pytest.fixture(params=list(PATCHES))
def patch(request: pytest.FixtureRequest) -> SplinePatch:
    return PATCHES[request.param]


@pytest.fixture
def shell(patch: SplinePatch) -> Shell:
    return Shell(patch=patch, thickness_mm=3.0, pretension_over_E_mm=0.05, bending_factor=0.9)


@pytest.fixture
def bent_mm(patch: SplinePatch) -> np.ndarray:
    return bent(patch)


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
