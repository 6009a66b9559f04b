"""The channel, of grey, single colours and combinations of them, that shows the dots of an image best."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from manytouch.detection.appearance.blob_outline import Outlines, trace_outlines
from manytouch.detection.appearance.channel_weights import fit_weights, trial_weights
from manytouch.detection.appearance.pattern import Pattern, find_pattern
from manytouch.detection.appearance.regularity import keep_single
from manytouch.detection.appearance.scale_space import find_blobs
from manytouch.detection.dot_appearance import GREY_OF_BGR, Appearance
from manytouch.detection.noise import estimate_noise
from manytouch.values import Polarity
from manytouch.values.arrays import Mask

SMALL_PX = 640  # size at which channels are tried


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundLimits:
    """Limits of the outline of a round spot; see `Outlines`.

    Attributes:
        openness, aspect, roughness: largest ones.
        fill, visible: smallest ones.
        least_noises: smallest contrast over the noise of a pixel.
    """

    openness: float = 0.13
    aspect: float = 2.5
    roughness: float = 0.13
    fill: float = 0.7
    visible: float = 0.6
    least_noises: float = 10.0


ROUND = RoundLimits()
ROUGHLY_ROUND = RoundLimits(openness=0.3, aspect=3.5, roughness=0.35, fill=0.5, least_noises=5.0)


def best_pattern(image: np.ndarray, scale: float, known: Appearance | None = None) -> Pattern | None:
    """The dots of an image in the channel that shows them best; None if there are none.

    Args:
        image: (h, w) or (h, w, c).
        scale: `level_scale` of the image.
        known: of the dots, from another image of them: only its channel and polarity are tried.
    """
    if known is not None:
        weights = GREY_OF_BGR if known.colour_weights is None else known.colour_weights
        weights = weights if image.ndim == 3 else np.ones(1)
        return find_channel_pattern(image, weights * scale, (known.polarity,))
    if image.ndim == 2:
        return find_channel_pattern(image, np.array([scale]))
    grey = GREY_OF_BGR * scale
    best = find_channel_pattern(image, grey)
    if not has_colour(image):
        return best
    if best is None or not best.is_clear:
        best = _try_channels(image, scale, best)
    for _ in range(2):
        if best is None:
            break
        sure = np.flatnonzero(best.alike)
        weights = fit_weights(image, best.dots.place_px[sure], best.dots.radius_px[sure])
        sign = 1.0 if best.polarity == "light" else -1.0
        found = find_channel_pattern(image, sign * weights * scale, ("light",))
        if found is None or not _is_clearly_better(found, best):
            break
        best = found
    return best


def _try_channels(image: np.ndarray, scale: float, grey: Pattern | None) -> Pattern | None:
    """The pattern of the channel that shows dots best, if that is much better than grey."""
    factor = max(1, round(max(image.shape[:2]) / SMALL_PX))
    height, width = image.shape[0] // factor, image.shape[1] // factor
    small = cv2.resize(
        image[: height * factor, : width * factor], (width, height), interpolation=cv2.INTER_AREA
    )
    tried = [(find_channel_pattern(small, weights * scale), weights) for weights in trial_weights()]
    usable = [(found.score, place) for place, (found, _) in enumerate(tried) if found is not None]
    if not usable:
        return grey
    best = find_channel_pattern(image, tried[max(usable)[1]][1] * scale)
    if best is None or (grey is not None and best.score < 1.3 * grey.score):
        return grey
    return best


def has_colour(image: np.ndarray) -> bool:
    """Whether the channels of a colour image differ."""
    few = image[::7, ::7].astype(np.float32)
    return bool(np.mean(few.max(axis=2) - few.min(axis=2)) > 0.01 * max(float(few.max()), 1.0))


def _is_clearly_better(new: Pattern, old: Pattern) -> bool:
    """Whether a fitted combination shows more dots, or those of an unclear channel more clearly."""
    more = len(new.dots.place_px) > 1.04 * len(old.dots.place_px) or not old.is_clear
    return more and new.score > 1.1 * old.score


def find_channel_pattern(
    image: np.ndarray, weights: Float64[np.ndarray, " c"], polarities: Sequence[Polarity] = ("light", "dark")
) -> Pattern | None:
    """The best pattern of these polarities in one channel."""
    channel = _channel(image, weights)
    noise = estimate_noise(image, weights)
    blobs, pyramid = find_blobs(channel, noise=noise)
    best: Pattern | None = None
    for polarity in polarities:
        sign = 1.0 if polarity == "light" else -1.0
        of_sign = blobs.contrast * sign > 0
        traced = trace_outlines(pyramid, blobs.place_px[of_sign], blobs.radius_px[of_sign], sign)
        traced = traced.at(np.flatnonzero(np.isfinite(traced.radius_px) & (traced.contrast > 1.5)))
        found = find_pattern(traced, polarity, weights)
        if found is not None and (best is None or found.seed_score > best.seed_score):
            best = found
    return best


def find_spots(image: np.ndarray, scale: float, polarity: Polarity) -> tuple[Outlines, Mask]:
    """Roughly round spots of any size in grey, whatever their arrangement, and which (n,) are well outlined.

    Of spots that overlap only one is kept, well outlined ones first.

    Args:
        image: (h, w) or (h, w, c).
        scale: `level_scale` of the image.
        polarity: of the spots.
    """
    weights = np.array([scale]) if image.ndim == 2 else GREY_OF_BGR * scale
    noise, sign = estimate_noise(image, weights), 1.0 if polarity == "light" else -1.0
    blobs, pyramid = find_blobs(_channel(image, weights), noise=noise)
    of_sign = blobs.contrast * sign > 0
    spots = trace_outlines(pyramid, blobs.place_px[of_sign], blobs.radius_px[of_sign], sign)
    is_round = _within(spots, ROUND, noise)
    single = keep_single(spots, is_round)
    rough = _within(spots, ROUGHLY_ROUND, noise) & ~is_round
    if single.any() and rough.any():
        distance, nearest = cKDTree(spots.place_px[single]).query(spots.place_px[rough])
        reach = np.maximum(spots.radius_px[single][nearest], spots.radius_px[rough])
        rough[np.flatnonzero(rough)[distance < reach]] = False
    chosen = np.flatnonzero(single | keep_single(spots, rough))
    return spots.at(chosen), single[chosen]


def _within(spots: Outlines, limits: RoundLimits, noise: float) -> Mask:
    """(n,) outlines within limits."""
    inside = np.isfinite(spots.radius_px) & (spots.contrast > max(limits.least_noises * noise, 1.5))
    inside &= (spots.openness <= limits.openness) & (spots.aspect < limits.aspect)
    inside &= (spots.roughness < limits.roughness) & (spots.fill > limits.fill)
    return np.asarray(inside & (spots.visible > limits.visible))


def _channel(image: np.ndarray, weights: Float64[np.ndarray, " c"]) -> np.ndarray:
    if image.ndim == 2:
        return image.astype(np.float32) * np.float32(weights[0])
    return np.asarray(cv2.transform(image.astype(np.float32), weights[None].astype(np.float32)))
