"""Noise, slopes and covariances of all dots of an image agree with a plain numpy reference."""

import numpy as np
import pytest
from scipy.special import ndtr

from manytouch.detection.light_slopes import EVEN_DOTS, EVEN_SLOPE, STEEP
from manytouch.detection.measurement.covariance import MODEL, NEGLIGIBLE, add_noise, pixel_noise
from manytouch.detection.measurement.records import COLUMNS, CXX, CXY, CYY, DotStatistics, X, Y

FINE_NOISE = 2.3  # grey levels, less than that of the backgrounds


def random_statistics(seed: int, number: int = 60) -> tuple[DotStatistics, np.ndarray]:
    rng = np.random.default_rng(seed)
    radius = rng.uniform(3.0, 9.0, number)
    area, contrast = np.pi * radius**2, rng.uniform(60.0, 160.0, number)
    edges = 2.0 * np.pi * radius
    has_plane, low = radius > 6.2, rng.uniform(0.05, 0.15, number)
    statistics = DotStatistics(
        edge_xx=0.5 * edges * radius**2 * rng.uniform(0.9, 1.1, number),
        edge_xy=0.05 * edges * radius**2 * rng.normal(size=number),
        edge_yy=0.5 * edges * radius**2 * rng.uniform(0.9, 1.1, number),
        window=0.25 * np.pi * (1.35 * radius + 1.2) ** 4,
        scale=1.0 / ((1.0 - 2.0 * low) * contrast * area),
        area=area,
        background=rng.uniform(30.0, 60.0, number),
        background_x=0.05 * rng.normal(size=number),
        background_y=0.05 * rng.normal(size=number),
        contrast=contrast,
        contrast_x=0.02 * contrast / radius * rng.normal(size=number),
        contrast_y=0.02 * contrast / radius * rng.normal(size=number),
        background_variance=rng.gamma(30.0, 6.0 / 30.0, number),
        background_spread=64.0 * (1.5 * radius) ** 2,
        core_spread=np.where(has_plane, 16.0 * radius**2, 0.0),
        core_variance=np.where(has_plane, rng.gamma(30.0, 12.0 / 30.0, number), 9.0 * rng.random(number)),
        low=low,
    )
    statistics.background_variance[4] = 60.0  # a rough background
    statistics.contrast_x[np.argmax(radius)] = 0.6 * contrast[np.argmax(radius)] / radius.max()  # steep light
    return statistics, radius


def places(number: int) -> np.ndarray:
    """Places (n, 2) of dots in an image."""
    return np.random.default_rng(5).uniform([0.0, 0.0], [640.0, 480.0], (number, 2))


def usual(values: np.ndarray, level: np.ndarray, limits: np.ndarray) -> tuple[float, float]:
    limit = np.inf
    for _ in range(3):
        inside = (values >= 0.0) & (values <= limits * limit)
        limit, grey = values[inside].mean(), level[inside].mean()
    return limit, grey


def numpy_noise(of: DotStatistics, is_light: bool) -> tuple[float, float, float, float]:
    outlier = np.full(len(of.area), MODEL.outlier)
    background, level = usual(of.background_variance, of.background, outlier)
    of_core = np.where(of.core_spread > 0.0, MODEL.outlier, MODEL.outlier_of_one)
    core, core_level = usual(of.core_variance, of.background + of.contrast, of_core)
    if (core < background) == is_light:
        background = core = max(background, core)
    return background, core, level, (core - background) / (core_level - level)


def tail(z: np.ndarray) -> np.ndarray:
    density = np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
    return np.where(z > 6.0, 0.0, (1.0 + z * z) * ndtr(-z) - z * density)


def numpy_usual(square: np.ndarray, noise: np.ndarray, is_known: np.ndarray) -> tuple[float, float]:
    """Usual square of a slope, and that from which on one is steep."""
    limit, prior, even = np.inf, EVEN_DOTS * EVEN_SLOPE**2, 0.0
    for _ in range(3):
        inside = is_known & (square <= limit)
        number, squares = inside.sum() + EVEN_DOTS, square[inside].sum() + prior
        by_chance = 1.0 + 1.0 / np.sqrt(number)
        limit, even = STEEP * squares / number, max(squares - by_chance * noise[inside].sum(), prior) / number
    return even, limit


def numpy_trend(x: np.ndarray, y: np.ndarray, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (2, n) of a robust quadratic through levels, and their mean variance (n,) along an axis."""
    size = np.sqrt(((x - x.mean()) ** 2 + (y - y.mean()) ** 2).mean())
    u, v = (x - x.mean()) / size, (y - y.mean()) / size
    zero, one = np.zeros(len(u)), np.ones(len(u))
    matrix, inside = np.stack([one, u, v, u * u, u * v, v * v], axis=1), np.ones(len(u), dtype=bool)
    along = np.stack([[zero, one, zero, 2.0 * u, v, zero], [zero, zero, one, zero, u, 2.0 * v]]) / size
    c, variance = np.zeros(6), 0.0
    for _ in range(3):
        c = np.linalg.lstsq(matrix[inside], level[inside], rcond=None)[0]
        inverse, squares = np.linalg.inv(matrix[inside].T @ matrix[inside]), (level - matrix @ c) ** 2
        variance = squares[inside].sum() / (inside.sum() - 6)
        inside = squares <= 9.0 * squares[inside].mean()
    of_slopes = variance * np.einsum("apn,pq,aqn->an", along, inverse, along)
    return np.einsum("apn,p->an", along, c), of_slopes.mean(axis=0)


def numpy_added(of: DotStatistics, radius: np.ndarray, is_light: bool, place: np.ndarray) -> np.ndarray:
    """Columns X, Y, CXX, CXY, CYY that noise and slopes add to dots at places (n, 2)."""
    background, core, level, growth = numpy_noise(of, is_light)
    has_plane, unit = of.core_spread > 0.0, radius / of.contrast
    of_ground = np.stack([of.background_x, of.background_y])
    of_core = of_ground + np.stack([of.contrast_x, of.contrast_y])
    light_ground, _ = numpy_trend(*place.T, of.background)
    apart, of_apart = numpy_trend(*place.T, of.contrast)
    most = 0.5 * (apart**2).sum(axis=0).mean()
    usual = max(most - 2.0 * of_apart.mean(), 0.0)
    apart, of_apart = apart * usual / (usual + of_apart), of_apart * most / (most + of_apart)
    off_ground, off_core = of_ground - light_ground, of_core - light_ground - apart
    square_ground, square_core = (0.5 * unit**2 * (off**2).sum(axis=0) for off in (off_ground, off_core))
    fine = FINE_NOISE**2
    with np.errstate(divide="ignore"):
        noise_core = np.where(has_plane, 2.0 * unit**2 * core / of.core_spread, 0.0)
    noise_ground = 2.0 * unit**2 * min(background, fine) / of.background_spread
    even_ground, steep_ground = numpy_usual(square_ground, noise_ground, np.ones(len(unit), dtype=bool))
    even_core, steep_core = numpy_usual(square_core, noise_core, has_plane)
    here = np.maximum(background + growth * (of.background - level), MODEL.least_variance)
    there = np.maximum(here + growth * of.contrast, MODEL.least_variance)
    excess = np.where(of.background_variance > MODEL.texture * here, of.background_variance - here, 0.0)
    of_slopes = np.where(excess > 0.0, here + excess, np.minimum(here, fine))
    here, there = here + excess, there + excess
    xx, xy, yy = of.edge_xx, of.edge_xy, of.edge_yy
    root = np.sqrt((0.5 * (xx - yy)) ** 2 + xy**2)
    axis = np.sqrt(of.area / np.pi * np.sqrt((0.5 * (xx + yy) - root) / (0.5 * (xx + yy) + root)))
    core_radius = np.maximum(0.5 * radius, np.minimum(0.6 * radius, radius - 3.25))
    steep = (square_core > steep_core) & (axis > core_radius + MODEL.clearance_px)
    with np.errstate(divide="ignore"):
        own = np.where(has_plane, 2.0 * there / of.core_spread, 0.0)
    ground = 2.0 * of_slopes / of.background_spread
    kept_ground = even_ground / (even_ground + unit**2 * ground)
    kept_ground = np.where(square_ground > steep_ground, 1.0, kept_ground)
    kept_core = np.where(steep, 1.0, even_core / (even_core + unit**2 * own))
    lost_ground, lost_core = (1.0 - kept_ground) * off_ground, (1.0 - kept_core) * off_core
    lost = np.where(has_plane, lost_ground + lost_core, 2.0 * lost_ground - apart)
    outside = np.maximum(of.window - 0.5 * (xx + yy), 0.0)
    inside_px4 = np.clip(of.area**2 / (4.0 * np.pi) - 0.25 * (xx + yy), 0.0, outside)
    threshold = of.low * of.contrast
    passed = (outside - inside_px4) * here * tail(threshold / np.sqrt(here))
    passed += inside_px4 * there * tail(threshold / np.sqrt(there))
    passed[threshold**2 >= NEGLIGIBLE * np.maximum(here, there)] = 0.0
    edge, k2 = 0.5 * (here + there), of.scale**2
    tilt = np.where(
        has_plane,
        0.25 * (kept_ground * ground + kept_core * own),
        kept_ground * ground + 0.25 * of_apart,
    )
    return np.stack(
        [
            0.5 * of.scale * (xx * lost[0] + xy * lost[1]),
            0.5 * of.scale * (xy * lost[0] + yy * lost[1]),
            k2 * (edge * xx + passed + tilt * (xx**2 + xy**2)),
            k2 * (edge * xy + tilt * xy * (xx + yy)),
            k2 * (edge * yy + passed + tilt * (yy**2 + xy**2)),
        ],
        axis=1,
    )


@pytest.mark.parametrize("is_light", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_added_noise_is_that_of_numpy(seed: int, is_light: bool) -> None:
    statistics, radius = random_statistics(seed)
    statistics.contrast[:] += 0.2 * seed * places(len(radius))[:, 0]
    noise = pixel_noise(statistics, is_light)
    np.testing.assert_allclose(noise, numpy_noise(statistics, is_light), rtol=1e-9)
    out, place = np.zeros((len(radius), COLUMNS)), places(len(radius))
    out[:, [X, Y]] = place
    add_noise(statistics, radius, is_light, FINE_NOISE, out)
    out[:, [X, Y]] -= place
    expected = numpy_added(statistics, radius, is_light, place)
    np.testing.assert_allclose(out[:, [X, Y, CXX, CXY, CYY]], expected, rtol=1e-9, atol=1e-12)


def test_missing_dots_stay_missing_and_do_not_count() -> None:
    statistics, radius = random_statistics(1)
    whole = np.zeros((len(radius), COLUMNS))
    whole[:, [X, Y]] = places(len(radius))
    add_noise(statistics, radius, True, FINE_NOISE, whole)
    padded = DotStatistics(*(np.append(values, 0.0) for values in statistics))
    padded.background_variance[-1] = padded.core_variance[-1] = -1.0
    out = np.zeros((len(radius) + 1, COLUMNS))
    out[:-1, [X, Y]] = places(len(radius))
    out[-1] = np.nan
    add_noise(padded, np.append(radius, 5.0), True, FINE_NOISE, out)
    assert np.isnan(out[-1]).all()
    np.testing.assert_allclose(out[:-1], whole, rtol=1e-12, atol=1e-15)
