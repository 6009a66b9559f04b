"""Planes and centroids of samples agree with plain numpy; shading and other dots are no steps."""

import numpy as np
import pytest
from scipy.special import ndtr

from manytouch.detection.measurement.plane_fit import centroid_above, find_step, fit_plane
from manytouch.detection.measurement.records import NO_STEP, Plane, Samples, Step
from manytouch.detection.measurement.sampling_pattern import ring_radii


def random_samples(seed: int, number: int = 64) -> Samples:
    rng = np.random.default_rng(seed)
    dx, dy = rng.uniform(-6.0, 6.0, (2, number)).astype(np.float32)
    value = (70.0 + 1.5 * dx - 0.7 * dy + rng.normal(0.0, 2.0, number)).astype(np.float32)
    return Samples(dx, dy, value, (rng.random(number) < 0.8).astype(np.float32))


def numpy_plane(samples: Samples, chosen: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Coefficients, variance and spread of the least-squares plane of the chosen samples."""
    matrix = np.column_stack([np.ones(chosen.sum()), samples.dx[chosen], samples.dy[chosen]]).astype(float)
    coefficients, squares, _, _ = np.linalg.lstsq(matrix, samples.value[chosen].astype(float), rcond=None)
    spread = ((matrix[:, 1:] - matrix[:, 1:].mean(axis=0)) ** 2).sum()
    return coefficients, float(squares[0]) / (chosen.sum() - 3), spread


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("margin", [1e6, 5.0])
def test_the_plane_is_that_of_least_squares(seed: int, margin: float) -> None:
    samples, start = random_samples(seed), Plane(69.0, 1.2, -0.5)
    residual = samples.value - (start.a + start.b * samples.dx + start.c * samples.dy)
    chosen = (samples.used > 0.0) & (np.abs(residual) <= margin)
    expected, variance, spread = numpy_plane(samples, chosen)
    found = fit_plane(samples, len(samples.dx), start, margin)
    np.testing.assert_allclose(found[:3], expected, rtol=1e-4, atol=1e-3)
    assert found.number == chosen.sum()
    assert found.variance == pytest.approx(variance, rel=1e-3)
    assert found.spread == pytest.approx(spread, rel=1e-4)


def test_samples_beyond_the_number_do_not_count() -> None:
    samples = random_samples(1)
    fewer = Samples(*(values[:40].copy() for values in samples))
    start = Plane(70.0, 0.0, 0.0)
    np.testing.assert_allclose(
        fit_plane(samples, 40, start, 1e6), fit_plane(fewer, 40, start, 1e6), rtol=1e-5
    )


def test_without_samples_the_plane_stays() -> None:
    found = fit_plane(random_samples(2), 64, Plane(500.0, 1.0, 2.0), 1.0)
    assert found == Plane(500.0, 1.0, 2.0, 0.0, 0.0, 0.0)


def test_few_samples_have_no_slope() -> None:
    samples = random_samples(3, 5)
    samples.used[:] = 1.0
    found = fit_plane(samples, 5, Plane(70.0, 0.0, 0.0), 1e6)
    assert (found.b, found.c) == (0.0, 0.0)
    assert found.a == pytest.approx(samples.value.mean(), rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_the_centroid_is_weighted_by_the_level_above_the_threshold(seed: int) -> None:
    samples = random_samples(seed)
    weight = np.clip(samples.value - 68.0, 0.0, None) * samples.used
    expected = [(weight * samples.dx).sum() / weight.sum(), (weight * samples.dy).sum() / weight.sum()]
    np.testing.assert_allclose(centroid_above(samples, 64, np.float32(68.0)), expected, rtol=1e-4)
    assert centroid_above(samples, 64, np.float32(1e4)) == (0.0, 0.0)


def ring_of(radius_px: float) -> Samples:
    inner, outer = ring_radii(radius_px)
    reach = int(outer) + 1
    v, u = np.mgrid[-reach : reach + 1, -reach : reach + 1] + 0.2
    chosen = (np.hypot(u, v) >= inner) & (np.hypot(u, v) <= outer)
    dx, dy = u[chosen].astype(np.float32), v[chosen].astype(np.float32)
    return Samples(dx, dy, np.zeros_like(dx), np.ones_like(dx))


def step_in(samples: Samples, radius_px: float) -> Step:
    number = len(samples.dx)
    coefficients, variance, spread = numpy_plane(samples, np.ones(number, dtype=bool))
    plane = Plane(*coefficients, float(number), variance, spread)
    return find_step(samples, number, plane, radius_px, 80.0, 0.5, np.empty_like(samples.used))


@pytest.mark.parametrize("height", [-40.0, 60.0])
@pytest.mark.parametrize("angle_deg", [0.0, 70.0, 200.0])
@pytest.mark.parametrize("radius_px", [1.8, 3.0, 6.0])
def test_the_line_of_a_step_is_found(radius_px: float, angle_deg: float, height: float) -> None:
    samples, angle = ring_of(radius_px), np.radians(angle_deg)
    away_px = 1.3 * radius_px + 1.0
    along_px = samples.dx * np.cos(angle) + samples.dy * np.sin(angle)
    samples.value[:] = 50.0 + 0.5 * samples.dx + height * ndtr((along_px - away_px) / 0.5)
    step = step_in(samples, radius_px)
    assert np.cos(angle) * step.x + np.sin(angle) * step.y > np.cos(np.radians(15.0))
    assert max(away_px - 2.5, radius_px) <= step.limit < away_px


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("radius_px", [3.0, 6.0])
def test_smooth_shading_is_no_step(radius_px: float, seed: int) -> None:
    samples, rng = ring_of(radius_px), np.random.default_rng(seed)
    x, y = samples.dx / ring_radii(radius_px)[1], samples.dy / ring_radii(radius_px)[1]
    a, b, c = rng.normal(0.0, 40.0, 3)
    samples.value[:] = 50.0 + 20.0 * x + a * x * x + b * x * y + c * y * y
    assert step_in(samples, radius_px) == NO_STEP


@pytest.mark.parametrize("angle_deg", [0.0, 33.0])
@pytest.mark.parametrize("radius_px", [3.0, 6.0])
def test_dots_on_all_sides_are_no_step(radius_px: float, angle_deg: float) -> None:
    samples, pitch_px = ring_of(radius_px), 2.9 * radius_px + 1.0
    for quarter in range(4):
        angle = np.radians(angle_deg + 90.0 * quarter)
        away_px = np.hypot(samples.dx - pitch_px * np.cos(angle), samples.dy - pitch_px * np.sin(angle))
        samples.value[:] += (80.0 * ndtr((radius_px - away_px) / 0.8)).astype(np.float32)
    assert samples.value.max() > 0.3 * 80.0
    assert step_in(samples, radius_px) == NO_STEP
