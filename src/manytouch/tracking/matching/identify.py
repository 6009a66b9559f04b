"""The kernel that tells which dot is which node in one frame: match, grow, verify, and ask for slips."""

# mypy: disable-error-code="no-untyped-def"
# no_type_check keeps checkers of annotations, which numba cannot compile, out of the kernels
# ruff: noqa: PLR0917 - compiled functions hold whole loops and take positional arguments
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.tracking.matching.dot_appearance import GLANCES, SIGNS, looks, stride, unlike
from manytouch.tracking.matching.grow import fill, grow, keep_largest
from manytouch.tracking.matching.shift_ambiguity import jumped, vote
from manytouch.tracking.matching.spatial_hash import bin_dots, match, nearest_two
from manytouch.tracking.matching.verify import doubtful, part, unfold, verify

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
_ROUGHER, _ROUGHER_PITCHES = 1.3, 0.001
_ROUGH_BIN_PITCHES, _ROUGH_BINS = 0.0005, 300
_UNLIKE, _UNLIKE_LEAST = 1.25, 0.004
_VOTES = 3
_FEW = 2
_TURNS = 5
_LONG_GAP = 2  # frames without a marker after which the view may have moved by a pitch
UNKNOWN, ASSUMED, FOLLOWED, TOLD = -1, 1, 2, 3


@njit(cache=True, nogil=True, error_model="numpy")
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
        most, worst = (_ALIKE * spacing[k]) ** 2, 0.0
        known = same = 0
        for j in range(start[k], adjacent_end[k]):
            n = near[j]
            if n < markers and owner[n] >= 0:
                known += 1
                x, y = shift[n, 0] - shift[k, 0], shift[n, 1] - shift[k, 1]
                worst = max(worst, x * x + y * y)
        # counting those that agree takes longer, and is seldom needed
        if worst >= most:
            for j in range(start[k], adjacent_end[k]):
                n = near[j]
                if n < markers and owner[n] >= 0:
                    same += (shift[n, 0] - shift[k, 0]) ** 2 + (shift[n, 1] - shift[k, 1]) ** 2 < most
        is_odd[k] = known == 0 or (worst >= most and 2 * same < known)
        odd += is_odd[k]
        good += not is_odd[k]
    return good, odd


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _displace(dot, rest, owner, nodes, moved, used):
    """Fills the displacements of owned nodes, and which dots are used."""
    used[: len(dot)] = False
    for k in range(nodes):
        i = owner[k]
        if i >= 0:
            moved[k, 0], moved[k, 1] = dot[i, 0] - rest[k, 0], dot[i, 1] - rest[k, 1]
            used[i] = True


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _newly(owner, unseen, kind):
    """Markers that show no dot but did in the last frame."""
    number = 0
    for k in range(len(unseen)):
        number += owner[k] < 0 and unseen[k] == 0 and kind[k] == 0
    return number


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def rough(moved, owner, markers, spacing, opposite):
    """Median second difference of displacements along the lattice, in spacings; NaN: there is none."""
    count = np.zeros(_ROUGH_BINS + 1, np.int64)
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
            off = np.sqrt(x * x + y * y) / (_ROUGH_BIN_PITCHES * spacing[k])
            count[min(_ROUGH_BINS, int(off))] += 1
            number += 1
    below = 0
    for b in range(_ROUGH_BINS + 1):
        below += count[b]
        if number and 2 * below >= number:
            return (b + 0.5) * _ROUGH_BIN_PITCHES
    return np.nan


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _seeded(dot, bins, cell_px, guess, past, net, owner, moved, scratch):
    """Matches dots to a guess and keeps what can be believed: how many are they, and is the frame calm?"""
    last, unseen, _, before, _, is_next = past[:6]
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
        good = keep_largest(len(guess), net, moved, owner, _ALIKE, moved[: len(guess)], parent, size)
    return good, is_calm


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _grown(dot, bins, cell_px, markers, is_calm, past, net, bounds, noise_px, owner, moved, scratch):
    """Grows and verifies; where a part was mistaken, takes its rim away and grows again from what is left.

    Returns whether `moved` holds what `fill` gives nodes without a dot.
    """
    _, used, excess, parent, size, flag, queue, later, is_waiting, tried, _ = scratch
    lists = (queue, later, is_waiting, tried)
    nodes = len(owner)
    reach = markers if is_calm else nodes
    for turn in range(_TURNS):
        grow(dot, bins, cell_px, reach, net, moved, owner, used, lists)
        dropped = verify(reach, net, past, moved, owner, 3.0 * noise_px, is_calm, used, excess, flag, queue)
        if is_calm:
            return False
        fill(nodes, net, moved, owner, lists)
        if doubtful(dot, bins, cell_px, markers, net, moved, owner, bounds, used, later, flag):
            # Each time more is taken away on both sides of the rim, until the mistake is parted or gone.
            for _ in range(turn + 1):
                part(markers, net, owner, flag, later)
            keep_largest(nodes, net, moved, owner, _TEAR, moved[:0], parent, size)
            _displace(dot, net[0], owner, nodes, moved, used)
        elif dropped == 0 or turn > 0:
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _is_doubtful(dot, bins, cell_px, is_calm, fresh, level, past, net, owner, moved, used, lists):
    """Could the numbers have slipped since the last frame?

    `level` (2,) is how unlike the known looks the dots are.
    """
    _, unseen, presence, _, usual, _, is_open, _, usual_look = past
    rest, kind, spacing, _, _, _, _, _, _, _ = net
    markers = len(unseen)
    if not is_calm or is_open or fresh > _ROUGHER * usual + _ROUGHER_PITCHES:
        return True
    for sign in range(SIGNS):
        if level[sign] > _UNLIKE * usual_look[sign] + _UNLIKE_LEAST:
            return True
    if len(rest) == markers or _newly(owner, unseen, kind) <= _FEW:
        return False
    fill(len(rest), net, moved, owner, lists)
    return _on_ghosts(dot, bins, cell_px, rest, moved, spacing, kind, presence, used) > _FEW


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _unslipped(dot, bins, cell_px, appearance, signs, past, net, extent, noise_px, owner, moved, scratch):
    """Gives the nodes the dots of the likeliest slip.

    `signs`: is the frame calm, has it `jumped`, and what `_grown` returned.

    Returns how well it is known: `TOLD` by the image, `FOLLOWED` as the motion excludes all others,
    `ASSUMED` as the sheet is near its rest, or `UNKNOWN`.
    """
    is_calm, has_jumped, is_filled = signs
    last, unseen, presence, _, _, is_next, _, look, usual = past
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
        if not is_filled:
            fill(nodes, net, moved, owner, lists)
        for k in range(nodes):
            place[k, 0], place[k, 1] = rest[k, 0] + moved[k, 0], rest[k, 1] + moved[k, 1]
        best, margin, by_roughness, motion = vote(
            owner, appearance, place, net, slip, presence, look, usual, last, bounds, noise_px, is_next
        )
        if best == 0:
            break
        queue[:] = owner
        owner[:] = -1
        for k in range(nodes):
            if queue[k] >= 0 and slip[best, k] >= 0:
                owner[slip[best, k]] = queue[k]
        _displace(dot, rest, owner, nodes, moved, used)
        is_filled = _grown(
            dot, bins, cell_px, len(last), False, past, net, bounds, noise_px, owner, moved, scratch
        )
    if margin >= _LEAST_MARGIN:
        return TOLD
    if by_roughness < -_LEAST_MARGIN or has_jumped:
        return UNKNOWN
    if unseen.min() <= _LONG_GAP and motion < _NEAR_PITCHES:
        return FOLLOWED
    is_near_rest = _median_motion(dot, owner, rest[: len(last)], spacing) < _REST_PITCHES
    return ASSUMED if is_near_rest else UNKNOWN


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _noise_px(covariance):
    """Usual standard deviation of a centre; 0 where it is not known."""
    total = 0.0
    for i in range(len(covariance)):
        total += covariance[i, 0, 0]
    mean = total / len(covariance)
    return np.sqrt(mean) if 0.0 < mean < np.inf else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def identify(dots, cell_px, guess, past, net, extent, owner, moved, scratch, level):
    """Fills `owner` (N,) and `moved` (N, 2) from a guess of the markers' places.

    Args:
        dots: (n, 2) centres, (n, 2, 2) covariances, (n,) areas, (n,) contrasts.
        cell_px: of `bin_dots`.
        guess: (m, 2) places to begin from, right for some part of the pattern up to a slip.
        past: places (m, 2) in the last good frame, frames unseen (m,), presence (N,), number seen then,
            roughness then, whether the frame before was good, whether a slip before it was left open, looks
            (m, 2), how unlike them the dots usually are (2,).
        net: of `LatticeGraph`.
        extent: slips, triangles, bounds.
        level: (2,) written: how unlike the known looks the dots are.

    Returns:
        verdict (3: the image tells the numbers, 2: they are followed, 1: assumed as the sheet is near its
        rest, 0: nothing found, -1: they may have slipped), markers found, dots explained, roughness.
    """
    slip, triangle, bounds = extent
    rest, kind, spacing, _, _, _, _, _, _, opposite = net
    _, used, excess, parent, size, _, queue, later, is_waiting, tried, place = scratch
    last, unseen, is_next, look = past[0], past[1], past[5], past[7]
    nodes, markers = len(rest), len(guess)
    lists = (queue, later, is_waiting, tried)
    dot, covariance, areas, contrasts = dots
    appearance, noise_px, bins = (areas, contrasts), _noise_px(covariance), bin_dots(dot, cell_px)
    good, is_calm = _seeded(dot, bins, cell_px, guess, past, net, owner, moved, scratch)
    if good == 0:
        return 0, 0, 0, past[4]
    _displace(dot, rest, owner, nodes, moved, used)
    is_filled = _grown(
        dot, bins, cell_px, markers, is_calm, past, net, bounds, noise_px, owner, moved, scratch
    )
    fresh = rough(moved, owner, markers, spacing, opposite)
    looks(markers, stride(markers, GLANCES), owner, appearance, net, place)
    unlike(place, look, level)
    verdict = FOLLOWED if is_next else ASSUMED
    has_jumped = is_calm and jumped(dot, owner, slip, last, unseen, noise_px)
    if has_jumped or (
        len(slip) > 1
        and _is_doubtful(dot, bins, cell_px, is_calm, fresh, level, past, net, owner, moved, used, lists)
    ):
        signs = (is_calm, has_jumped, is_filled)
        verdict = _unslipped(
            dot, bins, cell_px, appearance, signs, past, net, extent, noise_px, owner, moved, scratch
        )
        fresh = rough(moved, owner, markers, spacing, opposite)
        looks(markers, stride(markers, GLANCES), owner, appearance, net, place)
        unlike(place, look, level)
    if not is_calm:
        unfold(dot, net, triangle, owner, excess, used)
        known = markers if is_next else 0
        for k in range(known):
            place[k, 0], place[k, 1] = (
                rest[k, 0] + moved[k, 0] - last[k, 0],
                rest[k, 1] + moved[k, 1] - last[k, 1],
            )
        keep_largest(nodes, net, moved, owner, _TEAR, place[:known], parent, size)
    explained = found = 0
    for k in range(nodes):
        if owner[k] >= 0:
            explained += 1
            found += k < markers and kind[k] == 0
    return verdict, found, explained, fresh
