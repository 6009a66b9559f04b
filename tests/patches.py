"""Spline patches with both boundaries and orientations, and a shape of each."""

import numpy as np

from manytouch.geometry.spline.patch import SplinePatch

PATCHES = {
    "clamped": SplinePatch(size_mm=(48.0, 36.0), elements=(11, 8)),
    "clamped, upright": SplinePatch(size_mm=(30.0, 48.0), elements=(7, 12), centre_mm=(2.0, -1.0)),
    "soft": SplinePatch(size_mm=(40.0, 36.0), elements=(9, 8), boundary="soft", centre_mm=(-3.0, 1.0)),
    "soft, upright": SplinePatch(size_mm=(24.0, 36.0), elements=(6, 9), boundary="soft"),
}


def bent(patch: SplinePatch) -> np.ndarray:
    """Coefficients of a press of about 5 mm with some drag and roughness."""
    away = patch.place_mm - np.array(patch.centre_mm) - np.array([3.0, -2.0])
    bump = np.exp(-(away**2).sum(axis=1) / 60.0)
    rough = np.random.default_rng(5).normal(size=(patch.node_count, 3))
    return (np.outer(bump, [0.6, -0.4, -5.0]) + 0.05 * rough) * patch.is_free
