"""Kernels that grow identities from neighbour to neighbour, markers and the ghosts around them alike.

Each next place is predicted by quadratic extrapolation of the displacements from rest along the lines of the
lattice, where three in a row are known, else by a local affine fit (with few neighbours this is their mean,
along a line the extrapolation, with three corners of a cell the parallelogram); those with many known
neighbours first. Flat arrays as in `LatticeGraph`; `owner` (N,) is the dot of each node or -1,
`moved` (N, 2) its displacement from rest.
"""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0912, PLR0915, PLR0917 - compiled functions hold whole loops and take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.tracking.matching.spatial_hash import around

_TOGETHER = 0.15
_WIDE_GATE = 0.4
_NARROW_GATE = 0.08
_LONELY, _LONELY_GATE = 6, 0.2
_RATIO_SQUARED = 0.36
_SECOND = 1.7
_RIDGE = 0.05
_ROBUST = 0.02
_LEAST_LEVEL, _MOST_LEVEL = 1, 4
_LEAST_APART = 5


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _root(parent, k):
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def keep_largest(nodes, net, shift, owner, limit, motion, parent, size):
    """Drops all but the largest set of adjacent nodes whose `shift` (N, 2) differs by less than `limit`.

    Of the first nodes, as many as `motion` (f, 2) holds, those that are only near each other belong together
    as well where their motions differ by less than `_TOGETHER`. In spacings. Returns the size of that set.
    """
    _, _, spacing, start, end, near, _, _, _, _ = net
    for k in range(nodes):
        parent[k] = k
    for k in range(nodes):
        if owner[k] >= 0:
            _join(k, nodes, spacing, start[k], end[k], near, shift, owner, limit, parent)
    largest = _largest(nodes, owner, parent, size)
    for k in range(len(motion)):
        if owner[k] >= 0 and _root(parent, k) != largest:
            _join(k, len(motion), spacing, end[k], start[k + 1], near, motion, owner, _TOGETHER, parent)
    if len(motion):
        largest = _largest(nodes, owner, parent, size)
    for k in range(nodes):
        if owner[k] >= 0 and _root(parent, k) != largest:
            owner[k] = -1
    return size[largest]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
@no_type_check
def _join(k, nodes, spacing, first, last, near, shift, owner, limit, parent):
    """Makes one set of node k and those of some neighbours that shifted alike."""
    own, most = _root(parent, k), (limit * spacing[k]) ** 2
    for j in range(first, last):
        n = near[j]
        if n < nodes and owner[n] >= 0 and parent[n] != own:
            dx, dy = shift[n, 0] - shift[k, 0], shift[n, 1] - shift[k, 1]
            if dx * dx + dy * dy < most:
                parent[_root(parent, n)] = own


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _largest(nodes, owner, parent, size):
    """Root of the largest set; fills the sizes of all."""
    size[:nodes] = 0
    largest = 0
    for k in range(nodes):
        if owner[k] >= 0:
            root = _root(parent, k)
            size[root] += 1
            if size[root] > size[largest]:
                largest = root
    return largest


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, inline="always")
@no_type_check
def _squared_error(x, y, u, v, fit):
    return (u - fit[0] - fit[2] * x - fit[3] * y) ** 2 + (v - fit[1] - fit[4] * x - fit[5] * y) ** 2


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def least_stretch(gxx, gxy, gyx, gyy):
    """By how much the lattice is compressed where it is most, from a displacement gradient; 0.35 to 1.2."""
    a, b, c, d = 1.0 + gxx, gxy, gyx, 1.0 + gyy
    square = a * a + b * b + c * c + d * d
    det = a * d - b * c
    least = 0.5 * (square - np.sqrt(max(0.0, square * square - 4.0 * det * det)))
    return min(1.2, max(0.35, np.sqrt(max(0.0, least))))


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _begin(nodes, start, adjacent_end, near, owner, queue, is_waiting, tried):
    """Queues the nodes without a dot that are adjacent to one with a dot; returns how many."""
    waiting = 0
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
    return waiting


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def grow(dot, bins, cell_px, nodes, net, moved, owner, used, scratch):
    """Gives those of the first `nodes` nodes that have no dot the one at their predicted place.

    `used` (n,) marks dots that have a node; `scratch` are four arrays (N,). One body: a call per node, with
    its arrays counted in and out, would cost more than the node.
    """
    rest, _, spacing, start, adjacent_end, near, weight, _, _, opposite = net
    low_x, low_y, columns, rows, first_of, binned = bins
    queue, later, is_waiting, tried = scratch
    waiting = _begin(nodes, start, adjacent_end, near, owner, queue, is_waiting, tried)
    head = delayed = 0
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
        # The affine fit of `affine`, without robustness.
        size = spacing[k]
        known = count = 0
        s0 = sx = sy = sxx = sxy = syy = ax = axx = axy = ay = ayx = ayy = square = 0.0
        for j in range(start[k], start[k + 1]):
            n = near[j]
            if owner[n] < 0:
                continue
            x, y, w = rest[n, 0] - rest[k, 0], rest[n, 1] - rest[k, 1], weight[j]
            u, v = moved[n, 0], moved[n, 1]
            known += j < adjacent_end[k]
            count += 1
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
            square += w * (u * u + v * v)
        is_weak = known < need and not (need == _LEAST_LEVEL and known == 0)
        if is_weak or count < need + 1 or (known == 0 and count < _LEAST_APART):
            later[delayed] = k
            delayed += 1
            continue
        is_waiting[k] = False
        if count < tried[k] + 2:
            continue
        tried[k] = count
        mx, my, mu, mv = sx / s0, sy / s0, ax / s0, ay / s0
        a, b = sxx - s0 * mx * mx + _RIDGE * size * size, sxy - s0 * mx * my
        c = syy - s0 * my * my + _RIDGE * size * size
        det = a * c - b * b
        px, py = axx - s0 * mx * mu, axy - s0 * my * mu
        qx, qy = ayx - s0 * mx * mv, ayy - s0 * my * mv
        gxx, gxy = (c * px - b * py) / det, (a * py - b * px) / det
        gyx, gyy = (c * qx - b * qy) / det, (a * qy - b * qx) / det
        fit_x, fit_y = mu - gxx * mx - gxy * my, mv - gyx * mx - gyy * my
        gate = _WIDE_GATE * size * least_stretch(gxx, gxy, gyx, gyy)
        if 2 * known > adjacent_end[k] - start[k] and count > 6:
            explained = gxx * px + gxy * py + gyx * qx + gyy * qy
            rms = np.sqrt(max(0.0, (square - s0 * (mu * mu + mv * mv) - explained) / s0))
            gate = min(gate, _NARROW_GATE * size + 2.5 * rms)
        elif count <= _LONELY:
            gate = min(gate, _LONELY_GATE * size)
        # Quadratics through three known nodes in a row.
        lines = 0
        to_x = to_y = 0.0
        for d in range(4):
            a1 = opposite[k, d]
            if a1 < 0 or owner[a1] < 0:
                continue
            a2 = opposite[a1, d]
            if a2 < 0 or owner[a2] < 0:
                continue
            a3 = opposite[a2, d]
            if a3 < 0 or owner[a3] < 0:
                continue
            to_x += 3.0 * (moved[a1, 0] - moved[a2, 0]) + moved[a3, 0]
            to_y += 3.0 * (moved[a1, 1] - moved[a2, 1]) + moved[a3, 1]
            lines += 1
        found = -1
        for attempt in range(2):
            if attempt == 0 and lines == 0:
                continue
            x = rest[k, 0] + (to_x / lines if attempt == 0 else fit_x)
            y = rest[k, 1] + (to_y / lines if attempt == 0 else fit_y)
            reach = _SECOND * gate
            best, first, second = -1, gate * gate, reach * reach
            left, right, top, bottom = around(x - low_x, y - low_y, reach, columns, rows, 1.0 / cell_px)
            if right < left:
                continue
            for row in range(top, bottom + 1):
                for j in range(first_of[row * columns + left], first_of[row * columns + right + 1]):
                    i = binned[j]
                    e = (dot[i, 0] - x) ** 2 + (dot[i, 1] - y) ** 2
                    if e < first:
                        second = first if best >= 0 else second
                        first, best = e, i
                    elif e < second:
                        second = e
            if best >= 0 and first <= _RATIO_SQUARED * second:
                found = best
                break
        if found < 0 or used[found]:
            continue
        owner[k] = found
        used[found] = True
        moved[k, 0], moved[k, 1] = dot[found, 0] - rest[k, 0], dot[found, 1] - rest[k, 1]
        need = _MOST_LEVEL
        for j in range(start[k], adjacent_end[k]):
            n = near[j]
            if n < nodes and owner[n] < 0 and not is_waiting[n]:
                queue[(head + waiting) % nodes] = n
                waiting += 1
                is_waiting[n] = True


@njit(cache=True, nogil=True, error_model="numpy")
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
