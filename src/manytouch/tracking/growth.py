"""Kernels that tell which dot is which marker in one frame: seeds, growth, verification.

A guess of every marker's place gives seeds. Only the largest set of neighbouring seeds that moved alike is
believed; from it identities grow from neighbour to neighbour, each predicted by a local affine fit of the
neighbours' displacements (with few neighbours this is their mean, along a line the extrapolation, with
three corners of a cell the parallelogram). What the neighbours then contradict is dropped, so a part of the
pattern that was mistaken by one pitch cannot stay: the ring around it tears.

Flat arrays, numba, one thread. `owner` (m,) is the dot of each marker or -1, `net` is `Mesh.net`.
"""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0912, PLR0917 - compiled functions hold whole loops and take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

_SEED_GATE = 0.45
_SEED_STEP = 0.2
_WIDE_GATE = 0.42
_NARROW_GATE = 0.08
_RATIO_SQUARED = 0.36
_RIDGE = 0.05
_LEAST_TOLERANCE = 0.1
_MOST_TOLERANCE = 0.45
_TEAR_ADJACENT = 0.55
_TEAR_NEAR = 0.7
_FOLD = 0.08
_SETTLED = 0.08


@njit(cache=True, error_model="numpy")
@no_type_check
def bin_dots(dot, cell_px):
    """Hash grid of dots: origin (2,), shape (2,), start of each cell, dots in the order of their cells."""
    low = np.array([dot[:, 0].min(), dot[:, 1].min()])
    columns = int((dot[:, 0].max() - low[0]) / cell_px) + 1
    rows = int((dot[:, 1].max() - low[1]) / cell_px) + 1
    cell = np.empty(len(dot), np.int64)
    start = np.zeros(rows * columns + 1, np.int64)
    for i in range(len(dot)):
        cell[i] = int((dot[i, 1] - low[1]) / cell_px) * columns + int((dot[i, 0] - low[0]) / cell_px)
        start[cell[i] + 1] += 1
    for c in range(rows * columns):
        start[c + 1] += start[c]
    fill = start.copy()
    binned = np.empty(len(dot), np.int64)
    for i in range(len(dot)):
        binned[fill[cell[i]]] = i
        fill[cell[i]] += 1
    return low, columns, rows, start, binned


@njit(cache=True, error_model="numpy")
@no_type_check
def _nearest(dot, bins, cell_px, x, y, gate_px):
    """Nearest dot within a gate or -1, its squared distance, and of the second nearest within 1.7 gates."""
    low, columns, rows, start, binned = bins
    reach = 1.7 * gate_px
    best, first, second = -1, gate_px * gate_px, reach * reach
    left = max(0, int(np.floor((x - reach - low[0]) / cell_px)))
    right = min(columns - 1, int(np.floor((x + reach - low[0]) / cell_px)))
    top = max(0, int(np.floor((y - reach - low[1]) / cell_px)))
    bottom = min(rows - 1, int(np.floor((y + reach - low[1]) / cell_px)))
    for row in range(top, bottom + 1):
        if right < left:
            break
        for j in range(start[row * columns + left], start[row * columns + right + 1]):
            i = binned[j]
            d = (dot[i, 0] - x) ** 2 + (dot[i, 1] - y) ** 2
            if d < first:
                second = first if best >= 0 else second
                first, best = d, i
            elif d < second:
                second = d
    return best, first, second


@njit(cache=True, error_model="numpy")
@no_type_check
def _root(parent, k):
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@njit(cache=True, error_model="numpy")
@no_type_check
def _seeds(dot, bins, cell_px, guess, net, owner):
    """Mutually nearest pairs of guessed markers and dots."""
    present, spacing, _, _, _ = net
    taker = np.full(len(dot), -1)
    taken = np.full(len(dot), np.inf)
    for k in range(len(guess)):
        owner[k] = -1
        if not present[k]:
            continue
        i, d, _ = _nearest(dot, bins, cell_px, guess[k, 0], guess[k, 1], _SEED_GATE * spacing[k])
        if i >= 0:
            owner[k] = i
            if d < taken[i]:
                taken[i], taker[i] = d, k
    for k in range(len(guess)):
        if owner[k] >= 0 and taker[owner[k]] != k:
            owner[k] = -1


@njit(cache=True, error_model="numpy")
@no_type_check
def _keep_largest(dot, base, net, owner, limits):
    """Drops all but the largest set of neighbours whose displacements from `base` differ little along edges.

    `limits`: largest difference, in spacings, along adjacent edges and along the other near ones (0: unused).
    """
    _, spacing, start, adjacent_end, near = net
    parent = np.arange(len(base))
    for k in range(len(base)):
        if owner[k] < 0:
            continue
        ux, uy = dot[owner[k], 0] - base[k, 0], dot[owner[k], 1] - base[k, 1]
        end = start[k + 1] if limits[1] > 0.0 else adjacent_end[k]
        for j in range(start[k], end):
            n = near[j]
            if owner[n] < 0:
                continue
            limit = (limits[0] if j < adjacent_end[k] else limits[1]) * spacing[k]
            dx, dy = dot[owner[n], 0] - base[n, 0] - ux, dot[owner[n], 1] - base[n, 1] - uy
            if dx * dx + dy * dy < limit * limit:
                parent[_root(parent, n)] = _root(parent, k)
    size = np.zeros(len(base), np.int64)
    for k in range(len(base)):
        if owner[k] >= 0:
            size[_root(parent, k)] += 1
    largest = np.argmax(size)
    for k in range(len(base)):
        if owner[k] >= 0 and _root(parent, k) != largest:
            owner[k] = -1
    return size[largest]


@njit(cache=True, error_model="numpy")
@no_type_check
def _affine(k, dot, base, net, owner, former, robust):
    """Affine fit of the displacements from `base` around marker k, weights falling with distance.

    `former` is the fit that robust weights refer to. Returns the fit (shift x, y; gradient xx, xy, yx, yy)
    and the numbers of adjacent and of near neighbours used.
    """
    _, spacing, start, adjacent_end, near = net
    scale = spacing[k] * spacing[k]
    adjacent = used = 0
    s0 = sx = sy = sxx = sxy = syy = 0.0
    ax = axx = axy = ay = ayx = ayy = 0.0
    for j in range(start[k], start[k + 1]):
        n = near[j]
        if owner[n] < 0:
            continue
        x, y = base[n, 0] - base[k, 0], base[n, 1] - base[k, 1]
        u, v = dot[owner[n], 0] - base[n, 0], dot[owner[n], 1] - base[n, 1]
        w = 1.0 / ((x * x + y * y) / scale + 0.3)
        if robust:
            w /= (1.0 + _squared_error(x, y, u, v, former) / (0.02 * scale)) ** 2
        adjacent += j < adjacent_end[k]
        used += 1
        s0 += w
        sx += w * x
        sy += w * y
        sxx += w * x * x
        sxy += w * x * y
        syy += w * y * y
        ax += w * u
        axx += w * u * x
        axy += w * u * y
        ay += w * v
        ayx += w * v * x
        ayy += w * v * y
    if used == 0:
        return former, 0, 0
    # Centred normal equations with a ridge: a direction without evidence gets no gradient.
    mx, my, mu, mv = sx / s0, sy / s0, ax / s0, ay / s0
    a = sxx - s0 * mx * mx + _RIDGE * scale
    b = sxy - s0 * mx * my
    c = syy - s0 * my * my + _RIDGE * scale
    det = a * c - b * b
    px, py = axx - s0 * mx * mu, axy - s0 * my * mu
    qx, qy = ayx - s0 * mx * mv, ayy - s0 * my * mv
    gxx, gxy = (c * px - b * py) / det, (a * py - b * px) / det
    gyx, gyy = (c * qx - b * qy) / det, (a * qy - b * qx) / det
    return (mu - gxx * mx - gxy * my, mv - gyx * mx - gyy * my, gxx, gxy, gyx, gyy), adjacent, used


@njit(cache=True, inline="always")
@no_type_check
def _squared_error(x, y, u, v, fit):
    return (u - fit[0] - fit[2] * x - fit[3] * y) ** 2 + (v - fit[1] - fit[4] * x - fit[5] * y) ** 2


@njit(cache=True, error_model="numpy")
@no_type_check
def _predict(k, dot, base, net, owner, robust):
    """Displacement of marker k from `base` that its neighbours' affine fit gives.

    Returns: x, y, weighted rms of the fit in px, number of adjacent and of near neighbours used.
    """
    _, spacing, start, _, near = net
    fit, adjacent, used = _affine(k, dot, base, net, owner, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), False)
    if used == 0:
        return 0.0, 0.0, 0.0, 0, 0
    if robust:
        for _ in range(2):
            fit, adjacent, used = _affine(k, dot, base, net, owner, fit, True)
    scale = spacing[k] * spacing[k]
    total = weight = 0.0
    for j in range(start[k], start[k + 1]):
        n = near[j]
        if owner[n] >= 0:
            x, y = base[n, 0] - base[k, 0], base[n, 1] - base[k, 1]
            e = _squared_error(x, y, dot[owner[n], 0] - base[n, 0], dot[owner[n], 1] - base[n, 1], fit)
            w = 1.0 / ((x * x + y * y) / scale + 0.3)
            if robust:
                w /= (1.0 + e / (0.02 * scale)) ** 2
            total += w * e
            weight += w
    return fit[0], fit[1], np.sqrt(total / weight), adjacent, used


@njit(cache=True, error_model="numpy")
@no_type_check
def _local_spacing(k, x, y, dot, net, owner):
    """Distance now from a predicted place to the nearest neighbour, within 0.5 and 1.5 of that at rest."""
    _, spacing, start, _, near = net
    least = 2.25 * spacing[k] * spacing[k]
    for j in range(start[k], start[k + 1]):
        i = owner[near[j]]
        if i >= 0:
            least = min(least, (dot[i, 0] - x) ** 2 + (dot[i, 1] - y) ** 2)
    return max(0.5 * spacing[k], np.sqrt(least))


@njit(cache=True, error_model="numpy")
@no_type_check
def _grow(dot, bins, cell_px, base, net, owner):
    """Gives unmatched markers, from many matched neighbours to few, the dot at their predicted place."""
    present, _, start, adjacent_end, near = net
    markers = len(base)
    is_used = np.zeros(len(dot), np.bool_)
    for k in range(markers):
        if owner[k] >= 0:
            is_used[owner[k]] = True
    is_fresh = np.ones(markers, np.bool_)
    claim = np.full(len(dot), -1)
    claimed = np.empty(len(dot))
    proposed = np.full(markers, -1)
    need = 4
    while need >= 1:
        found = 0
        for k in range(markers):
            proposed[k] = -1
            if owner[k] >= 0 or not present[k] or not is_fresh[k]:
                continue
            neighbours = 0
            for j in range(start[k], adjacent_end[k]):
                neighbours += owner[near[j]] >= 0
            if neighbours < need:
                continue
            ux, uy, rms, _, used = _predict(k, dot, base, net, owner, False)
            x, y = base[k, 0] + ux, base[k, 1] + uy
            size = _local_spacing(k, x, y, dot, net, owner)
            surrounded = 2 * neighbours > adjacent_end[k] - start[k] and used > 6
            gate = (
                min(_WIDE_GATE * size, _NARROW_GATE * size + 2.5 * rms) if surrounded else _WIDE_GATE * size
            )
            i, d, second = _nearest(dot, bins, cell_px, x, y, gate)
            is_fresh[k] = False
            if i < 0 or is_used[i] or d > _RATIO_SQUARED * second:
                continue
            proposed[k] = i
            found += 1
            if claim[i] < 0 or d < claimed[i]:
                claim[i], claimed[i] = k, d
        added = 0
        for k in range(markers):
            i = proposed[k]
            if i >= 0 and claim[i] == k and not is_used[i]:
                owner[k] = i
                is_used[i] = True
                added += 1
                for j in range(start[k], start[k + 1]):
                    is_fresh[near[j]] = True
        for k in range(markers):
            if proposed[k] >= 0:
                claim[proposed[k]] = -1
                is_fresh[k] = True
        need = 4 if added > 0 and need < 4 else (need if added > 0 else need - 1)


@njit(cache=True, error_model="numpy")
@no_type_check
def _contradicted(dot, rest, net, owner, excess):
    """Fills `excess`: distance of each marker from where its neighbours see it, over what is allowed."""
    _, spacing, start, adjacent_end, near = net
    worst = 0.0
    for k in range(len(rest)):
        excess[k] = 0.0
        if owner[k] < 0:
            continue
        ux, uy = dot[owner[k], 0] - rest[k, 0], dot[owner[k], 1] - rest[k, 1]
        mx = my = 0.0
        count = 0
        for j in range(start[k], adjacent_end[k]):
            i = owner[near[j]]
            if i >= 0:
                mx += dot[i, 0] - rest[near[j], 0]
                my += dot[i, 1] - rest[near[j], 1]
                count += 1
        if count >= 3 and (mx / count - ux) ** 2 + (my / count - uy) ** 2 < (_SETTLED * spacing[k]) ** 2:
            continue
        px, py, rms, _, used = _predict(k, dot, rest, net, owner, True)
        if used < 2:
            excess[k] = 2.0
        else:
            allowed = min(_MOST_TOLERANCE * spacing[k], _LEAST_TOLERANCE * spacing[k] + 2.5 * rms)
            if used < 6:
                allowed = _MOST_TOLERANCE * spacing[k]
            excess[k] = np.sqrt((px - ux) ** 2 + (py - uy) ** 2) / allowed
        worst = max(worst, excess[k])
    return worst


@njit(cache=True, error_model="numpy")
@no_type_check
def _unfold(dot, rest, triangle, owner, excess):
    """Drops, of each triangle that turned over or collapsed, the corner its neighbours contradict most."""
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
            owner[worst] = -1


@njit(cache=True, error_model="numpy")
@no_type_check
def _verify(dot, rest, net, triangle, owner, excess):
    """Drops what neighbours contradict, the worst of a neighbourhood first, and then what hangs apart."""
    _, _, start, adjacent_end, near = net
    for _ in range(8):
        worst = _contradicted(dot, rest, net, owner, excess)
        if worst <= 1.0:
            break
        dropped = np.zeros(len(rest), np.bool_)
        for k in range(len(rest)):
            if owner[k] < 0 or excess[k] <= 1.0:
                continue
            is_worst = True
            for j in range(start[k], adjacent_end[k]):
                n = near[j]
                if owner[n] >= 0 and (excess[n] > excess[k] or (excess[n] == excess[k] and n < k)):
                    is_worst = False
            dropped[k] = is_worst
        for k in range(len(rest)):
            if dropped[k]:
                owner[k] = -1
    _unfold(dot, rest, triangle, owner, excess)
    limits = (_TEAR_ADJACENT, _TEAR_NEAR)
    return _keep_largest(dot, rest, net, owner, limits)


@njit(cache=True, error_model="numpy")
@no_type_check
def identify(dot, bins, cell_px, guess, rest, net, triangle, owner):
    """Fills `owner` from a guess of the markers' places; returns how many markers were identified.

    Args:
        dot: (n, 2) centres.
        bins, cell_px: of `bin_dots`.
        guess: (m, 2) finite places to begin from, good to less than half a spacing in a large part.
        rest: (m, 2) reference places: identities must deform these smoothly.
        net, triangle: of `Mesh`.
        owner: (m,) written.
    """
    excess = np.zeros(len(guess))
    _seeds(dot, bins, cell_px, guess, net, owner)
    limits = (_SEED_STEP, 0.0)
    if _keep_largest(dot, guess, net, owner, limits) == 0:
        return 0
    _grow(dot, bins, cell_px, guess, net, owner)
    number = _verify(dot, rest, net, triangle, owner, excess)
    if number == 0 or number == net[0].sum():
        return number
    _grow(dot, bins, cell_px, rest, net, owner)
    return _verify(dot, rest, net, triangle, owner, excess)
