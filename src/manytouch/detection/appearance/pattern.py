"""Dots among the blobs of one channel: the set of similar blobs that is most regularly spaced.

From this seed the pattern grows over neighbours that resemble each other, and takes in weak and damaged dots
where it continues.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from manytouch.detection.appearance.blob_outline import Outlines
from manytouch.detection.appearance.regularity import (
    LOOSE,
    admit,
    count_triples,
    count_votes,
    grow,
    keep_single,
    log_deviation,
    nearest_distance,
    regular_share,
)
from manytouch.values import Polarity
from manytouch.values.arrays import Mask

FEWEST = 6  # dots
BANDS = np.geomspace(1.2, 160.0, 17)  # lower ends of the radii that are taken as similar
BAND_WIDTH = 1.8
MOST_SEEDS = 6000
TIGHT = 0.15  # tolerance of opposite neighbours while the pattern is being chosen
REGULAR = 0.7  # share of a seed in a locally regular pattern, from which on only this pattern may continue


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pattern:
    """Dots of one channel and one polarity.

    Attributes:
        polarity: lighter or darker than the background.
        weights: (c,) of the image's channels, unsigned.
        dots: their outlines.
        alike: (n,) those that resemble their neighbours (the others are weak or damaged).
        seed_score: score of the set of blobs that it grew from.
        regular: share of the dots in a locally regular pattern.
        clarity: share of the dots among all blobs of their size and at least half their contrast.
    """

    polarity: Polarity
    weights: Float64[np.ndarray, " c"]
    dots: Outlines
    alike: Mask
    seed_score: float
    regular: float
    clarity: float

    @property
    def score(self) -> float:
        """Visibility of the dots in this channel, for comparison with other channels."""
        dots = self.dots
        uniformity = 1.0 / (1.0 + log_deviation(dots.contrast) + log_deviation(dots.radius_px))
        return float(self.regular**2 * uniformity * np.sqrt(len(dots.radius_px)) * self.clarity**3)

    @property
    def is_clear(self) -> bool:
        """Whether no other channels need to be tried."""
        return self.regular > 0.8 and self.clarity > 0.8


def find_pattern(blobs: Outlines, polarity: Polarity, weights: Float64[np.ndarray, " c"]) -> Pattern | None:
    """Finds the dots among the blobs of one sign; None if there are none."""
    if len(blobs.radius_px) < FEWEST:
        return None
    round_ones = (
        (blobs.openness <= 0.13)
        & (blobs.aspect < 2.2)
        & (blobs.roughness < 0.25)
        & (blobs.visible > 0.6)
        & (blobs.fill > 0.7)
    )
    seed, score = _best_seed(blobs, round_ones)
    if seed is None:
        return None
    tolerated = (
        (blobs.openness <= 0.17) & (blobs.aspect < 2.8) & (blobs.roughness < 0.35) & (blobs.visible > 0.4)
    )
    is_whole = blobs.visible > 0.95
    odd = (blobs.openness <= np.where(is_whole, 0.17, 0.09)) & (blobs.aspect < 5.0) & (blobs.visible > 0.4)
    tolerated &= is_whole | (blobs.openness <= 0.09)
    chosen = np.flatnonzero(seed)
    if regular_share(blobs.place_px[chosen], blobs.radius_px[chosen]) < REGULAR:
        seed = grow(blobs, seed, tolerated)
    odd &= blobs.contrast > _floor(blobs, seed)
    members = admit(blobs, seed, tolerated, odd)
    alike = members & tolerated & (blobs.roughness < 0.25)
    members = _drop_strays(blobs, members)
    if members.sum() < FEWEST:
        return None
    chosen = np.flatnonzero(members)
    dots = blobs.at(chosen)
    regular = regular_share(dots.place_px, dots.radius_px)
    if regular < 0.5 and not _is_uniform(blobs, chosen):
        return None
    return Pattern(
        polarity=polarity,
        weights=weights,
        dots=dots,
        alike=alike[chosen],
        seed_score=score,
        clarity=_clarity(blobs, members),
        regular=regular,
    )


def _rivals(blobs: Outlines, members: Mask, smallest: float) -> Mask:
    """Closed blobs of the members' size, or down to `smallest` of it, that do not overlap a member."""
    low, high = np.quantile(blobs.radius_px[members], (0.1, 0.9))
    rivals = ~members & (blobs.radius_px > smallest * low) & (blobs.radius_px < 1.6 * high)
    rivals &= (blobs.openness < 0.3) & (blobs.visible > 0.9)
    distance, nearest = cKDTree(blobs.place_px[members]).query(blobs.place_px)
    rivals = rivals & (distance > blobs.radius_px[members][nearest] + 0.5 * blobs.radius_px)
    return np.asarray(rivals)


def _clarity(blobs: Outlines, members: Mask) -> float:
    """Members against all blobs of their size and of at least half their contrast, 0 to 1."""
    strong = _rivals(blobs, members, 0.6) & (blobs.contrast > 0.5 * np.median(blobs.contrast[members]))
    return float(members.sum() / (members.sum() + strong.sum()))


def _floor(blobs: Outlines, members: Mask) -> float:
    """Contrast that texture of the size of dots does not reach; weak but round dots are not texture."""
    rivals = np.flatnonzero(_rivals(blobs, members, 0.3) & (blobs.roughness > 0.12))
    inner = blobs.place_px[members], blobs.radius_px[members]
    rivals = rivals[count_votes(blobs.place_px[rivals], blobs.radius_px[rivals], *inner, LOOSE) == 0]
    return 2.5 * float(np.median(blobs.contrast[rivals])) if len(rivals) else 0.0


def _best_seed(blobs: Outlines, eligible: Mask) -> tuple[Mask | None, float]:
    """The set of similar blobs with the highest score, and the score."""
    best, best_score = None, 0.0
    for low in BANDS:
        band = eligible & (blobs.radius_px >= low) & (blobs.radius_px < BAND_WIDTH * low)
        if band.sum() < FEWEST:
            continue
        band = keep_single(blobs, band)
        contrasts = np.sort(blobs.contrast[band])[::-1]
        tops = {float(contrasts[int(q * (len(contrasts) - 1))]) for q in (0.02, 0.1, 0.3, 0.6)}
        tops.add(float(contrasts[min(FEWEST, len(contrasts) - 1)]))
        for top in tops:
            alike = band & (blobs.contrast > 0.45 * top) & (blobs.contrast < 2.2 * top)
            count = int(alike.sum())
            if count < FEWEST or count > MOST_SEEDS:
                continue
            score = _score(blobs, np.flatnonzero(alike))
            if score > best_score:
                best, best_score = alike, score
    return best, best_score


def _score(blobs: Outlines, chosen: np.ndarray) -> float:
    """Score of a set of similar blobs; 0 if it may be chance."""
    place_px, radius_px = blobs.place_px[chosen], blobs.radius_px[chosen]
    count = count_triples(place_px, radius_px, TIGHT)
    regular = count >= 4
    share = float(regular.mean())
    if share < 0.45 or regular.sum() < FEWEST:
        if not _is_uniform(blobs, chosen):
            return 0.0
        share, regular = max(share, 0.35), np.ones(len(chosen), dtype=bool)
    weight = float(np.median(blobs.contrast[chosen] * radius_px))
    uniformity = 1.0 / (1.0 + log_deviation(blobs.contrast[chosen]) + log_deviation(radius_px))
    number = float(regular.sum())
    many = np.sqrt(number) * (1.0 - np.exp(-((number / 12.0) ** 2)))
    return float(share**2 * uniformity * many * weight)


def _is_uniform(blobs: Outlines, chosen: np.ndarray) -> bool:
    """Whether blobs are very similar: dots on curves (rings, spirals) have few opposite neighbours."""
    gaps = nearest_distance(blobs.place_px[chosen])
    return bool(
        len(chosen) >= 2 * FEWEST
        and log_deviation(blobs.contrast[chosen]) < 0.2
        and log_deviation(blobs.radius_px[chosen]) < 0.15
        and log_deviation(gaps) < 0.25
        and np.median(blobs.roughness[chosen]) < 0.08
    )


def _drop_strays(blobs: Outlines, members: Mask) -> Mask:
    """Members of a regular pattern, without those that are not part of any triple."""
    chosen = np.flatnonzero(members)
    part = count_triples(blobs.place_px[chosen], blobs.radius_px[chosen], LOOSE)
    if len(chosen) < 12 or (part >= 4).mean() < 0.75:
        return members
    keep = members.copy()
    keep[chosen[part == 0]] = False
    return keep
