"""The kernel that tells which dot is which node in one frame: match, grow, verify, and ask for slips."""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.tracking.bins import match, nearest_two
from manytouch.tracking.growth import fill, grow, keep_largest
from manytouch.tracking.slips import vote
from manytouch.tracking.verification import doubtful, part, unfold, verify

_GATE = 0.45
_ALIKE = 0.15
_CALM_PITCHES = 0.3
_CALM_SHARE = 0.9
_ODD_SHARE = 0.05
_TROUBLE = 4
_TEAR = 0.45
_GHOST_GATE = 0.25
_LEAST_MARGIN = 8.0
_NEAR_PITCHES = 0.35
_REST_PITCHES = 0.25
_ROUGHER, _ROUGHER_PITCHES, _ROUGHEST_PITCHES = 1.7, 0.004, 0.15
_VOTES = 3
_FEW = 2
_TURNS = 5


@njit(cache=True, error_model="numpy")
@no_type_check
def _alike(dot, guess, owner, spacing, start, adjacent_end, near, shift, is_odd):
    """Fills `shift`, dot minus guess, and which matches have few adjacent ones that moved alike.

    Returns the numbers of the others and of the odd ones.
    """
    markers = len(guess)
    for k in range(markers):
        if owner[k] >= 0:
            shift[k, 0], shift[k, 1] = dot[owner[k], 0] - guess[k, 0], dot[owner[k], 1] - guess[k, 1]
    good = odd = 0
    for k in range(markers):
        is_odd[k] = False
        if owner[k] < 0:
            continue
        most = (_ALIKE * spacing[k]) ** 2
        known = same = 0
        for j in range(start[k], adjacent_end[k]):
            n = near[j]
            if n < markers and owner[n] >= 0:
                known += 1
                same += (shift[n, 0] - shift[k, 0]) ** 2 + (shift[n, 1] - shift[k, 1]) ** 2 < most
        is_odd[k] = 2 * same < known or known == 0
        odd += is_odd[k]
        good += not is_odd[k]
    return good, odd


@njit(cache=True, error_model="numpy")
@no_type_check
def _trouble(dot, last, unseen, owner, kind, spacing, start, adjacent_end, near, is_odd, points):
    """Is there a place where neighbours are odd, or moved far, or vanished together?

    `points` (N,) is scratch. One false or missing dot is no trouble; the rim of a part that moved is.
    """
    markers = len(last)
    for k in range(markers):
        points[k] = 0
        if owner[k] >= 0:
            x, y = dot[owner[k], 0] - last[k, 0], dot[owner[k], 1] - last[k, 1]
            is_fast = x * x + y * y > (_CALM_PITCHES * spacing[k]) ** 2
            points[k] = 2 if is_odd[k] or is_fast else 0
        elif kind[k] == 0 and unseen[k] == 0:
            points[k] = 1
    for k in range(markers):
        if points[k] > 0:
            total = points[k]
            for j in range(start[k], adjacent_end[k]):
                if near[j] < markers:
                    total += points[near[j]]
            if total >= _TROUBLE:
                return True
    return False


@njit(cache=True, error_model="numpy")
@no_type_check
def _displace(dot, rest, owner, nodes, moved, used):
    """Fills the displacements of owned nodes, and which dots are used."""
    used[: len(dot)] = False
    for k in range(nodes):
        i = owner[k]
        if i >= 0:
            moved[k, 0], moved[k, 1] = dot[i, 0] - rest[k, 0], dot[i, 1] - rest[k, 1]
            used[i] = True


@njit(cache=True, error_model="numpy")
@no_type_check
def _newly(owner, unseen, kind):
    """Markers that show no dot but did in the last frame."""
    number = 0
    for k in range(len(unseen)):
        number += owner[k] < 0 and unseen[k] == 0 and kind[k] == 0
    return number


@njit(cache=True, error_model="numpy")
@no_type_check
def _on_ghosts(dot, bins, cell_px, rest, moved, spacing, kind, presence, used):
    """How many ghosts that are usually empty have a dot near them."""
    number = 0
    for k in range(len(rest)):
        if kind[k] == 0 or presence[k] > 0.1:
            continue
        x, y = rest[k, 0] + moved[k, 0], rest[k, 1] + moved[k, 1]
        i, _, _ = nearest_two(dot, bins, cell_px, x, y, _GHOST_GATE * spacing[k])
        number += i >= 0 and not used[i]
    return number


@njit(cache=True, error_model="numpy")
@no_type_check
def rough(moved, owner, markers, spacing, opposite):
    """Mean second difference of displacements along the lattice, clipped, in spacings; NaN: there is none."""
    total = 0.0
    number = 0
    for k in range(markers):
        if owner[k] < 0:
            continue
        for axis in range(2):
            a, b = opposite[k, 2 * axis], opposite[k, 2 * axis + 1]
            if a < 0 or b < 0 or owner[a] < 0 or owner[b] < 0:
                continue
            x = moved[a, 0] + moved[b, 0] - 2.0 * moved[k, 0]
            y = moved[a, 1] + moved[b, 1] - 2.0 * moved[k, 1]
            total += min(_ROUGHEST_PITCHES, np.sqrt(x * x + y * y) / spacing[k])
            number += 1
    return total / number if number else np.nan


@njit(cache=True, error_model="numpy")
@no_type_check
def _median_motion(dot, owner, base, spacing):
    buffer = np.empty(len(base))
    number = 0
    for k in range(len(base)):
        if owner[k] >= 0:
            x, y = dot[owner[k], 0] - base[k, 0], dot[owner[k], 1] - base[k, 1]
            buffer[number] = (x * x + y * y) / (spacing[k] * spacing[k])
            number += 1
    return np.sqrt(np.median(buffer[:number])) if number else np.inf


@njit(cache=True, error_model="numpy")
@no_type_check
def _seeded(dot, bins, cell_px, guess, past, net, owner, moved, scratch):
    """Matches dots to a guess and keeps what can be believed: how many are they, and is the frame calm?"""
    last, unseen, _, before, _, is_next, _ = past
    _, kind, spacing, start, adjacent_end, near, _, _, _, _ = net
    taker, _, _, parent, size, flag, queue, _, _, _, _ = scratch
    owner[len(guess) :] = -1
    match(dot, bins, cell_px, guess, kind, spacing, _GATE, owner, taker)
    good, odd = _alike(dot, guess, owner, spacing, start, adjacent_end, near, moved, flag)
    is_calm = (
        is_next
        and good >= _CALM_SHARE * before
        and odd <= _ODD_SHARE * good + 2
        and not _trouble(dot, last, unseen, owner, kind, spacing, start, adjacent_end, near, flag, queue)
    )
    if is_calm:
        for k in range(len(guess)):
            if flag[k]:
                owner[k] = -1
    elif good:
        good = keep_largest(len(guess), net, moved, owner, _ALIKE, parent, size)
    return good, is_calm


@njit(cache=True, error_model="numpy")
@no_type_check
def _grown(dot, bins, cell_px, markers, is_calm, past, net, bounds, noise_px, owner, moved, scratch):
    """Grows and verifies; where a part was mistaken, takes its rim away and grows again from what is left."""
    _, used, excess, parent, size, flag, queue, later, is_waiting, tried, _ = scratch
    lists = (queue, later, is_waiting, tried)
    nodes = len(owner)
    reach = markers if is_calm else nodes
    for turn in range(_TURNS):
        grow(dot, bins, cell_px, reach, net, moved, owner, used, lists)
        dropped = verify(reach, net, past, moved, owner, 3.0 * noise_px, is_calm, used, excess, flag, queue)
        if is_calm:
            break
        fill(nodes, net, moved, owner, lists)
        if doubtful(dot, bins, cell_px, markers, net, moved, owner, bounds, used, later, flag):
            # Each time more is taken away on both sides of the rim, until the mistake is parted or gone.
            for _ in range(turn + 1):
                part(markers, net, owner, flag, later)
            keep_largest(nodes, net, moved, owner, _TEAR, parent, size)
            _displace(dot, net[0], owner, nodes, moved, used)
        elif dropped == 0 or turn > 0:
            break


@njit(cache=True, error_model="numpy")
@no_type_check
def _is_doubtful(dot, bins, cell_px, is_calm, fresh, past, net, owner, moved, used, lists):
    """Could the numbers have slipped since the last frame?"""
    _, unseen, presence, _, level, _, _ = past
    rest, kind, spacing, _, _, _, _, _, _, _ = net
    markers = len(unseen)
    if not is_calm or fresh > _ROUGHER * level + _ROUGHER_PITCHES:
        return True
    if len(rest) == markers or _newly(owner, unseen, kind) <= _FEW:
        return False
    fill(len(rest), net, moved, owner, lists)
    return _on_ghosts(dot, bins, cell_px, rest, moved, spacing, kind, presence, used) > _FEW


@njit(cache=True, error_model="numpy")
@no_type_check
def _unslipped(dot, bins, cell_px, is_calm, past, net, extent, noise_px, owner, moved, scratch):
    """Gives the nodes the dots of the likeliest slip.

    Returns whether the image tells it, and whether it does or the motion excludes all others.
    """
    last, _, presence, _, _, is_next, _ = past
    slip, _, bounds = extent
    rest, _, spacing, _, _, _, _, _, _, _ = net
    _, used, excess, _, _, flag, queue, later, is_waiting, tried, place = scratch
    lists = (queue, later, is_waiting, tried)
    nodes = len(rest)
    if is_calm:
        grow(dot, bins, cell_px, nodes, net, moved, owner, used, lists)
        verify(nodes, net, past, moved, owner, 3.0 * noise_px, True, used, excess, flag, queue)
    margin, by_roughness, motion = 0.0, 0.0, np.inf
    for _ in range(_VOTES):
        fill(nodes, net, moved, owner, lists)
        for k in range(nodes):
            place[k, 0], place[k, 1] = rest[k, 0] + moved[k, 0], rest[k, 1] + moved[k, 1]
        best, margin, by_roughness, motion = vote(
            owner, place, net, slip, presence, last, bounds, noise_px, is_next
        )
        if best == 0:
            break
        queue[:] = owner
        owner[:] = -1
        for k in range(nodes):
            if queue[k] >= 0 and slip[best, k] >= 0:
                owner[slip[best, k]] = queue[k]
        _displace(dot, rest, owner, nodes, moved, used)
        grow(dot, bins, cell_px, nodes, net, moved, owner, used, lists)
        verify(nodes, net, past, moved, owner, 3.0 * noise_px, False, used, excess, flag, queue)
    if margin >= _LEAST_MARGIN:
        return True, True
    if by_roughness < -_LEAST_MARGIN:
        return False, False
    is_near = is_next and motion < _NEAR_PITCHES
    return False, is_near or _median_motion(dot, owner, rest[: len(last)], spacing) < _REST_PITCHES


@njit(cache=True, error_model="numpy")
@no_type_check
def identify(dot, bins, cell_px, guess, past, net, extent, noise_px, owner, moved, scratch):
    """Fills `owner` (N,) and `moved` (N, 2) from a guess of the markers' places.

    Args:
        dot: (n, 2) centres.
        bins, cell_px: of `bin_dots`.
        guess: (m, 2) places to begin from, right for some part of the pattern up to a slip.
        past: places (m, 2) in the last good frame, frames unseen (m,), presence (N,), number seen then,
            roughness then, whether the frame before was good and whether the outline or irregularities
            have been found to tell slips apart.
        net: of `Mesh`.
        extent: slips, triangles, bounds.
        noise_px: standard deviation of a centre.

    Returns:
        verdict (1: ok, 0: nothing found, -1: the numbers may have slipped), markers found, dots explained,
        whether slips can be told, roughness.
    """
    slip, triangle, bounds = extent
    rest, kind, spacing, _, _, _, _, _, _, opposite = net
    _, used, excess, parent, size, _, queue, later, is_waiting, tried, _ = scratch
    level, is_anchored = past[4], past[6]
    nodes, markers = len(rest), len(guess)
    lists = (queue, later, is_waiting, tried)
    good, is_calm = _seeded(dot, bins, cell_px, guess, past, net, owner, moved, scratch)
    if good == 0:
        return 0, 0, 0, is_anchored, level
    _displace(dot, rest, owner, nodes, moved, used)
    _grown(dot, bins, cell_px, markers, is_calm, past, net, bounds, noise_px, owner, moved, scratch)
    fresh = rough(moved, owner, markers, spacing, opposite)
    verdict = 1
    if len(slip) > 1 and _is_doubtful(
        dot, bins, cell_px, is_calm, fresh, past, net, owner, moved, used, lists
    ):
        is_told, is_sure = _unslipped(
            dot, bins, cell_px, is_calm, past, net, extent, noise_px, owner, moved, scratch
        )
        is_anchored = is_anchored or is_told
        verdict = 1 if is_sure else -1
        fresh = rough(moved, owner, markers, spacing, opposite)
    if not is_calm:
        unfold(dot, net, triangle, owner, excess, used)
        keep_largest(nodes, net, moved, owner, _TEAR, parent, size)
    explained = found = 0
    for k in range(nodes):
        if owner[k] >= 0:
            explained += 1
            found += k < markers and kind[k] == 0
    return verdict, found, explained, is_anchored, fresh
