"""Kernels that decide whether all numbers have slipped along the lattice.

On a regular pattern every slip fits as well, but for what the outline, missing markers and the printed dots'
deviations from the lattice say. Each slip is charged, in nats, for the places where dots appear or are absent
against what was there before, and for how rough its displacements are.
"""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.tracking.matching.dot_appearance import LOOKS, looks, slipped_looks, stride

FAST = {"reassoc", "contract", "nsz", "arcp"}  # NaN stays what it is
_BEYOND = 0.003  # share of places beyond the ghosts that hold a dot by chance
_UNKNOWN = float(np.log(2.0))  # of a place that the image did not show at rest
_LEAST_FOUND = 0.05
_INDEPENDENT = 8.0  # neighbouring roughnesses share causes: so many count as one
_LEAST_BENDS = 12
_FINEST = 0.003
_CLOSENESS, _CONTINUITY, _MOST_MOTION = 10.0, 25.0, 1.5
_NEAR = 0.35
_SAMPLES = 300
_LEAST_MIDDLE, _HALVINGS = 1e-12, 16
_RIGID, _RIGID_NOISES, _RIGID_SAMPLES, _LEAST_SAMPLES = 0.1, 4.0, 80, 16


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _occupation(owner, place, slip, kind, presence, bounds, cost):
    """Adds to `cost` (s,) what dots in unlikely places and empty likely places in view amount to."""
    found = expected = 0.0
    nodes = len(kind)
    shown = np.zeros(nodes, np.bool_)
    for k in range(nodes):
        x, y = place[k, 0], place[k, 1]
        shown[k] = bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]
        if kind[k] == 0 and shown[k]:
            expected += presence[k]
            found += owner[k] >= 0
    share = min(1.0, max(_LEAST_FOUND, found / max(expected, 1.0)))
    full, empty = np.empty(nodes), np.empty(nodes)
    before, log_full, log_empty = -1.0, 0.0, 0.0
    for k in range(nodes):
        # most are as likely as the one before, and logarithms take long
        if presence[k] != before:
            before = presence[k]
            log_full, log_empty = -np.log(before), -np.log(1.0 - before * share)
        full[k] = _UNKNOWN if kind[k] == 3 else log_full
        empty[k] = _UNKNOWN if kind[k] == 3 else log_empty
    for s in range(len(slip)):
        for k in range(nodes):
            t = slip[s, k]
            if owner[k] >= 0:
                beyond = _UNKNOWN if kind[k] == 3 else -np.log(_BEYOND)
                cost[s] += full[t] if t >= 0 else beyond
            elif t >= 0 and shown[k]:
                cost[s] += empty[t]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _number_below(value, limit):
    number = np.float32(0.0)
    for i in range(np.uint64(len(value))):
        number += np.float32(1.0) if value[i] < limit else np.float32(0.0)
    return number


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def middle(value):
    """Median of values (n,) of float32 that are not negative, to a few parts in ten thousand.

    Found by halving: counting runs in lanes, and nothing is foreseen wrongly as when values are sorted.
    """
    high, half = np.float64(value.max()), 0.5 * len(value)
    low = high * _LEAST_MIDDLE
    if high <= 0.0 or _number_below(value, np.float32(low)) > half:
        return 0.0
    for _ in range(_HALVINGS):
        between = np.sqrt(low * high)
        if _number_below(value, np.float32(between)) <= half:
            low = between
        else:
            high = between
    return np.sqrt(low * high)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _deviation(place, owner, rest, spacing, opposite, slip, bend):
    """Median second difference of displacements along the lattice, in spacings, and how many there are."""
    number = 0
    for k in range(0, len(owner), stride(len(owner), _SAMPLES)):
        t = slip[k]
        if owner[k] < 0 or t < 0:
            continue
        for axis in range(2):
            a, b = opposite[k, 2 * axis], opposite[k, 2 * axis + 1]
            if a < 0 or b < 0 or owner[a] < 0 or owner[b] < 0:
                continue
            ta, tb = opposite[t, 2 * axis], opposite[t, 2 * axis + 1]
            if ta < 0 or tb < 0:
                continue
            x = place[a, 0] + place[b, 0] - 2.0 * place[k, 0] - rest[ta, 0] - rest[tb, 0] + 2.0 * rest[t, 0]
            y = place[a, 1] + place[b, 1] - 2.0 * place[k, 1] - rest[ta, 1] - rest[tb, 1] + 2.0 * rest[t, 1]
            bend[number] = (x * x + y * y) / (spacing[k] * spacing[k])
            number += 1
    return (np.sqrt(middle(bend[:number])) if number else np.nan), number


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _motion(place, owner, last, spacing, slip, buffer):
    """Median distance of the dots from where their markers were, in spacings."""
    number = 0
    for k in range(0, len(owner), stride(len(owner), _SAMPLES)):
        t = slip[k]
        if owner[k] >= 0 and 0 <= t < len(last):
            x, y = place[k, 0] - last[t, 0], place[k, 1] - last[t, 1]
            buffer[number] = (x * x + y * y) / (spacing[k] * spacing[k])
            number += 1
    return np.sqrt(middle(buffer[:number])) if number else np.inf


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def jumped(dot, owner, slip, last, unseen, noise_px):
    """Would the dots have moved as one body if the numbers had slipped, and not as they are?

    A sheet that jumps by a pitch in front of the camera keeps its shape; with the old numbers, unevenness of
    the lattice in the image and dents look like motion.
    """
    markers = len(last)
    step = markers // _RIGID_SAMPLES | 1
    own = 0.0
    for s in range(len(slip)):
        x = y = square = 0.0
        number = 0
        for k in range(0, markers, step):
            t = slip[s, k]
            if owner[k] < 0 or t < 0 or t >= markers or unseen[t] > 0:
                continue
            dx, dy = dot[owner[k], 0] - last[t, 0], dot[owner[k], 1] - last[t, 1]
            x += dx
            y += dy
            square += dx * dx + dy * dy
            number += 1
        if number < _LEAST_SAMPLES:
            continue
        spread = (square - (x * x + y * y) / number) / number
        if s == 0:
            own = spread
            if own < (_RIGID_NOISES * noise_px) ** 2:
                return False
        elif spread < _RIGID * own:
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def vote(owner, appearance, place, net, slip, presence, look, usual_look, last, bounds, noise_px, is_next):
    """The likeliest slip, by how many nats the image prefers it to all others, and its median motion.

    Args:
        owner: (N,) dot of each node.
        appearance: (n,) areas and (n,) contrasts of the dots.
        place: (N, 2) of all nodes in the image, also of those without a dot.
        presence: (N,) share of recent frames in which each node had a dot.
        look, usual_look: (m, 2) how the markers' dots look, (2,) how unlike that they usually are.
        last: (m, 2) where the markers were in the last good frame.
        noise_px: standard deviation of a centre.
        is_next: `last` is of the frame before this one.

    Returns:
        slip (row of `slip`), margin, what roughness and looks contribute to it, motion in spacings.
    """
    rest, _, spacing, _, _, _, _, _, _, opposite = net
    slips, nodes = len(slip), len(owner)
    cost, rough = np.zeros(slips), np.zeros(slips)
    _occupation(owner, place, slip, net[1], presence, bounds, cost)
    buffer = np.empty(2 * nodes, np.float32)
    finest = max(_FINEST, noise_px / spacing[0])
    motion = np.empty(slips)
    usual, bends = 0.0, 0
    for s in range(slips):
        motion[s] = _motion(place, owner, last, spacing, slip[s], buffer)
        deviation, number = _deviation(place, owner, rest, spacing, opposite, slip[s], buffer)
        if s == 0:
            usual, bends = deviation, number
        if bends >= _LEAST_BENDS:
            if number < bends // 2:
                deviation = usual
            rough[s] = bends / _INDEPENDENT * np.log(finest + deviation)
    now = np.empty((nodes, 2))
    looks(nodes, stride(nodes, LOOKS), owner, appearance, net, now)
    slipped_looks(now, slip, look, usual_look, rough)
    closeness = _CONTINUITY if is_next and motion[0] < _NEAR else _CLOSENESS
    best = 0
    for s in range(slips):
        charge = cost[s] + rough[s] + closeness * min(motion[s], _MOST_MOTION)
        if charge < cost[best] + rough[best] + closeness * min(motion[best], _MOST_MOTION):
            best = s
    margin = by_roughness = np.inf
    for s in range(slips):
        if s != best:
            margin = min(margin, cost[s] + rough[s] - cost[best] - rough[best])
            by_roughness = min(by_roughness, rough[s] - rough[best])
    return best, margin, by_roughness, motion[best]
