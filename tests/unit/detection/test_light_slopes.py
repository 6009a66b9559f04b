"""Slopes of the light over an image: those of a quadratic, whatever single dots show."""

import numpy as np
import pytest

from manytouch.detection.light_slopes import (
    EVEN_DOTS,
    EVEN_SLOPE,
    FEWEST_DOTS,
    STEEP,
    squares_of_slopes,
    trend_slopes,
    usual_slope,
)


def light(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Levels (n,) of a vignetted and tilted light, and their slopes (2, n)."""
    u, v = x - 300.0, y - 220.0
    level = 120.0 + 0.03 * u - 0.02 * v - 2e-4 * u * u + 1e-4 * u * v - 3e-4 * v * v
    return level, np.stack([0.03 - 4e-4 * u + 1e-4 * v, -0.02 + 1e-4 * u - 6e-4 * v])


def places(number: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.0, 640.0, number), rng.uniform(0.0, 480.0, number)


def test_a_quadratic_is_found_in_spite_of_other_dots_and_gaps() -> None:
    x, y = places(200)
    level, expected = light(x, y)
    level[::25] += 60.0  # printed lighter
    x[3] = y[3] = np.nan
    slope = np.full((2, 200), np.nan)
    assert trend_slopes(x, y, level, np.empty((4, 200)), slope)
    known = np.arange(200) != 3
    np.testing.assert_allclose(slope[:, known], expected[:, known], atol=1e-9)
    assert (slope[:, 3] == 0.0).all()


@pytest.mark.parametrize("kind", ["few", "in a line"])
def test_dots_that_show_no_quadratic_have_no_slopes(kind: str) -> None:
    number = FEWEST_DOTS - 1 if kind == "few" else 50
    x, y = places(number)
    if kind == "in a line":
        y = 2.0 * x
    slope = np.full((2, number), np.nan)
    assert not trend_slopes(x, y, light(x, y)[0], np.empty((4, number)), slope)
    assert (slope == 0.0).all()


def test_the_usual_slope_is_without_noise_and_without_steep_ones() -> None:
    rng, number = np.random.default_rng(1), 4000
    real, noise, spread, unit = 0.2, 0.1, 500.0, 0.05
    slope = real * rng.normal(size=(2, number)) + noise * rng.normal(size=(2, number))
    slope[:, :40] = 5.0
    square = np.empty((2, number))
    spreads = np.full(number, spread)
    spreads[-5:] = 0.0
    squares_of_slopes(slope, spreads, np.full(number, unit), 0.5 * noise**2 * spread, square)
    assert (square[0, -5:] == -1.0).all()
    usual, steep = usual_slope(square[0], square[1])
    assert usual == pytest.approx((unit * real) ** 2, rel=0.05)
    assert steep == pytest.approx(STEEP * unit**2 * (real**2 + noise**2), rel=0.05)


def test_without_dots_little_change_of_light_is_assumed() -> None:
    usual, _ = usual_slope(np.array([-1.0]), np.array([0.0]))
    assert usual == pytest.approx(EVEN_SLOPE**2)
    even, _ = usual_slope(np.zeros(100), np.zeros(100))
    assert even == pytest.approx(EVEN_DOTS * EVEN_SLOPE**2 / (100 + EVEN_DOTS))
