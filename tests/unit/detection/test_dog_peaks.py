"""Enclosed peaks agree with a search in plain numpy."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from manytouch.detection.dog_peaks import BACKGROUND_RADII, Enclosure, find_peaks

ANGLE = 2.0 * np.pi * np.arange(16) / 16
RAY = np.stack([np.sin(ANGLE), np.cos(ANGLE)], axis=1)
OFFSET = np.rint(2.4 * np.array(BACKGROUND_RADII)[None, :, None] * RAY[:, None]).astype(np.int64)


def is_enclosed(smooth: np.ndarray, y: int, x: int) -> bool:
    falls = []
    for direction in OFFSET:
        inside = [
            smooth[y + v, x + u]
            for v, u in direction
            if 0 <= y + v < smooth.shape[0] and 0 <= x + u < smooth.shape[1]
        ]
        if inside:
            falls.append(smooth[y, x] - min(inside))
    if len(falls) < len(OFFSET) // 3 or sum(falls) <= 0.0:
        return False
    return bool(np.sum(np.array(falls) < 0.35 * np.mean(falls)) <= 0.2 * len(falls))


def expected_peaks(smooth: np.ndarray, response: np.ndarray, least: float) -> list[tuple[int, int]]:
    """Rows and columns of the peaks, in reading order."""
    padded = np.pad(response, 1, constant_values=-1e9)
    return [
        (y, x)
        for y, x in np.ndindex(response.shape)
        if response[y, x] >= least
        and response[y, x] == padded[y : y + 3, x : x + 3].max()
        and is_enclosed(smooth, y, x)
    ]


def top_of_parabola(values: np.ndarray) -> float:
    a, b, _ = np.polyfit([-1.0, 0.0, 1.0], values.astype(float), 2)
    return -0.5 * b / a


@pytest.mark.parametrize("seed", range(4))
def test_peaks_are_enclosed_maxima(seed: int) -> None:
    noise = np.random.default_rng(seed).normal(size=(40, 53))
    smooth = (200.0 * gaussian_filter(noise, 1.6)).astype(np.float32)
    response = (smooth - 200.0 * gaussian_filter(noise, 3.2)).astype(np.float32)
    expected = expected_peaks(smooth, response, 3.0)
    padded = np.pad(response, 1, constant_values=-1e9)
    found = np.empty((400, 3), dtype=np.float32)
    mark = np.empty(56, dtype=np.uint8)
    number = find_peaks(smooth, padded, np.float32(3.0), Enclosure(OFFSET), mark, found)
    assert number == len(expected) > 10
    np.testing.assert_array_equal(np.rint(found[:number, 1::-1]), expected)
    for (x, y, height), (row, column) in zip(found[:number], expected, strict=True):
        assert height == response[row, column]
        if 0 < column < 52:
            assert x - column == pytest.approx(
                top_of_parabola(response[row, column - 1 : column + 2]), abs=1e-4
            )
        if 0 < row < 39:
            top = top_of_parabola(response[row - 1 : row + 2, column])
            assert y - row == pytest.approx(top, abs=1e-4)
