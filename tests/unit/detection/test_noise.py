"""The noise of a pixel: right for known noise, and the same as in plain numpy."""

import numpy as np
import pytest

from manytouch.detection import estimate_noise
from manytouch.simulation.render.discs import Look, Spot, render_discs


def numpy_noise(image: np.ndarray, weights: np.ndarray) -> float:
    """From all second differences along rows, without bins."""
    grey = image.astype(float) if image.ndim == 2 else image @ weights
    second = np.abs(grey[:, :-2] - 2.0 * grey[:, 1:-1] + grey[:, 2:])
    within = second[second < 2.5 * np.median(second) / 0.6745]
    return float(np.sqrt(np.mean(within**2) / (0.911 * 6.0)))


@pytest.mark.parametrize("shape", [(400, 640), (1440, 2560), (300, 500, 3)])
def test_noise_of_wide_and_narrow_images(shape: tuple[int, ...]) -> None:
    image = np.clip(np.rint(np.random.default_rng(0).normal(100.0, 4.0, shape)), 0, 255).astype(np.uint8)
    weights = np.ones(1) if len(shape) == 2 else np.array([0.2, 0.5, 0.3])
    assert estimate_noise(image, weights) == pytest.approx(4.0 * np.linalg.norm(weights), rel=0.08)


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_that_of_numpy(seed: int) -> None:
    image = np.random.default_rng(seed).normal(100.0, 9.0, (120, 150, 3)).astype(np.float32)
    weights = np.array([0.2, 0.5, 0.3])
    assert estimate_noise(image, weights, rows=120) == pytest.approx(numpy_noise(image, weights), rel=0.04)


@pytest.mark.parametrize("noise", [1.0, 3.0, 10.0])
def test_edges_of_dots_are_not_noise(noise: float) -> None:
    x, y = np.meshgrid(np.arange(50.0, 590.0, 40.0), np.arange(50.0, 350.0, 40.0))
    centre_px = np.stack([x.ravel(), y.ravel()], axis=1)
    glare = (Spot(centre_px=(300.0, 200.0), radius_px=60.0, amount=40.0),)
    image = render_discs(
        centre_px, np.tile(10.0 * np.eye(2), (len(centre_px), 1, 1)), width_px=640, height_px=400,
        look=Look(read_noise=noise, glare=glare), seed=1,
    )  # fmt: skip
    assert estimate_noise(image, np.ones(1), rows=200) == pytest.approx(noise, rel=0.15)
