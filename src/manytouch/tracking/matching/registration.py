"""By how much did the whole view move? Votes of markers and dots; and what is kept of a frame."""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0917 - compiled functions take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.tracking.matching.dot_appearance import learn
from manytouch.tracking.matching.grow import fill
from manytouch.tracking.matching.spatial_hash import around, bin_dots

_BINS_PER_SPACING = 10
_REACH_SPACINGS = 1.6
PEAKS = 5
_LEARNT = 0.05
_MOST_PRESENT, _LEAST_PRESENT = 0.97, 0.05
_MOST_GHOST, _LEAST_GHOST = 0.9, 0.003
_BINS_PER_MOTION = 100.0
_MOTION_BINS = 400
_MOST_MARKERS = 0.95


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _votes(dot, bins, cell_px, guess, present, bin_px, half):
    """(2 half + 1)^2 histogram of dot minus guess."""
    low_x, low_y, columns, rows, start, binned = bins
    size = 2 * half + 1
    count = np.zeros((size, size))
    reach = (half + 0.5) * bin_px
    for k in range(len(guess)):
        if not present[k]:
            continue
        x, y = guess[k, 0], guess[k, 1]
        left, right, top, bottom = around(x - low_x, y - low_y, reach, columns, rows, 1.0 / cell_px)
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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def shifts(dot, spacing_px, guess, present):
    """(p, 2) likely shifts of the whole view in px, p <= `PEAKS`, the one with the most votes first.

    A regular pattern answers at every whole pitch; which answer is right is for the caller to find out.
    """
    bin_px = spacing_px / _BINS_PER_SPACING
    half = int(_REACH_SPACINGS * _BINS_PER_SPACING)
    count = _votes(dot, bin_dots(dot, spacing_px), spacing_px, guess, present, bin_px, half)
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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def keep(dots, owner, past, net, bounds, damping, scratch, rate, learning, after, measured):
    """Writes what is kept of a frame that showed markers, and what is told of it.

    Args:
        dots: centres (n, 2), their covariances (n, 2, 2), areas (n,) and contrasts (n,).
        owner: (N,) dot of each node.
        past: places (m, 2), frames unseen (m,), presence (N,).
        net, bounds: of `LatticeGraph`.
        damping: part of the motion that is expected again.
        scratch: of `Scratch`.
        rate: part of this frame's looks that is blended in; 0: nothing is learnt from it.
        learning: looks before, how unlike them dots usually are and are now; written: the first two after.
        after: written: places (m, 2), those expected in the next frame (m, 2), frames unseen (m,), presence
            (N,).
        measured: written: positions (m, 2), covariances (m, 2, 2), areas (m,), is_seen (m,).

    Returns:
        the motion of 95 % of the markers in spacings, and how many are seen.
    """
    centre, covariance, area, contrast = dots
    place, expected, frames, share = after
    is_seen = measured[3]
    lists, moved = (scratch[6], scratch[7], scratch[8], scratch[9]), scratch[10]
    written = (moved, place, expected, frames, share, is_seen)
    motion, seen = settle(centre, owner, len(place), past, net, bounds, damping, lists, written)
    place_dots(owner, is_seen, centre, covariance, area, measured[0], measured[1], measured[2])
    if rate > 0.0:
        look, usual, level, look_after, usual_after = learning
        learn(owner, (area, contrast), net, look, usual, level, rate, look_after, usual_after)
    return motion, seen


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def settle(dot, owner, markers, past, net, bounds, damping, lists, after):
    """Writes what is kept of a frame; returns the motion of 95 % of the markers in spacings, and how many.

    Args:
        dot: (n, 2) centres.
        owner: (N,) dot of each node.
        markers: m.
        past: places (m, 2), frames unseen (m,), presence (N,).
        net, bounds, damping: as in `keep`.
        lists: scratch of `fill`.
        after: written: displacements (N, 2), then as in `keep`, and is_seen (m,).
    """
    last, unseen, presence = past
    rest, kind, spacing, _, _, _, _, _, _, _ = net
    moved, place, expected, frames, share, is_seen = after
    for k in range(len(rest)):
        i = owner[k]
        if i >= 0:
            moved[k, 0], moved[k, 1] = dot[i, 0] - rest[k, 0], dot[i, 1] - rest[k, 1]
    fill(len(rest), net, moved, owner, lists)
    count = np.zeros(_MOTION_BINS + 1, np.int64)
    seen = 0
    for k in range(len(rest)):
        x, y = rest[k, 0] + moved[k, 0], rest[k, 1] + moved[k, 1]
        share[k] = presence[k]
        if owner[k] >= 0 or (bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]):
            most, least = (_MOST_PRESENT, _LEAST_PRESENT) if kind[k] == 0 else (_MOST_GHOST, _LEAST_GHOST)
            share[k] += _LEARNT * ((owner[k] >= 0) - presence[k])
            share[k] = min(most, max(least, share[k]))
        if k >= markers:
            continue
        place[k, 0], place[k, 1] = x, y
        expected[k, 0], expected[k, 1] = (x, y) if kind[k] == 0 else (np.nan, np.nan)
        is_seen[k] = owner[k] >= 0 and kind[k] == 0
        frames[k] = 0 if is_seen[k] else unseen[k] + 1
        if is_seen[k]:
            dx, dy = x - last[k, 0], y - last[k, 1]
            speed = np.sqrt(dx * dx + dy * dy) / spacing[k]
            count[min(_MOTION_BINS, int(speed * _BINS_PER_MOTION))] += 1
            seen += 1
            if unseen[k] == 0:
                expected[k, 0] += damping * dx
                expected[k, 1] += damping * dy
    below = 0
    for b in range(_MOTION_BINS + 1):
        below += count[b]
        if below >= _MOST_MARKERS * seen:
            return (b + 1) / _BINS_PER_MOTION, seen
    return np.inf, seen


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def place_dots(owner, is_seen, dot, dot_covariance, dot_area, position, covariance, area):
    """Writes centres (m, 2), covariances (m, 2, 2) and areas (m,) of the seen markers' dots, else NaN."""
    for k in range(len(is_seen)):
        i = owner[k] if is_seen[k] else -1
        area[k] = dot_area[i] if i >= 0 else np.nan
        for a in range(2):
            position[k, a] = dot[i, a] if i >= 0 else np.nan
            for b in range(2):
                covariance[k, a, b] = dot_covariance[i, a, b] if i >= 0 else np.nan
