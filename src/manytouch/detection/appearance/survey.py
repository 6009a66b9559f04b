"""How the dots of an unknown picture look, and where they are.

Blobs of every size and of both signs are found in grey, and traced by rays. Of all sets of blobs that
are alike in size and contrast, the one that is most regularly spaced and explains most of the picture
is the dots; it then grows over neighbours that resemble each other, and takes in weak and odd ones
where its pattern goes on. Colours are tried as well: the combination of channels that parts the dots
found so far best from their ground, or single channels when grey shows none.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from manytouch.detection.appearance.colour import fitted_weights, tried_weights
from manytouch.detection.appearance.dot_appearance import GREY_OF_BGR, Appearance
from manytouch.detection.appearance.outline import Outlines, outlines
from manytouch.detection.appearance.regularity import (
    LOOSE,
    admitted,
    grown,
    regular_share,
    single,
    spacing,
    spread,
    triples,
    votes,
)
from manytouch.detection.appearance.scale_space import blobs_and_pyramid
from manytouch.detection.measurement.centroid import Dots, measure
from manytouch.detection.noise import noise_of
from manytouch.detection.search import cropped, level_of
from manytouch.detection.selection import without_doubles
from manytouch.errors import LayoutError
from manytouch.values import Detections, Frame, Polarity, Roi
from manytouch.values.arrays import Mask

FEWEST = 6
BANDS = np.geomspace(1.2, 160.0, 17)  # lower ends of the radii that are taken as alike
BAND_WIDTH = 1.8
MOST_SEEDS = 6000
TIGHT = 0.15  # tolerance of opposite neighbours while the pattern is being chosen
SMALL_PX = 640  # size at which channels are tried
REGULAR = 0.7  # share of a seed in a locally regular pattern from which on only this pattern may go on


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Survey:
    """What a first look at a recording gives.

    Attributes:
        appearance: of the dots.
        detections: the dots of the reference frame.
        frame_index: index of the reference frame.
        notes: sentences about what was odd.
    """

    appearance: Appearance
    detections: Detections
    frame_index: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pattern:
    """Dots as one channel and one polarity show them.

    Attributes:
        polarity: lighter or darker than the ground.
        weights: (c,) of the image's channels, unsigned.
        dots: their outlines.
        alike: (n,) those that resemble their neighbours (the rest is weak or odd).
        seed_score: how convincing the set of blobs is that it grew from.
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
        """How well a channel shows the dots, for comparison with other channels."""
        dots = self.dots
        evenness = 1.0 / (1.0 + spread(dots.contrast) + spread(dots.radius_px))
        return float(self.regular**2 * evenness * np.sqrt(len(dots.radius_px)) * self.clarity**3)

    @property
    def is_clear(self) -> bool:
        """Need other channels not be tried?"""
        return self.regular > 0.8 and self.clarity > 0.8


def survey(frames: Sequence[Frame], *, roi_px: Roi | None = None) -> Survey:
    """Finds out how the dots look.

    Args:
        frames: the first frames of a recording; the first one with dots is the reference.
        roi_px: x, y, width, height of the part of the image to look at; None for all of it.

    Raises:
        LayoutError: there are no dots.
    """
    pictures = [frame for frame in frames if frame.image is not None]
    if not pictures:
        raise LayoutError("no frame could be decoded, so there is nothing to find dots in: check the source")
    tried = sorted({0, len(pictures) // 2, len(pictures) - 1})
    for place in tried:
        frame = pictures[place]
        assert frame.image is not None
        image, corner = cropped(frame.image, roi_px)
        level = level_of(frame.image)
        pattern = best_pattern(image, level) if min(image.shape[:2]) >= 16 else None
        if pattern is not None:
            return _surveyed(frame, image, corner, level, pattern)
    height, width = pictures[0].image.shape[:2] if pictures[0].image is not None else (0, 0)
    where = f"the {width} x {height} px image" if roi_px is None else f"the region {roi_px} of the image"
    raise LayoutError(
        f"no dots were found in {where}: expected at least {FEWEST} round spots of similar size, regularly "
        "spaced, lighter or darker than their ground; check focus, light and region"
    )


def best_pattern(image: np.ndarray, level: float) -> Pattern | None:
    """The dots of an image in the channel that shows them best; None where there are none."""
    if image.ndim == 2:
        return pattern_in(image, np.array([level]))
    grey = GREY_OF_BGR * level
    best = pattern_in(image, grey)
    if not has_colour(image):
        return best
    if best is None or not best.is_clear:
        best = _in_another_channel(image, level, best)
    for _ in range(2):
        if best is None:
            break
        sure = np.flatnonzero(best.alike)
        weights = fitted_weights(image, best.dots.place_px[sure], best.dots.radius_px[sure])
        sign = 1.0 if best.polarity == "light" else -1.0
        found = pattern_in(image, sign * weights * level)
        if found is None or not _is_clearly_better(found, best):
            break
        best = found
    return best


def _in_another_channel(image: np.ndarray, level: float, grey: Pattern | None) -> Pattern | None:
    """The pattern of the channel that shows dots best, if that is much better than grey."""
    factor = max(1, round(max(image.shape[:2]) / SMALL_PX))
    height, width = image.shape[0] // factor, image.shape[1] // factor
    small = cv2.resize(
        image[: height * factor, : width * factor], (width, height), interpolation=cv2.INTER_AREA
    )
    tried = [(pattern_in(small, weights * level), weights) for weights in tried_weights()]
    usable = [(found.score, place) for place, (found, _) in enumerate(tried) if found is not None]
    if not usable:
        return grey
    best = pattern_in(image, tried[max(usable)[1]][1] * level)
    if best is None or (grey is not None and best.score < 1.3 * grey.score):
        return grey
    return best


def has_colour(image: np.ndarray) -> bool:
    """Do the channels of a colour image differ?"""
    few = image[::7, ::7].astype(np.float32)
    return bool(np.mean(few.max(axis=2) - few.min(axis=2)) > 0.01 * max(float(few.max()), 1.0))


def _is_clearly_better(new: Pattern, old: Pattern) -> bool:
    """A fitted combination must show more dots, or those of a murky channel more clearly."""
    more = len(new.dots.place_px) > 1.04 * len(old.dots.place_px) or not old.is_clear
    return more and new.score > 1.1 * old.score


def pattern_in(image: np.ndarray, weights: Float64[np.ndarray, " c"]) -> Pattern | None:
    """The best pattern of both polarities in one channel."""
    channel = _channel(image, weights)
    noise = noise_of(image, weights)
    blobs, pyramid = blobs_and_pyramid(channel, noise=noise)
    best: Pattern | None = None
    for polarity, sign in (("light", 1.0), ("dark", -1.0)):
        of_sign = blobs.contrast * sign > 0
        traced = outlines(pyramid, blobs.place_px[of_sign], blobs.radius_px[of_sign], sign)
        traced = traced.at(np.flatnonzero(np.isfinite(traced.radius_px) & (traced.contrast > 1.5)))
        found = _pattern_of(traced, "light" if polarity == "light" else "dark", weights)
        if found is not None and (best is None or found.seed_score > best.seed_score):
            best = found
    return best


def _channel(image: np.ndarray, weights: Float64[np.ndarray, " c"]) -> np.ndarray:
    if image.ndim == 2:
        return image.astype(np.float32) * np.float32(weights[0])
    return np.asarray(cv2.transform(image.astype(np.float32), weights[None].astype(np.float32)))


def _pattern_of(blobs: Outlines, polarity: Polarity, weights: Float64[np.ndarray, " c"]) -> Pattern | None:
    """The dots among the blobs of one sign; None where there are none."""
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
        seed = grown(blobs, seed, tolerated)
    odd &= blobs.contrast > _floor(blobs, seed)
    members = admitted(blobs, seed, tolerated, odd)
    alike = members & tolerated & (blobs.roughness < 0.25)
    members = _without_strays(blobs, members)
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
    """Contrast that texture of the dots' size does not reach; weak but round dots are no texture."""
    rivals = np.flatnonzero(_rivals(blobs, members, 0.3) & (blobs.roughness > 0.12))
    inner = blobs.place_px[members], blobs.radius_px[members]
    rivals = rivals[votes(blobs.place_px[rivals], blobs.radius_px[rivals], *inner, LOOSE) == 0]
    return 2.5 * float(np.median(blobs.contrast[rivals])) if len(rivals) else 0.0


def _best_seed(blobs: Outlines, eligible: Mask) -> tuple[Mask | None, float]:
    """The most convincing set of blobs that are alike, and its score."""
    best, best_score = None, 0.0
    for low in BANDS:
        band = eligible & (blobs.radius_px >= low) & (blobs.radius_px < BAND_WIDTH * low)
        if band.sum() < FEWEST:
            continue
        band = single(blobs, band)
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
    """How convincing a set of alike blobs is; 0 when it could be chance."""
    place_px, radius_px = blobs.place_px[chosen], blobs.radius_px[chosen]
    count = triples(place_px, radius_px, TIGHT)
    regular = count >= 4
    share = float(regular.mean())
    if share < 0.45 or regular.sum() < FEWEST:
        if not _is_uniform(blobs, chosen):
            return 0.0
        share, regular = max(share, 0.35), np.ones(len(chosen), dtype=bool)
    weight = float(np.median(blobs.contrast[chosen] * radius_px))
    evenness = 1.0 / (1.0 + spread(blobs.contrast[chosen]) + spread(radius_px))
    number = float(regular.sum())
    many = np.sqrt(number) * (1.0 - np.exp(-((number / 12.0) ** 2)))
    return float(share**2 * evenness * many * weight)


def _is_uniform(blobs: Outlines, chosen: np.ndarray) -> bool:
    """Dots on curves (rings, spirals) have few opposite neighbours, but are very much alike."""
    gaps = spacing(blobs.place_px[chosen])
    return bool(
        len(chosen) >= 2 * FEWEST
        and spread(blobs.contrast[chosen]) < 0.2
        and spread(blobs.radius_px[chosen]) < 0.15
        and spread(gaps) < 0.25
        and np.median(blobs.roughness[chosen]) < 0.08
    )


def _without_strays(blobs: Outlines, members: Mask) -> Mask:
    """In a regular pattern, what takes no part in it is something else."""
    chosen = np.flatnonzero(members)
    part = triples(blobs.place_px[chosen], blobs.radius_px[chosen], LOOSE)
    if len(chosen) < 12 or (part >= 4).mean() < 0.75:
        return members
    keep = members.copy()
    keep[chosen[part == 0]] = False
    return keep


def _surveyed(
    frame: Frame, image: np.ndarray, corner: Float64[np.ndarray, "2"], level: float, pattern: Pattern
) -> Survey:
    """Sub-pixel centres and the summary of a pattern."""
    sign = 1.0 if pattern.polarity == "light" else -1.0
    noise = noise_of(image, pattern.weights)
    measured = measure(
        image, sign * pattern.weights, pattern.dots.place_px, pattern.dots.radius_px, noise=noise
    )
    moved = np.linalg.norm(measured.centre_px - pattern.dots.place_px, axis=1)
    with np.errstate(invalid="ignore"):
        keep = measured.is_found & (measured.cut < 0.6) & (moved < pattern.dots.radius_px + 1.0)
    keep &= _is_half_visible(image, measured, keep)
    kept = np.flatnonzero(keep)
    weight = measured.contrast[kept] * measured.area_px2[kept]
    radius_px = np.sqrt(measured.area_px2[kept] / np.pi)
    keep[kept[~without_doubles(measured.centre_px[kept], radius_px, weight, 0.9)]] = False
    detections = measured.at(keep, corner)
    typical = pattern.alike & keep
    radius_px = np.sqrt(measured.area_px2[typical if typical.any() else keep] / np.pi)
    colour = None
    if image.ndim == 3:
        ratio = pattern.weights / level
        colour = None if np.allclose(ratio, GREY_OF_BGR) else ratio
    appearance = Appearance(
        polarity=pattern.polarity,
        radius_min_px=float(np.quantile(radius_px, 0.05)),
        radius_max_px=float(np.quantile(radius_px, 0.95)),
        colour_weights=colour,
        contrast=float(np.median(measured.contrast[keep])),
    )
    return Survey(
        appearance=appearance,
        detections=detections,
        frame_index=frame.index,
        notes=_notes(pattern, keep),
    )


def _is_half_visible(image: np.ndarray, dots: Dots, keep: Mask) -> Mask:
    """(n,) does at least about half of the dot lie within the image, judged by the dots near it?"""
    centre_px = np.where(keep[:, None], dots.centre_px, 0.0)
    radius_px = np.sqrt(np.where(keep, dots.area_px2, 0.0) / np.pi)
    inside = np.flatnonzero(keep)
    if len(inside) < 4:
        return keep
    _, near = cKDTree(centre_px[inside]).query(centre_px, k=min(12, len(inside)))
    local_px = np.quantile(radius_px[inside][near], 0.75, axis=1)
    far_corner = np.array([image.shape[1], image.shape[0]]) - 1.0
    margin = np.minimum(centre_px, far_corner - centre_px).min(axis=1) + 0.5
    shows: Mask = (margin > 1.1 * local_px) | (radius_px**2 > 0.45 * local_px**2)
    return shows


def _notes(pattern: Pattern, keep: Mask) -> tuple[str, ...]:
    notes = []
    odd = int((keep & ~pattern.alike).sum())
    if odd:
        notes.append(f"{odd} of {int(keep.sum())} dots are weak, damaged or odd")
    if pattern.regular < 0.5:
        notes.append("the dots form no locally regular pattern")
    return tuple(notes)
