"""Kernels that know dots by how they look: area and contrast against those around them.

Prints are uneven. A dot's area and contrast over the mean of the adjacent ones hardly change with light or
stretch, so they say which dot is which where the lattice does not: weakly for one dot, surely for hundreds.
NaN stands for a dot with too few known ones around it.
"""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0917 - compiled functions take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

SIGNS = 2  # area, contrast
_LEAST_AROUND = 3
_ODDEST = 0.5
LOOKS = 600  # samples that weigh slips
GLANCES = 300  # samples that tell whether slips are to be weighed
_FINEST, _MEAN_TO_STD = 0.003, 1.2533
_MOST_SQUARE = 9.0
_INDEPENDENT = 8.0  # neighbouring looks share dots: so many count as one


@njit(cache=True, nogil=True)
@no_type_check
def stride(nodes, samples):
    """Every how many nodes are sampled: odd, so that samples do not line up with the rows of most layouts."""
    return nodes // samples | 1


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def looks(nodes, step, owner, appearance, net, now):
    """Writes, for every `step`-th node, area and contrast over the mean of the adjacent nodes', less 1."""
    _, _, _, start, adjacent_end, near, _, _, _, _ = net
    areas, contrasts = appearance
    for k in range(0, nodes, step):
        now[k, 0] = now[k, 1] = np.nan
        if owner[k] < 0:
            continue
        area = contrast = 0.0
        number = 0
        for j in range(start[k], adjacent_end[k]):
            i = owner[near[j]]
            if i >= 0:
                area += areas[i]
                contrast += contrasts[i]
                number += 1
        if number >= _LEAST_AROUND and area > 0.0 and contrast > 0.0:
            now[k, 0] = areas[owner[k]] * number / area - 1.0
            now[k, 1] = contrasts[owner[k]] * number / contrast - 1.0


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def unlike(now, look, level):
    """Fills `level` (2,) with the mean difference of sampled looks from the known ones (m, 2); NaN: none."""
    markers = len(look)
    for sign in range(SIGNS):
        total = 0.0
        number = 0
        for k in range(0, markers, stride(markers, GLANCES)):
            off = abs(now[k, sign] - look[k, sign])
            if not np.isnan(off):
                total += min(off, _ODDEST)
                number += 1
        level[sign] = total / number if number else np.nan


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def learn(owner, appearance, net, look, usual, level, rate, after, usual_after):
    """Writes looks (m, 2), and how unlike them dots usually are (2,), with a frame's blended in by `rate`.

    `level` is the latter in this frame. Unknown ones are taken whole.
    """
    for sign in range(SIGNS):
        known, now = usual[sign], level[sign]
        usual_after[sign] = known
        if not np.isnan(now):
            usual_after[sign] = now if np.isnan(known) else known + rate * (now - known)
    looks(len(look), 1, owner, appearance, net, after)
    for k in range(len(look)):
        for sign in range(SIGNS):
            known, now = look[k, sign], after[k, sign]
            if np.isnan(now):
                after[k, sign] = known
            elif not np.isnan(known):
                after[k, sign] = known + rate * (now - known)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def slipped_looks(now, slip, look, usual, cost):
    """Adds to `cost` (s,) how unlike the known looks (m, 2) the sampled ones of each slip are, in nats.

    `usual` (2,) is how unlike they are in other frames. Noise is at least that, or what the best slip leaves.
    """
    nodes, markers = slip.shape[1], len(look)
    step = stride(nodes, LOOKS)
    off = np.empty((len(slip), (nodes - 1) // step + 1))
    for sign in range(SIGNS):
        if np.isnan(usual[sign]):
            continue
        least = np.inf
        for s in range(len(slip)):
            total = 0.0
            number = 0
            for c in range(off.shape[1]):
                k = c * step
                t = slip[s, k]
                off[s, c] = abs(now[k, sign] - look[t, sign]) if 0 <= t < markers else np.nan
                if not np.isnan(off[s, c]):
                    total += min(off[s, c], _ODDEST)
                    number += 1
            least = min(least, total / number) if number else least
        deviation = max(_FINEST, _MEAN_TO_STD * max(usual[sign], least))
        own = most = 0.0
        for s in range(len(slip)):
            square = 0.0
            number = 0
            for c in range(off.shape[1]):
                if not np.isnan(off[s, c]):
                    square += min((off[s, c] / deviation) ** 2, _MOST_SQUARE)
                    number += 1
            if s == 0 and number:
                own, most = square / number, float(number)
            if number:
                cost[s] += 0.5 * most / _INDEPENDENT * (square / number - own)
