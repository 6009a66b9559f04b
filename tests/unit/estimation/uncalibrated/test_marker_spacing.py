"""Changes of marker spacings."""

import numpy as np
import pytest

from manytouch.estimation.uncalibrated.marker_spacing import marker_spacing
from manytouch.geometry.neighbours import nearest_neighbours

ROWS, COLUMNS = 6, 9
REST_MM = np.stack(np.meshgrid(np.arange(COLUMNS) * 4.0 - 13.0, np.arange(ROWS) * 3.0 - 8.0), -1).reshape(
    -1, 2
)
EYE_MM = np.array([-13.0, -8.0])  # at the first marker
SPACING = marker_spacing(REST_MM, EYE_MM, nearest_neighbours(REST_MM))


@pytest.mark.parametrize("stretch", [0.1, -0.2])
def test_a_uniform_stretch_is_measured_exactly(stretch: float) -> None:
    area, across = SPACING(stretch * REST_MM + [3.0, -1.0])
    np.testing.assert_allclose(area, 2.0 * np.log(1.0 + stretch), atol=1e-12)
    np.testing.assert_allclose(across, area, atol=1e-12)


def test_a_rotation_is_not_a_stretch() -> None:
    cosine, sine = np.cos(0.2), np.sin(0.2)
    area, across = SPACING(REST_MM @ np.array([[cosine - 1.0, -sine], [sine, cosine - 1.0]]))
    np.testing.assert_allclose(area, 0.0, atol=1e-12)
    np.testing.assert_allclose(across, 0.0, atol=1e-12)


def test_a_stretch_along_the_rays_is_not_measured_across_them() -> None:
    area, across = SPACING(REST_MM * [0.1, 0.0])
    np.testing.assert_allclose(area, np.log(1.1), atol=1e-12)
    along_x = np.arange(1, COLUMNS)  # on the x axis through the eye
    along_y = np.arange(1, ROWS) * COLUMNS
    np.testing.assert_allclose(across[along_x], 0.0, atol=1e-12)
    np.testing.assert_allclose(across[along_y], 2.0 * np.log(1.1), atol=1e-12)


def test_a_fold_gives_finite_changes() -> None:
    area, across = SPACING(-2.0 * REST_MM)
    assert np.isfinite(area).all()
    assert np.isfinite(across).all()


def test_predicted_noise_of_an_area_is_the_observed_one() -> None:
    rest_mm = REST_MM[(np.arange(3)[:, None] * COLUMNS + np.arange(3)).ravel()]  # neighbours on one side only
    few = marker_spacing(rest_mm, EYE_MM, nearest_neighbours(rest_mm))
    chance = np.random.default_rng(2)
    areas = np.array([few(chance.normal(0.0, 0.01, rest_mm.shape))[0] for _ in range(2000)])
    assert np.median(areas.var(axis=0)) == pytest.approx(few.noise * 0.01**2, rel=0.1)
