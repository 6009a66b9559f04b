"""The compiled change of spacings against plain numpy."""

import numpy as np
import pytest

from manytouch.estimation.uncalibrated.marker_spacing_kernels import SpacingStencil, log_stretch


@pytest.mark.parametrize("size", [0.1, 2.0])  # the larger one folds the sheet
def test_changes_of_areas_and_lengths(size: float) -> None:
    random = np.random.default_rng(1)
    neighbour = random.integers(50, size=(50, 6))
    slope = random.normal(0.0, 0.5, (50, 6, 2))
    across = random.normal(size=(50, 2))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    shift = random.normal(0.0, size, (50, 2))
    gradient = np.eye(2) + np.einsum("mkb,mka->mba", slope, shift[neighbour] - shift[:, None])
    length = np.einsum("mb,mba->ma", across, gradient)
    area, found = log_stretch(shift, SpacingStencil(neighbour, slope, across, 0.2))
    np.testing.assert_allclose(area, np.log(np.maximum(np.linalg.det(gradient), 0.2)), atol=1e-12)
    np.testing.assert_allclose(found, np.log(np.maximum((length**2).sum(axis=1), 0.2)), atol=1e-12)
