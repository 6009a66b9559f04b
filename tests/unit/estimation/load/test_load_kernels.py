"""Compiled sums of cosines against plain numpy."""

import numpy as np

from manytouch.estimation.load.cosine_series import cosine_products
from manytouch.estimation.load.load_kernels import (
    MOST_CURVATURE,
    covariances_of_maxima,
    products_at_points,
    slopes_at_points,
)

RANDOM = np.random.default_rng(5)
WAVE_X, WAVE_Y = np.arange(9) * np.pi / 17.0, np.arange(6) * np.pi / 11.0
PLACE = RANDOM.uniform(0.0, 11.0, (4, 2))


def plain(order_x: int, order_y: int) -> np.ndarray:
    return cosine_products(PLACE, WAVE_X, WAVE_Y, order_x, order_y)


def test_products_at_points() -> None:
    np.testing.assert_allclose(products_at_points(PLACE, WAVE_X, WAVE_Y), plain(0, 0), atol=1e-15)


def test_slopes_and_second_derivatives() -> None:
    coefficients = RANDOM.normal(size=(9, 6))
    slope, bend = slopes_at_points(PLACE, WAVE_X, WAVE_Y, coefficients)
    np.testing.assert_allclose(slope, np.concatenate([plain(1, 0), plain(0, 1)]), atol=1e-14)
    second = {orders: plain(*orders) @ coefficients.ravel() for orders in ((0, 0), (2, 0), (1, 1), (0, 2))}
    least = MOST_CURVATURE * np.abs(second[0, 0])
    np.testing.assert_allclose(bend[:, 0, 0], second[2, 0] - least, atol=1e-13)
    np.testing.assert_allclose(bend[:, 1, 1], second[0, 2] - least, atol=1e-13)
    np.testing.assert_allclose(bend[:, 0, 1], second[1, 1], atol=1e-13)
    np.testing.assert_array_equal(bend[:, 1, 0], bend[:, 0, 1])


def test_the_covariance_of_maxima() -> None:
    root = RANDOM.normal(size=(54, 54))
    spread = root @ root.T
    slope, bend = slopes_at_points(PLACE, WAVE_X, WAVE_Y, RANDOM.normal(size=(9, 6)))
    found = covariances_of_maxima(slope, (slope @ spread).astype(np.float32), bend, 0.3)
    for n, each in enumerate(found):
        gradient = slope[[n, 4 + n]] @ spread @ slope[[n, 4 + n]].T
        expected = 0.3 * np.linalg.inv(bend[n]) @ gradient @ np.linalg.inv(bend[n])
        np.testing.assert_allclose(each, expected, rtol=1e-4)
        np.testing.assert_array_equal(each, each.T)
