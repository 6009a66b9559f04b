"""By how much did the whole view move? Votes of markers and dots; and where unseen markers should be."""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0917 - compiled functions take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

_BINS_PER_SPACING = 10
_REACH_SPACINGS = 1.6
PEAKS = 5


@njit(cache=True, error_model="numpy")
@no_type_check
def _votes(dot, bins, cell_px, guess, present, bin_px, half):
    """(2 half + 1)^2 histogram of dot minus guess."""
    low, columns, rows, start, binned = bins
    size = 2 * half + 1
    count = np.zeros((size, size))
    reach = (half + 0.5) * bin_px
    for k in range(len(guess)):
        if not present[k]:
            continue
        x, y = guess[k, 0], guess[k, 1]
        left = max(0, int(np.floor((x - reach - low[0]) / cell_px)))
        right = min(columns - 1, int(np.floor((x + reach - low[0]) / cell_px)))
        top = max(0, int(np.floor((y - reach - low[1]) / cell_px)))
        bottom = min(rows - 1, int(np.floor((y + reach - low[1]) / cell_px)))
        if right < left:
            continue
        for row in range(top, bottom + 1):
            for j in range(start[row * columns + left], start[row * columns + right + 1]):
                i = binned[j]
                u = int(np.floor((dot[i, 0] - x) / bin_px + 0.5)) + half
                v = int(np.floor((dot[i, 1] - y) / bin_px + 0.5)) + half
                if 0 <= u < size and 0 <= v < size:
                    count[v, u] += 1.0
    return count


@njit(cache=True, error_model="numpy")
@no_type_check
def shifts(dot, bins, cell_px, guess, present, spacing_px):
    """(p, 2) likely shifts of the whole view in px, p <= `PEAKS`, the one with the most votes first.

    A regular pattern answers at every whole pitch; which answer is right is for the caller to find out.
    """
    bin_px = spacing_px / _BINS_PER_SPACING
    half = int(_REACH_SPACINGS * _BINS_PER_SPACING)
    count = _votes(dot, bins, cell_px, guess, present, bin_px, half)
    size = 2 * half + 1
    smooth = np.zeros((size, size))
    for v in range(1, size - 1):
        for u in range(1, size - 1):
            total = 0.0
            for b in range(-1, 2):
                for a in range(-1, 2):
                    total += count[v + b, u + a]
            smooth[v, u] = total
    found = np.empty((PEAKS, 2))
    number = 0
    block = _BINS_PER_SPACING // 2 - 1
    for _ in range(PEAKS):
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


@njit(cache=True, error_model="numpy")
@no_type_check
def placed(dot, owner, rest, net, place):
    """Fills `place` (m, 2): the dot of each identified marker, and where the others should be.

    An unidentified marker takes the weighted mean of the displacements from rest of the neighbours that have
    one, in rounds that go outward; where there are none, the median of all.
    """
    _, spacing, start, _, near = net
    markers = len(rest)
    known = np.zeros(markers, np.bool_)
    u, v = np.empty(markers), np.empty(markers)
    n = 0
    for k in range(markers):
        if owner[k] >= 0:
            place[k, 0], place[k, 1] = dot[owner[k], 0], dot[owner[k], 1]
            known[k] = True
            u[n], v[n] = place[k, 0] - rest[k, 0], place[k, 1] - rest[k, 1]
            n += 1
    all_x = np.median(u[:n]) if n else 0.0
    all_y = np.median(v[:n]) if n else 0.0
    left = markers - n
    while left > 0:
        now = known.copy()
        for k in range(markers):
            if known[k]:
                continue
            total = x = y = 0.0
            for j in range(start[k], start[k + 1]):
                m = near[j]
                if known[m]:
                    d = (rest[m, 0] - rest[k, 0]) ** 2 + (rest[m, 1] - rest[k, 1]) ** 2
                    w = 1.0 / (d / spacing[k] ** 2 + 0.3)
                    total += w
                    x += w * (place[m, 0] - rest[m, 0])
                    y += w * (place[m, 1] - rest[m, 1])
            if total > 0.0:
                place[k, 0], place[k, 1] = rest[k, 0] + x / total, rest[k, 1] + y / total
                now[k] = True
                left -= 1
        if (now == known).all():
            break
        known = now
    for k in range(markers):
        if not known[k]:
            place[k, 0], place[k, 1] = rest[k, 0] + all_x, rest[k, 1] + all_y
