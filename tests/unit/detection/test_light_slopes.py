"""Slopes of the light over an image: those of a quadratic, whatever single dots show."""

import numpy as np
import pytest

from manytouch.detection.light_slopes import (
    EVEN_DOTS,
    EVEN_SLOPE,
    FEWEST_DOTS,
    STEEP,
    shrink_trend,
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
    slope = np.full((3, 200), np.nan)
    assert trend_slopes(x, y, level, np.empty((4, 200)), slope)
    known = np.arange(200) != 3
    np.testing.assert_allclose(slope[:2, known], expected[:, known], atol=1e-9)
    assert (slope[:, 3] == 0.0).all()
    assert (slope[2] < 1e-12).all()


@pytest.mark.parametrize("number", [30, 300])
def test_the_variance_of_slopes_is_that_of_repeated_noise(number: int) -> None:
    (x, y), rng, std, squares = places(number), np.random.default_rng(3), 12.0, []
    level, expected = light(x, y)
    slope, variances = np.empty((3, number)), []
    for _ in range(300):
        assert trend_slopes(x, y, level + std * rng.normal(size=number), np.empty((4, number)), slope)
        squares.append(0.5 * ((slope[:2] - expected) ** 2).sum(axis=0))
        variances.append(slope[2].copy())
    # without dots beyond three deviations the rest looks a little too regular
    assert np.mean(variances) == pytest.approx(np.mean(squares), rel=0.15)
    ratio = np.mean(variances, axis=0) / np.mean(squares, axis=0)
    assert np.all((ratio > 0.6) & (ratio < 1.4))


def test_slopes_that_may_be_by_chance_are_shrunk_to_0_and_clear_ones_hardly() -> None:
    square, unsure, clear = 0.125, 0.07, 1e-4
    slope = np.outer([0.3, 0.4, unsure], np.ones(5))
    shrink_trend(slope)
    assert (slope[:2] == 0.0).all()
    np.testing.assert_allclose(slope[2], unsure * square / (square + unsure))
    slope = np.outer([0.3, 0.4, clear], np.ones(5))
    shrink_trend(slope)
    share = (square - 2.0 * clear) / (square - clear)
    np.testing.assert_allclose(slope[:2], np.outer([0.3, 0.4], np.full(5, share)))
    np.testing.assert_allclose(slope[2], clear * square / (square + clear))


def test_of_many_dots_some_are_sufficient() -> None:
    x, y = places(4000)
    level, expected = light(x, y)
    slope = np.empty((3, 4000))
    assert trend_slopes(x, y, level, np.empty((4, 4000)), slope)
    np.testing.assert_allclose(slope[:2], expected, atol=1e-9)
    before = slope.copy()
    level[1::15] += 5.0  # not among those that are used
    assert trend_slopes(x, y, level, np.empty((4, 4000)), slope)
    np.testing.assert_array_equal(slope, before)


@pytest.mark.parametrize("kind", ["few", "in a line"])
def test_dots_that_show_no_quadratic_have_no_slopes(kind: str) -> None:
    number = FEWEST_DOTS - 1 if kind == "few" else 50
    x, y = places(number)
    if kind == "in a line":
        y = 2.0 * x
    slope = np.full((3, number), np.nan)
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
