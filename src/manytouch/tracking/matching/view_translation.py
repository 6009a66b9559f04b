"""Kernels that vote on the translation of the whole view: a histogram of dot minus marker positions."""

from typing import NamedTuple

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.tracking.matching.records import DotGrid
from manytouch.tracking.matching.spatial_hash import build_grid, cells_within


class TranslationParameters(NamedTuple):
    """Parameters of the vote.

    Attributes:
        bins_per_spacing: resolution of the histogram.
        reach: largest translation along x and y, in spacings.
        peaks: most translations that are returned.
    """

    bins_per_spacing: int = 10
    reach: float = 1.6
    peaks: int = 5


TRANSLATION = TranslationParameters()


@kernel()
@no_type_check
def _histogram(
    grid: DotGrid, position_px: np.ndarray, is_present: np.ndarray, bin_px: float, half: int
) -> np.ndarray:
    """(2 half + 1, 2 half + 1) number of pairs by dot minus position, y first."""
    centre, start, dot, columns = grid.centre_px, grid.start, grid.dot, grid.columns
    size = 2 * half + 1
    count = np.zeros((size, size))
    reach = (half + 0.5) * bin_px
    for k in range(len(position_px)):
        if not is_present[k]:
            continue
        x, y = position_px[k, 0], position_px[k, 1]
        cells = cells_within(grid, x, y, reach)
        if cells.right < cells.left:
            continue
        for row in range(cells.top, cells.bottom + 1):
            for j in range(start[row * columns + cells.left], start[row * columns + cells.right + 1]):
                i = dot[j]
                u = int(np.floor((centre[i, 0] - x) / bin_px + 0.5)) + half
                v = int(np.floor((centre[i, 1] - y) / bin_px + 0.5)) + half
                if 0 <= u < size and 0 <= v < size:
                    count[v, u] += 1.0
    return count


@kernel()
@no_type_check
def _smooth(count: np.ndarray) -> np.ndarray:
    """Sums over 3 x 3 bins; 0 at the border."""
    size = len(count)
    smooth = np.zeros((size, size))
    for v in range(1, size - 1):
        for u in range(1, size - 1):
            total = 0.0
            for b in range(-1, 2):
                for a in range(-1, 2):
                    total += count[v + b, u + a]
            smooth[v, u] = total
    return smooth


@kernel()
@no_type_check
def likely_translations(
    centre_px: np.ndarray, spacing_px: float, position_px: np.ndarray, is_present: np.ndarray
) -> np.ndarray:
    """(p, 2) likely translations of the view in px, p <= 5, the one with the most votes first.

    A regular pattern has a peak at every whole pitch; which one is right is for the caller to find out.

    Args:
        centre_px: (n, 2) dots, n > 0.
        spacing_px: of the pattern.
        position_px: (m, 2) of the markers before.
        is_present: (m,) markers that are not known to be missing.
    """
    bin_px = spacing_px / TRANSLATION.bins_per_spacing
    half = int(TRANSLATION.reach * TRANSLATION.bins_per_spacing)
    count = _histogram(build_grid(centre_px, spacing_px), position_px, is_present, bin_px, half)
    size = len(count)
    smooth = _smooth(count)
    found = np.empty((TRANSLATION.peaks, 2))
    number = 0
    block = TRANSLATION.bins_per_spacing // 2 - 1
    for _ in range(TRANSLATION.peaks):
        best = int(np.argmax(smooth))
        v, u = best // size, best % size
        if smooth[v, u] < 1.0:
            break
        total = x = y = 0.0
        for b in range(-1, 2):
            for a in range(-1, 2):
                w = count[v + b, u + a]
                total += w
                x += w * (u + a)
                y += w * (v + b)
        found[number, 0] = (x / total - half) * bin_px
        found[number, 1] = (y / total - half) * bin_px
        number += 1
        for b in range(max(0, v - block), min(size, v + block + 1)):
            for a in range(max(0, u - block), min(size, u + block + 1)):
                smooth[b, a] = 0.0
    return found[:number]
