"""Kernels that grow identities from neighbour to neighbour, markers and the ghosts around them alike.

Each next place is predicted by quadratic extrapolation of the displacements from rest along the lines of the
lattice, where three in a row are known, else by a local affine fit (with few neighbours this is their mean,
along a line the extrapolation, with three corners of a cell the parallelogram); those with many known
neighbours first. Flat arrays as `Mesh` holds them; `owner` (N,) is the dot of each node or -1, `moved` (N, 2)
its displacement from rest.
"""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0912, PLR0917 - compiled functions hold whole loops and take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.tracking.bins import nearest_two

_WIDE_GATE = 0.4
_NARROW_GATE = 0.08
_RATIO_SQUARED = 0.36
_RIDGE = 0.05
_ROBUST = 0.02
_LEAST_LEVEL, _MOST_LEVEL = 1, 4
_LEAST_APART = 5


@njit(cache=True, error_model="numpy")
@no_type_check
def _root(parent, k):
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@njit(cache=True, error_model="numpy")
@no_type_check
def keep_largest(nodes, net, shift, owner, limit, parent, size):
    """Drops all but the largest set of adjacent nodes whose `shift` (N, 2) differs by less than `limit`.

    `limit` is in spacings. Returns the size of that set.
    """
    _, _, spacing, start, end, near, _, _, _, _ = net
    for k in range(nodes):
        parent[k] = k
        size[k] = 0
    for k in range(nodes):
        if owner[k] < 0:
            continue
        most = (limit * spacing[k]) ** 2
        for j in range(start[k], end[k]):
            n = near[j]
            if n < nodes and owner[n] >= 0:
                dx, dy = shift[n, 0] - shift[k, 0], shift[n, 1] - shift[k, 1]
                if dx * dx + dy * dy < most:
                    parent[_root(parent, n)] = _root(parent, k)
    for k in range(nodes):
        if owner[k] >= 0:
            size[_root(parent, k)] += 1
    largest = 0
    for k in range(nodes):
        if size[k] > size[largest]:
            largest = k
    for k in range(nodes):
        if owner[k] >= 0 and _root(parent, k) != largest:
            owner[k] = -1
    return size[largest]


@njit(cache=True, error_model="numpy")
@no_type_check
def affine(k, rest, moved, owner, spacing, start, adjacent_end, near, weight, former, robust):
    """Affine fit of the known displacements around node k.

    `former` is the fit that robust weights refer to. Returns the fit (shift x, y; gradient xx, xy, yx, yy)
    and the numbers of adjacent and of near neighbours used.
    """
    scale = spacing[k] * spacing[k]
    adjacent = used = 0
    s0 = sx = sy = sxx = sxy = syy = 0.0
    ax = axx = axy = ay = ayx = ayy = 0.0
    for j in range(start[k], start[k + 1]):
        n = near[j]
        if owner[n] < 0:
            continue
        x, y = rest[n, 0] - rest[k, 0], rest[n, 1] - rest[k, 1]
        u, v = moved[n, 0], moved[n, 1]
        w = weight[j]
        if robust:
            w /= (1.0 + _squared_error(x, y, u, v, former) / (_ROBUST * scale)) ** 2
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
def roughness(k, rest, moved, owner, spacing, start, near, weight, fit, robust):
    """Weighted rms of a fit's residuals in px."""
    scale = spacing[k] * spacing[k]
    total = all_weight = 0.0
    for j in range(start[k], start[k + 1]):
        n = near[j]
        if owner[n] >= 0:
            e = _squared_error(
                rest[n, 0] - rest[k, 0], rest[n, 1] - rest[k, 1], moved[n, 0], moved[n, 1], fit
            )
            w = weight[j]
            if robust:
                w /= (1.0 + e / (_ROBUST * scale)) ** 2
            total += w * e
            all_weight += w
    return np.sqrt(total / all_weight)


@njit(cache=True, error_model="numpy")
@no_type_check
def least_stretch(fit):
    """By how much the lattice is compressed where it is most, from the gradient of a fit; 0.35 to 1.2."""
    a, b, c, d = 1.0 + fit[2], fit[3], fit[4], 1.0 + fit[5]
    square = a * a + b * b + c * c + d * d
    det = a * d - b * c
    least = 0.5 * (square - np.sqrt(max(0.0, square * square - 4.0 * det * det)))
    return min(1.2, max(0.35, np.sqrt(max(0.0, least))))


@njit(cache=True, error_model="numpy")
@no_type_check
def _along_lines(k, moved, owner, opposite):
    """Displacement that quadratics through three known nodes in a row give node k, and the number of rows."""
    x = y = 0.0
    rows = 0
    for d in range(4):
        a = opposite[k, d]
        if a < 0 or owner[a] < 0:
            continue
        b = opposite[a, d]
        if b < 0 or owner[b] < 0:
            continue
        c = opposite[b, d]
        if c < 0 or owner[c] < 0:
            continue
        x += 3.0 * (moved[a, 0] - moved[b, 0]) + moved[c, 0]
        y += 3.0 * (moved[a, 1] - moved[b, 1]) + moved[c, 1]
        rows += 1
    return (x / rows, y / rows, rows) if rows else (0.0, 0.0, 0)


@njit(cache=True, error_model="numpy")
@no_type_check
def _dot_of(
    k,
    need,
    dot,
    bins,
    cell_px,
    rest,
    moved,
    owner,
    spacing,
    start,
    adjacent_end,
    near,
    weight,
    opposite,
    tried,
):
    """The dot at the place that its neighbours give node k; -1: none there, -2: too few neighbours."""
    known = 0
    for j in range(start[k], adjacent_end[k]):
        known += owner[near[j]] >= 0
    if known < need and not (need == _LEAST_LEVEL and known == 0):
        return -2
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    fit, adjacent, used = affine(
        k, rest, moved, owner, spacing, start, adjacent_end, near, weight, zero, False
    )
    if used < need + 1 or (known == 0 and used < _LEAST_APART):
        return -2
    if used < tried[k] + 2:
        return -1
    tried[k] = used
    gate = _WIDE_GATE * least_stretch(fit) * spacing[k]
    ux, uy, rows = _along_lines(k, moved, owner, opposite)
    if rows == 0:
        ux, uy = fit[0], fit[1]
    if 2 * adjacent > adjacent_end[k] - start[k] and used > 6:
        rms = roughness(k, rest, moved, owner, spacing, start, near, weight, fit, False)
        gate = min(gate, _NARROW_GATE * spacing[k] + 2.5 * rms)
    i, d, second = nearest_two(dot, bins, cell_px, rest[k, 0] + ux, rest[k, 1] + uy, gate)
    if i >= 0 and d <= _RATIO_SQUARED * second:
        return i
    if rows > 0:
        i, d, second = nearest_two(dot, bins, cell_px, rest[k, 0] + fit[0], rest[k, 1] + fit[1], gate)
    return i if i >= 0 and d <= _RATIO_SQUARED * second else -1


@njit(cache=True, error_model="numpy")
@no_type_check
def grow(dot, bins, cell_px, nodes, net, moved, owner, used, scratch):
    """Gives those of the first `nodes` nodes that have no dot the one at their predicted place.

    `used` (n,) marks dots that have a node; `scratch` are four arrays (N,).
    """
    rest, _, spacing, start, adjacent_end, near, weight, _, _, opposite = net
    queue, later, is_waiting, tried = scratch
    head = waiting = delayed = 0
    for k in range(nodes):
        is_waiting[k] = False
        tried[k] = -2
        if owner[k] >= 0:
            continue
        for j in range(start[k], adjacent_end[k]):
            if owner[near[j]] >= 0:
                queue[waiting] = k
                waiting += 1
                is_waiting[k] = True
                break
    need = _MOST_LEVEL
    while True:
        if waiting == 0:
            if need == _LEAST_LEVEL or delayed == 0:
                break
            need -= 1
            for j in range(delayed):
                queue[(head + j) % nodes] = later[j]
            waiting, delayed = delayed, 0
            continue
        k = queue[head]
        head = (head + 1) % nodes
        waiting -= 1
        i = _dot_of(
            *(k, need, dot, bins, cell_px, rest, moved, owner, spacing, start, adjacent_end, near, weight),
            *(opposite, tried),
        )
        if i == -2:
            later[delayed] = k
            delayed += 1
            continue
        is_waiting[k] = False
        if i < 0 or used[i]:
            continue
        owner[k] = i
        used[i] = True
        moved[k, 0], moved[k, 1] = dot[i, 0] - rest[k, 0], dot[i, 1] - rest[k, 1]
        need = _MOST_LEVEL
        for j in range(start[k], adjacent_end[k]):
            n = near[j]
            if n < nodes and owner[n] < 0 and not is_waiting[n]:
                queue[(head + waiting) % nodes] = n
                waiting += 1
                is_waiting[n] = True


@njit(cache=True, error_model="numpy")
@no_type_check
def fill(nodes, net, moved, owner, scratch):
    """Gives nodes without a dot the weighted mean displacement of neighbours, going outward from the dots."""
    _, _, _, start, _, near, weight, _, _, _ = net
    queue, _, is_known, _ = scratch
    waiting = total_x = total_y = owned = 0
    for k in range(nodes):
        is_known[k] = owner[k] >= 0
        if owner[k] >= 0:
            total_x += moved[k, 0]
            total_y += moved[k, 1]
            owned += 1
        else:
            moved[k, 0] = moved[k, 1] = np.nan
    if owned == 0:
        return
    for k in range(nodes):
        if owner[k] >= 0:
            continue
        for j in range(start[k], start[k + 1]):
            if near[j] < nodes and owner[near[j]] >= 0:
                queue[waiting] = k
                waiting += 1
                is_known[k] = True
                break
    head = 0
    while head < waiting:
        k = queue[head]
        head += 1
        total = x = y = 0.0
        for j in range(start[k], start[k + 1]):
            n = near[j]
            if n >= nodes:
                continue
            if not np.isnan(moved[n, 0]):
                total += weight[j]
                x += weight[j] * moved[n, 0]
                y += weight[j] * moved[n, 1]
            elif not is_known[n]:
                is_known[n] = True
                queue[waiting] = n
                waiting += 1
        moved[k, 0], moved[k, 1] = x / total, y / total
    for k in range(nodes):
        if np.isnan(moved[k, 0]):
            moved[k, 0], moved[k, 1] = total_x / owned, total_y / owned
