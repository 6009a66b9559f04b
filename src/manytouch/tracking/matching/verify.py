"""Kernels that drop identities which their neighbours contradict: impostors, tears, folds.

A marker must lie where its neighbours' displacements see it: by a quadratic fit or, where some are not known,
by lines of the lattice and a robust linear fit; within what the field's own roughness allows. Where the field
is too rough for that, it must have moved since the last frame as its neighbours did. So a part of the pattern
that was mistaken by one pitch cannot stay: the ring around it tears.
"""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.tracking.matching.grow import affine, least_stretch, roughness
from manytouch.tracking.matching.spatial_hash import around

_SETTLED, _ALIKE = 0.05, 0.2
_ALONG = 0.1
_TOLERANCE, _ROUGHNESS = 0.08, 1.0
_LINE_TOLERANCE, _LINE_ROUGHNESS = 0.12, 1.0
_GAP_TOLERANCE, _GAP_ROUGHNESS = 0.1, 2.5
_FEW = 6
_FEWEST = 3
_MOST_TOLERANCE = 0.42
_FOLD = 0.04
_ROUNDS = 8
_REACH = 0.9
_TORN = 0.6


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _unsettled(nodes, net, moved, owner, noise_px, is_changed, excess):
    """Forgets the excess of changed nodes; leaves as changed those whose neighbours moved otherwise."""
    _, _, spacing, start, adjacent_end, near, _, _, _, _ = net
    for k in range(nodes):
        if not is_changed[k]:
            continue
        excess[k] = 0.0
        if owner[k] < 0:
            is_changed[k] = False
            continue
        mean, most = _SETTLED * spacing[k] + noise_px, _ALIKE * spacing[k] + noise_px
        x = y = worst = 0.0
        count = 0
        for j in range(start[k], adjacent_end[k]):
            n = near[j]
            if owner[n] >= 0:
                dx, dy = moved[n, 0] - moved[k, 0], moved[n, 1] - moved[k, 1]
                x += dx
                y += dy
                worst = max(worst, dx * dx + dy * dy)
                count += 1
        is_changed[k] = count < 3 or x * x + y * y >= (mean * count) ** 2 or worst >= most * most


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _went_along(k, rest, moved, owner, start, adjacent_end, near, last, unseen, most):
    """Did a marker that was seen in the last frame move as those around it did, on average within `most`?"""
    if k >= len(last) or unseen[k] > 0:
        return False
    own_x, own_y = rest[k, 0] + moved[k, 0] - last[k, 0], rest[k, 1] + moved[k, 1] - last[k, 1]
    x = y = 0.0
    count = 0
    for j in range(start[k], adjacent_end[k]):
        n = near[j]
        if n < len(last) and owner[n] >= 0 and unseen[n] == 0:
            x += rest[n, 0] + moved[n, 0] - last[n, 0] - own_x
            y += rest[n, 1] + moved[n, 1] - last[n, 1] - own_y
            count += 1
    return count >= 3 and x * x + y * y < (most * count) ** 2


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _off_lines(k, moved, owner, opposite, off):
    """Lower median of a marker's distances from what quadratics and cubics along lines give; 0: no line.

    `off` (6,) is scratch.
    """
    lines = 0
    for axis in range(2):
        known = 0
        for d in range(2 * axis, 2 * axis + 2):
            a = opposite[k, d]
            b = opposite[a, d] if a >= 0 else -1
            if a < 0 or b < 0 or owner[a] < 0 or owner[b] < 0:
                continue
            known += 1
            c = opposite[b, d]
            if c >= 0 and owner[c] >= 0:
                x = 3.0 * (moved[a, 0] - moved[b, 0]) + moved[c, 0] - moved[k, 0]
                y = 3.0 * (moved[a, 1] - moved[b, 1]) + moved[c, 1] - moved[k, 1]
                off[lines] = x * x + y * y
                lines += 1
        if known == 2:
            a, b = opposite[k, 2 * axis], opposite[k, 2 * axis + 1]
            c, d = opposite[a, 2 * axis], opposite[b, 2 * axis + 1]
            x = (4.0 * (moved[a, 0] + moved[b, 0]) - moved[c, 0] - moved[d, 0]) / 6.0 - moved[k, 0]
            y = (4.0 * (moved[a, 1] + moved[b, 1]) - moved[c, 1] - moved[d, 1]) / 6.0 - moved[k, 1]
            off[lines] = x * x + y * y
            lines += 1
    if lines == 0:
        return 0.0
    for a in range(lines):
        below = 0
        for b in range(lines):
            below += off[b] < off[a] or (off[b] == off[a] and b < a)
        if below == (lines - 1) // 2:
            return np.sqrt(off[a])
    return 0.0


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _off_blend(k, moved, owner, start, near, blend):
    """Distance of a marker's displacement from the blend of its neighbours'; inf where one is not known."""
    x, y = -moved[k, 0], -moved[k, 1]
    for j in range(start[k], start[k + 1]):
        if blend[j] != 0.0:
            n = near[j]
            if owner[n] < 0:
                return np.inf
            x += blend[j] * moved[n, 0]
            y += blend[j] * moved[n, 1]
    return np.sqrt(x * x + y * y)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _excess(
    k,
    rest,
    moved,
    owner,
    spacing,
    start,
    adjacent_end,
    near,
    weight,
    blend,
    is_blended,
    opposite,
    noise_px,
    is_calm,
    lines,
    last,
    unseen,
    is_next,
):
    """Distance of a marker from where its neighbours see it, over what is allowed; above 1 is too far."""
    size = spacing[k]
    if is_next and _went_along(
        k, rest, moved, owner, start, adjacent_end, near, last, unseen, _ALONG * size + noise_px
    ):
        return 0.0
    off_blend = np.inf
    if is_blended[k]:
        off_blend = _off_blend(k, moved, owner, start, near, blend)
        if off_blend < _TOLERANCE * size + noise_px:
            return 0.0
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    fit, _, used = affine(k, rest, moved, owner, spacing, start, adjacent_end, near, weight, zero, False)
    if used < _FEWEST:
        return 0.0 if is_calm else 2.0
    rms = roughness(k, rest, moved, owner, spacing, start, near, weight, fit, False)
    most = _MOST_TOLERANCE * least_stretch(fit[2], fit[3], fit[4], fit[5]) * size
    if off_blend < np.inf:
        return off_blend / min(most, _TOLERANCE * size + _ROUGHNESS * rms + noise_px)
    off = _off_lines(k, moved, owner, opposite, lines)
    by_line = off / min(most, _LINE_TOLERANCE * size + _LINE_ROUGHNESS * rms + noise_px)
    off = np.sqrt((fit[0] - moved[k, 0]) ** 2 + (fit[1] - moved[k, 1]) ** 2)
    if used < _FEW:
        return max(by_line, off / most)
    allowed = min(most, _GAP_TOLERANCE * size + _GAP_ROUGHNESS * rms + noise_px)
    if off > allowed:
        for _ in range(2):
            fit, _, _ = affine(k, rest, moved, owner, spacing, start, adjacent_end, near, weight, fit, True)
        rms = roughness(k, rest, moved, owner, spacing, start, near, weight, fit, True)
        allowed = min(most, _GAP_TOLERANCE * size + _GAP_ROUGHNESS * rms + noise_px)
        off = np.sqrt((fit[0] - moved[k, 0]) ** 2 + (fit[1] - moved[k, 1]) ** 2)
    return max(by_line, off / allowed)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def verify(nodes, net, past, moved, owner, noise_px, is_calm, used, excess, is_changed, chosen):
    """Drops what neighbours contradict, the worst of a neighbourhood first; returns how many were dropped.

    `excess` (N,), `is_changed` (N,) and `chosen` (N,) are scratch.
    """
    rest, _, spacing, start, adjacent_end, near, weight, blend, is_blended, opposite = net
    last, unseen, is_next = past[0], past[1], past[5]
    lines = np.empty(6)
    dropped = 0
    is_changed[:nodes] = True
    for _ in range(_ROUNDS):
        worst = 0.0
        _unsettled(nodes, net, moved, owner, noise_px, is_changed, excess)
        for k in range(nodes):
            if is_changed[k]:
                is_changed[k] = False
                excess[k] = _excess(
                    k,
                    rest,
                    moved,
                    owner,
                    spacing,
                    start,
                    adjacent_end,
                    near,
                    weight,
                    blend,
                    is_blended,
                    opposite,
                    noise_px,
                    is_calm,
                    lines,
                    last,
                    unseen,
                    is_next,
                )
            worst = max(worst, excess[k])
        if worst <= 1.0:
            break
        number = 0
        for k in range(nodes):
            if excess[k] <= 1.0:
                continue
            is_worst = True
            for j in range(start[k], adjacent_end[k]):
                n = near[j]
                if n < nodes and (excess[n] > excess[k] or (excess[n] == excess[k] and n < k)):
                    is_worst = False
            if is_worst:
                chosen[number] = k
                number += 1
        for c in range(number):
            k = chosen[c]
            used[owner[k]] = False
            owner[k] = -1
            excess[k] = 0.0
            for j in range(start[k], start[k + 1]):
                if near[j] < nodes:
                    is_changed[near[j]] = True
        dropped += number
    return dropped


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def unfold(dot, net, triangle, owner, excess, used):
    """Drops, of each triangle that turned over or collapsed, the corner its neighbours contradict most."""
    rest = net[0]
    for t in range(len(triangle)):
        a, b, c = triangle[t]
        if owner[a] < 0 or owner[b] < 0 or owner[c] < 0:
            continue
        i, j, l = owner[a], owner[b], owner[c]  # noqa: E741
        now = (dot[j, 0] - dot[i, 0]) * (dot[l, 1] - dot[i, 1]) - (dot[j, 1] - dot[i, 1]) * (
            dot[l, 0] - dot[i, 0]
        )
        then = (rest[b, 0] - rest[a, 0]) * (rest[c, 1] - rest[a, 1]) - (rest[b, 1] - rest[a, 1]) * (
            rest[c, 0] - rest[a, 0]
        )
        if now < _FOLD * then:
            worst = a
            if excess[b] > excess[worst]:
                worst = b
            if excess[c] > excess[worst]:
                worst = c
            used[owner[worst]] = False
            owner[worst] = -1


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def doubtful(dot, bins, cell_px, markers, net, moved, owner, bounds, used, free, is_doubtful):
    """Marks markers without a dot that have dots without a marker near them, several side by side.

    A dot that only vanished leaves no other; where a part of the pattern was mistaken, its rim leaves many.
    `moved` holds displacements of all nodes, `free` (N,) is scratch. Returns how many were marked.
    """
    rest, kind, spacing, start, adjacent_end, near, _, _, _, _ = net
    any_free = False
    for k in range(markers):
        free[k] = -1
        if owner[k] >= 0 or kind[k] != 0:
            continue
        x, y = rest[k, 0] + moved[k, 0], rest[k, 1] + moved[k, 1]
        if bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]:
            free[k] = _nearest_free(dot, bins, cell_px, x, y, _REACH * spacing[k], used)
            any_free = any_free or free[k] >= 0
    number = 0
    is_doubtful[:markers] = False
    if not any_free:
        return number
    for k in range(markers):
        if free[k] < 0:
            continue
        beside = others = 0
        for j in range(start[k], adjacent_end[k]):
            n = near[j]
            if n < markers and free[n] >= 0:
                beside += 1
                others += free[n] != free[k]
        # One false dot may lie near several missing ones, but it is one dot.
        if beside >= 2 and others >= 1 and _is_torn(k, spacing, start, near, moved, owner):
            is_doubtful[k] = True
            number += 1
    return number


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _nearest_free(dot, bins, cell_px, x, y, reach, used):
    """The nearest unused dot within reach, or -1."""
    low_x, low_y, columns, rows, start, binned = bins
    left, right, top, bottom = around(x - low_x, y - low_y, reach, columns, rows, 1.0 / cell_px)
    best, first = -1, reach * reach
    if right < left:
        return best
    for row in range(top, bottom + 1):
        for j in range(start[row * columns + left], start[row * columns + right + 1]):
            i = binned[j]
            if not used[i]:
                d = (dot[i, 0] - x) ** 2 + (dot[i, 1] - y) ** 2
                if d < first:
                    best, first = i, d
    return best


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _is_torn(k, spacing, start, near, moved, owner):
    """Do the displacements around a node differ by most of a pitch?"""
    left = top = np.inf
    right = bottom = -np.inf
    for j in range(start[k], start[k + 1]):
        n = near[j]
        if owner[n] >= 0:
            left, right = min(left, moved[n, 0]), max(right, moved[n, 0])
            top, bottom = min(top, moved[n, 1]), max(bottom, moved[n, 1])
    return max(right - left, bottom - top) > _TORN * spacing[k]


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def part(markers, net, owner, is_doubtful, added):
    """Takes the dots from the neighbours of doubtful markers and makes them doubtful too, to part the rest.

    `added` (N,) is scratch.
    """
    _, _, _, start, _, near, _, _, _, _ = net
    number = 0
    for k in range(markers):
        if is_doubtful[k]:
            added[number] = k
            number += 1
    for c in range(number):
        k = added[c]
        for j in range(start[k], start[k + 1]):
            owner[near[j]] = -1
            if near[j] < markers:
                is_doubtful[near[j]] = True
