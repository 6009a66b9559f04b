"""Blobs of every size in an image: extrema of differences of Gaussians over place and scale.

T. Lindeberg, "Feature detection with automatic scale selection", doi:10.1023/A:1008045108935;
pyramid as D. G. Lowe, doi:10.1023/B:VISI.0000029664.99615.94.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float32

from manytouch.compilation import kernel, no_type_check
from manytouch.values.arrays import Points2, Scalars

PER_OCTAVE = 3
STEP = 2.0 ** (1.0 / PER_OCTAVE)
FIRST_SIGMA = 0.9  # px: responds most to discs of about 1.4 px radius
# the disc that a pair of Gaussians (s, STEP s) responds most to, and how strongly
BEST_RADIUS = math.sqrt(4.0 * math.log(STEP) / (1.0 - STEP**-2))
BEST_RESPONSE = math.exp(-0.5 * (BEST_RADIUS / STEP) ** 2) - math.exp(-0.5 * BEST_RADIUS**2)
SIGNIFICANT = 5.0  # deviations of white noise
MOST_BLOBS = 8000


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Blobs:
    """Spots that are lighter or darker than their surroundings.

    Attributes:
        place_px: (n, 2).
        radius_px: (n,) of the disc that responds most at this scale.
        contrast: (n,) approximate, grey levels of 255; negative if darker than the background.
    """

    place_px: Points2
    radius_px: Scalars
    contrast: Scalars


def find_blobs(
    channel: Float32[np.ndarray, "h w"], *, noise: float, least: float = 1.5
) -> tuple[Blobs, list[np.ndarray]]:
    """Finds blobs of both signs from 1.4 px radius to a sixth of the image; returns also the octaves.

    Args:
        channel: grey levels of 255.
        noise: standard deviation of a pixel.
        least: weakest contrast of a blob.
    """
    pyramid: list[np.ndarray] = []
    found = []
    base, base_sigma = channel, 0.0
    octave = 0
    while min(base.shape) >= 12 and base.shape[0] * base.shape[1] >= 256:
        pyramid.append(base)
        sigmas = FIRST_SIGMA * STEP ** np.arange(-1, PER_OCTAVE + 2)
        levels = [_blur(base, math.sqrt(max(sigma**2 - base_sigma**2, 0.0))) for sigma in sigmas]
        responses = np.stack([low - high for low, high in pairwise(levels)])
        thresholds = np.array([max(least, _noise_contrast(noise, s * 2**octave)) for s in sigmas[:-1]])
        rows = np.empty((base.size // 8 + 16, 4), dtype=np.float32)
        count = find_extrema(responses, (thresholds * BEST_RESPONSE).astype(np.float32), rows)
        scale = 2.0**octave
        rows = rows[:count].astype(np.float64)
        radius = BEST_RADIUS * FIRST_SIGMA * STEP ** (rows[:, 2] - 1.0) * scale
        found.append(np.column_stack([rows[:, :2] * scale, radius, rows[:, 3] / BEST_RESPONSE]))
        base = levels[PER_OCTAVE + 1][::2, ::2].copy()
        base_sigma = FIRST_SIGMA
        octave += 1
    every = np.concatenate(found) if found else np.zeros((0, 4))
    strongest = np.argsort(-np.abs(every[:, 3]) * every[:, 2], kind="stable")[:MOST_BLOBS]
    every = every[np.sort(strongest)]
    return Blobs(
        place_px=every[:, :2].copy(), radius_px=every[:, 2].copy(), contrast=every[:, 3].copy()
    ), pyramid


def _blur(image: np.ndarray, sigma: float) -> np.ndarray:
    if sigma < 0.05:
        return image
    return cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)


def _noise_contrast(noise: float, sigma: float) -> float:
    """Contrast of a disc with the response of white noise at a scale."""
    s1, s2 = sigma**2, (STEP * sigma) ** 2
    variance = (1.0 / (2.0 * s1) + 1.0 / (2.0 * s2) - 2.0 / (s1 + s2)) / (2.0 * math.pi)
    return SIGNIFICANT * noise * math.sqrt(max(variance, 0.0)) / BEST_RESPONSE


@kernel()
@no_type_check
def _is_extreme(responses: Float32[np.ndarray, "s h w"], s: int, y: int, x: int, sign: float) -> bool:
    """Whether no neighbour in place and scale is more extreme."""
    _, height, width = responses.shape
    value = sign * responses[s, y, x]
    for v in range(max(0, y - 1), min(height, y + 2)):
        for u in range(max(0, x - 1), min(width, x + 2)):
            for t in range(s - 1, s + 2):
                if sign * responses[t, v, u] > value:
                    return False
    return True


@kernel()
@no_type_check
def find_extrema(
    responses: Float32[np.ndarray, "s h w"],
    thresholds: Float32[np.ndarray, " s"],
    rows: Float32[np.ndarray, "k 4"],
) -> int:
    """Extrema over position and scale; rows x, y, scale index (interpolated), response. Returns how many."""
    scales, height, width = responses.shape
    count = 0
    for s in range(1, scales - 1):
        for y in range(height):
            for x in range(width):
                value = responses[s, y, x]
                if abs(value) < thresholds[s]:
                    continue
                sign = 1.0 if value > 0.0 else -1.0
                value *= sign
                if count >= rows.shape[0] or not _is_extreme(responses, s, y, x, sign):
                    continue
                rows[count, 0], rows[count, 1] = x, y
                low, high = sign * responses[s - 1, y, x], sign * responses[s + 1, y, x]
                rows[count, 2] = s + 0.5 * (high - low) / max(2.0 * value - low - high, 1e-6)
                rows[count, 3] = sign * value
                count += 1
    return count
