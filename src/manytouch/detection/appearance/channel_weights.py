"""Weights of the colour channels whose sum separates dots from their background.

A sensor file keeps them as `colour_weights`.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float64

from manytouch.values.arrays import Points2, Scalars

Weights = Float64[np.ndarray, "3"]


def trial_weights() -> Iterator[Weights]:
    """Weights of B, G, R to try when grey shows no dots: single channels and opponent colours."""
    for weights in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 1], [1, -0.5, -0.5], [-0.5, 1, -0.5]):
        yield np.array(weights, dtype=np.float64) / np.abs(weights).sum()


def fit_weights(image: np.ndarray, place_px: Points2, radius_px: Scalars) -> Weights:
    """Fisher's linear discriminant between dots and their backgrounds; dots become lighter.

    Each dot is compared with its own background, so that coloured light does not matter: d_i = dot -
    background. The scatter is that of d_i and of the background around each dot.
    """
    inner, outer = _mean_colours(image, place_px, radius_px)
    difference = inner - outer.mean(axis=1)
    background = (outer - outer.mean(axis=1, keepdims=True)).reshape(-1, 3)
    mean = difference.mean(axis=0)
    scatter = np.cov(difference.T) + background.T @ background / max(len(background) - 1, 1)
    scatter += (1e-3 * np.trace(scatter) / 3.0 + 0.3) * np.eye(3)
    weights = np.linalg.solve(scatter, mean)
    unit: Weights = weights / np.abs(weights).sum()
    return unit


def _mean_colours(
    image: np.ndarray, place_px: Points2, radius_px: Scalars
) -> tuple[Float64[np.ndarray, "n 3"], Float64[np.ndarray, "n 12 3"]]:
    """Colour of each dot's core (n, 3) and at 12 positions around it (n, 12, 3)."""
    height, width = image.shape[:2]
    angle = 2.0 * np.pi * np.arange(12) / 12
    ray = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def at(distance: float) -> np.ndarray:
        where = place_px[:, None, :] + distance * radius_px[:, None, None] * ray
        x = np.clip(np.rint(where[..., 0]).astype(int), 0, width - 1)
        y = np.clip(np.rint(where[..., 1]).astype(int), 0, height - 1)
        return np.asarray(image[y, x], dtype=np.float64)

    core = np.concatenate([at(0.0)[:, :1], at(0.4), at(0.6)], axis=1)
    return np.median(core, axis=1), at(1.8)
