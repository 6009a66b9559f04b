"""Outlines of blobs: those of known ellipses, and the same as in plain numpy."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from manytouch.detection.appearance.blob_outline import RAYS, REACH, STEPS, trace_octave, trace_outlines

ANGLE = 2.0 * np.pi * np.arange(RAYS) / RAYS


def ellipse(x: float, y: float, long: float, short: float, turn: float) -> np.ndarray:
    v, u = np.mgrid[:80, :90]
    along = (u - x) * np.cos(turn) + (v - y) * np.sin(turn)
    across = (v - y) * np.cos(turn) - (u - x) * np.sin(turn)
    inside = (along / long) ** 2 + (across / short) ** 2 < 1.0
    return gaussian_filter(np.where(inside, 190.0, 60.0), 0.8).astype(np.float32)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_ellipse_has_its_centre_size_contrast_and_aspect(sign: float) -> None:
    image = ellipse(44.3, 38.6, 12.0, 8.0, 0.4)
    image = image if sign > 0.0 else 250.0 - image
    found = trace_outlines([image], np.array([[43.0, 40.0]]), np.array([9.0]), sign)
    np.testing.assert_allclose(found.place_px, [[44.3, 38.6]], atol=0.3)
    assert found.radius_px[0] == pytest.approx(np.sqrt(12.0 * 8.0), rel=0.05)
    assert found.contrast[0] == pytest.approx(130.0, rel=0.02)
    assert found.aspect[0] == pytest.approx(1.5, rel=0.12)
    assert (found.openness[0], found.visible[0]) == (0.0, 1.0)
    assert found.fill[0] > 0.95
    assert found.roughness[0] < 0.06


def test_a_stripe_is_open_and_an_even_image_has_no_outline() -> None:
    stripe = np.full((80, 90), 60.0, dtype=np.float32)
    stripe[35:45] = 180.0
    found = trace_outlines([stripe], np.array([[45.0, 40.0]]), np.array([5.0]), 1.0)
    assert found.openness[0] >= 0.5
    even = trace_outlines([np.full_like(stripe, 9.0)], np.array([[45.0, 40.0]]), np.array([5.0]), 1.0)
    assert np.isnan(even.radius_px[0])


def numpy_outline(image: np.ndarray, x: float, y: float, radius: float) -> np.ndarray:
    """x, y, radius, contrast, roughness of the outline, for a blob whose rays all fall."""
    distance = REACH * radius * (np.arange(STEPS) + 0.5) / STEPS
    u, v = x + distance * np.cos(ANGLE)[:, None], y + distance * np.sin(ANGLE)[:, None]
    values = map_coordinates(image.astype(float), [v, u], order=1)
    rings = np.sort(values, axis=0)[RAYS // 2, : int(STEPS / REACH)]
    best, core = int(rings.argmax()), rings.max()
    falls = core - values[:, best:].min(axis=1)
    contrast = np.sort(falls)[RAYS // 2]
    lengths = []
    for ray in range(RAYS):
        level = core - 0.5 * min(falls[ray], 1.5 * contrast)
        step = best + int(np.argmax(values[ray, best:] < level))
        before, here = values[ray, step - 1], values[ray, step]
        place = step - 1 + (before - level) / (before - here) if step > 0 and before > level else step
        lengths.append(REACH * radius * (max(place, 0.0) + 0.5) / STEPS)
    length = np.array(lengths)
    area = 0.5 * (length**2).sum()
    shift = [(length**3 / 3.0 * wave).sum() / area for wave in (np.cos(ANGLE), np.sin(ANGLE))]
    waves = [np.ones(RAYS)] + [wave(k * ANGLE) for k in (1, 2) for wave in (np.cos, np.sin)]
    matrix = np.stack(waves, axis=1)
    rough = length - matrix @ np.linalg.lstsq(matrix, length, rcond=None)[0]
    roughness = np.sqrt(np.mean(rough**2)) / length.mean()
    return np.array([x + shift[0], y + shift[1], np.sqrt(2.0 * area / RAYS), contrast, roughness])


@pytest.mark.parametrize("seed", range(4))
def test_a_trace_is_that_of_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y, radius = rng.uniform(40.0, 48.0), rng.uniform(36.0, 44.0), rng.uniform(7.0, 9.0)
    image = ellipse(x, y, radius, 0.97 * radius, 0.3) + rng.normal(0.0, 2.0, (80, 90)).astype(np.float32)
    rows = np.full((1, 9), np.nan)
    # so near to the outline that it is traced once
    trace_octave(image, np.array([[x, y]]), np.array([radius]), 1.0, rows)
    np.testing.assert_allclose(rows[0, [0, 1, 2, 3, 6]], numpy_outline(image, x, y, radius), rtol=1e-6)
