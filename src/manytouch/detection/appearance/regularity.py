"""Similar and regularly spaced blobs, without assuming a lattice.

In any pattern that is locally regular - square, oblique, hexagonal, in perspective, on rings - most dots have
pairs of opposite neighbours: j, i, k with p_k = 2 p_i - p_j. In a random arrangement such triples are rare.
"""

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from manytouch.detection.appearance.blob_outline import Outlines
from manytouch.values.arrays import Mask, Points2, Scalars

NEIGHBOURS = 6
REGULAR_TRIPLES = 4  # directed; the corner of a lattice is part of four or more
TOLERANCE = 0.16  # of the distance, at rest
LOOSE = 0.3  # of the distance, pressed


def count_triples(place_px: Points2, radius_px: Scalars, tolerance: float) -> Int64[np.ndarray, " n"]:
    """(n,) number of directed triples j - i - k of neighbours that each dot is part of.

    In strong perspective distances grow as the dots do, so p_k = p_i + s (p_i - p_j) with s = r_i / r_j
    counts as well as s = 1.
    """
    count = len(place_px)
    part = np.zeros(count, dtype=np.int64)
    if count < 3:
        return part
    tree = cKDTree(place_px)
    k = min(NEIGHBOURS, count - 1)
    distance, neighbour = tree.query(place_px, k=k + 1)
    distance, neighbour = distance[:, 1:], neighbour[:, 1:]
    step = place_px[:, None, :] - place_px[neighbour]
    stretch = np.clip(radius_px[:, None] / radius_px[neighbour], 0.7, 1.4)
    miss, opposite = tree.query(place_px[:, None, :] + step)
    stretched_miss, stretched_opposite = tree.query(place_px[:, None, :] + stretch[..., None] * step)
    is_better = stretched_miss < miss
    miss, opposite = np.minimum(miss, stretched_miss), np.where(is_better, stretched_opposite, opposite)
    middle, which = np.nonzero(miss <= tolerance * distance)
    first, last = neighbour[middle, which], opposite[middle, which]
    proper = (last != first) & (last != middle) & (first != middle)
    for role in (middle, first, last):
        np.add.at(part, role[proper], 1)
    return part


def regular_share(place_px: Points2, radius_px: Scalars) -> float:
    """Share of the points that are part of a locally regular pattern."""
    if len(place_px) == 0:
        return 0.0
    return float((count_triples(place_px, radius_px, TOLERANCE) >= REGULAR_TRIPLES).mean())


def nearest_distance(place_px: Points2) -> Float64[np.ndarray, " n"]:
    """(n,) distance to the nearest other point."""
    if len(place_px) < 2:
        return np.full(len(place_px), np.inf)
    return np.asarray(cKDTree(place_px).query(place_px, k=2)[0][:, 1])


def log_deviation(values: Float64[np.ndarray, " n"]) -> float:
    """Robust deviation of the logarithms: 0.1 means about 10 %."""
    logarithm = np.log(values)
    return float(1.4826 * np.median(np.abs(logarithm - np.median(logarithm))))


def grow(blobs: Outlines, members: Mask, eligible: Mask) -> Mask:
    """Adds all eligible blobs that resemble a member near them, repeatedly.

    Sizes and contrasts may drift over the picture as long as neighbours resemble each other.
    """
    members = members.copy()
    for _ in range(40):
        inside = np.flatnonzero(members)
        outside = np.flatnonzero(eligible & ~members)
        if len(outside) == 0 or len(inside) < 2:
            break
        tree = cKDTree(blobs.place_px[inside])
        step = nearest_distance(blobs.place_px[inside])
        distance, nearest = tree.query(blobs.place_px[outside], k=min(4, len(inside)))
        near = inside[nearest]
        size = blobs.radius_px[outside][:, None] / blobs.radius_px[near]
        contrast = blobs.contrast[outside][:, None] / blobs.contrast[near]
        alike = (size > 0.66) & (size < 1.5) & (contrast > 0.4) & (contrast < 2.5)
        alike &= distance < 2.6 * np.minimum(step[nearest], 12.0 * blobs.radius_px[near])
        alike &= distance > 0.55 * step[nearest]
        new = outside[alike.any(axis=1)]
        if len(new) == 0:
            break
        members[new] = True
        members &= keep_single(blobs, members)
    return members


def keep_single(blobs: Outlines, members: Mask) -> Mask:
    """Members without those that overlap a heavier member, as a mask."""
    chosen = np.flatnonzero(members)
    keep = members.copy()
    whole = blobs.fill[chosen] * (1.0 - blobs.openness[chosen])
    weight = (blobs.contrast[chosen] * blobs.radius_px[chosen] * whole**2) ** 2
    tree = cKDTree(blobs.place_px[chosen])
    pairs = tree.query_pairs(
        float(blobs.radius_px[chosen].max()) if len(chosen) else 0.0, output_type="ndarray"
    )
    if len(pairs) == 0:
        return keep
    a, b = pairs[:, 0], pairs[:, 1]
    distance = np.linalg.norm(blobs.place_px[chosen[a]] - blobs.place_px[chosen[b]], axis=1)
    overlap = distance < np.maximum(blobs.radius_px[chosen[a]], blobs.radius_px[chosen[b]])
    a, b = a[overlap], b[overlap]
    loser = np.where((weight[a] < weight[b]) | ((weight[a] == weight[b]) & (a > b)), a, b)
    winner = a + b - loser
    # heaviest first, so that a loser does not take others with it
    for place in np.argsort(-weight[winner], kind="stable"):
        if keep[chosen[winner[place]]]:
            keep[chosen[loser[place]]] = False
    return keep


def count_votes(
    place_px: Points2,
    radius_px: Scalars,
    dots_px: Float64[np.ndarray, "d 2"],
    dots_radius_px: Float64[np.ndarray, " d"],
    tolerance: float,
) -> Int64[np.ndarray, " n"]:
    """(n,) number of dots that predict each position: opposite to a neighbour, as far or scaled by size."""
    k = min(NEIGHBOURS, len(dots_px) - 1)
    tree = cKDTree(dots_px)
    distance, neighbour = tree.query(dots_px, k=k + 1)
    distance, neighbour = distance[:, 1:], neighbour[:, 1:]
    _, near = tree.query(place_px, k=min(NEIGHBOURS, len(dots_px)))
    # (n, near dot i, its neighbour j)
    step = dots_px[near][:, :, None, :] - dots_px[neighbour[near]]
    offset = place_px[:, None, None, :] - dots_px[near][:, :, None, :]
    stretch = np.clip(radius_px[:, None] / dots_radius_px[near], 0.7, 1.4)[:, :, None]
    length = distance[near]
    plain = np.linalg.norm(offset - step, axis=3) < tolerance * length
    stretched = np.linalg.norm(offset - stretch[..., None] * step, axis=3) < tolerance * length * stretch
    return np.asarray((plain | stretched).any(axis=2).sum(axis=1))


def admit(blobs: Outlines, members: Mask, alike: Mask, odd: Mask) -> Mask:
    """Adds blobs at positions where the pattern of the members continues.

    Args:
        blobs: all of them.
        members: the pattern so far.
        alike: (n,) well-shaped blobs: one prediction is enough when they resemble the members near them.
        odd: (n,) blobs of any shape, weak or small (not both): two close predictions are needed.
    """
    members, core = members.copy(), members.copy()  # the pattern continues from its core only
    for _ in range(20):
        core &= members
        inside = np.flatnonzero(core)
        outside = np.flatnonzero((alike | odd) & ~members)
        if len(outside) == 0 or len(inside) < 4:
            break
        place_px, radius_px = blobs.place_px[outside], blobs.radius_px[outside]
        step, nearest = cKDTree(blobs.place_px[inside]).query(place_px, k=min(NEIGHBOURS, len(inside)))
        near = inside[nearest]
        size = radius_px / np.median(blobs.radius_px[near], axis=1)
        contrast = blobs.contrast[outside] / np.median(blobs.contrast[near], axis=1)
        fits = odd[outside] & (size > 0.28) & (size < 1.6) & (contrast > np.where(size > 0.6, 0.14, 0.3))
        good = alike[outside] & (size > 0.6) & (size < 1.6) & (contrast > 0.4) & (contrast < 2.5)
        free = step[:, 0] > 0.45 * nearest_distance(blobs.place_px[inside])[nearest[:, 0]]
        inner = blobs.place_px[inside], blobs.radius_px[inside]
        close_votes = count_votes(place_px, radius_px, *inner, 0.2)
        loose_votes = count_votes(place_px, radius_px, *inner, 0.3)
        good |= (
            fits
            & (size > 0.75)
            & (size < 1.33)
            & (blobs.roughness[outside] < 0.08)
            & (blobs.aspect[outside] < 1.5)
        )
        good &= free & (loose_votes >= 1)
        new = outside[good | (free & fits & (close_votes >= 2))]
        if len(new) == 0:
            break
        members[new] = True
        core[outside[good]] = True
        members &= keep_single(blobs, members)
    return members
