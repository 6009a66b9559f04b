"""Survey: the appearance and the positions of the dots of an unknown image.

Blobs of every size and of both signs are found in grey and traced by rays. Of all sets of blobs that are
similar in size and contrast, the one that is most regularly spaced and explains most of the image is the
dots. Colours are tried as well: the combination of channels that separates the dots found so far best from
their background, or single channels when grey shows none.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from manytouch.detection.appearance.channel import best_pattern
from manytouch.detection.appearance.pattern import FEWEST, Pattern
from manytouch.detection.dot_appearance import GREY_OF_BGR, Appearance
from manytouch.detection.images import crop
from manytouch.detection.measurement.centroid import MeasuredDots, measure
from manytouch.detection.noise import estimate_noise
from manytouch.detection.selection import find_single_dots
from manytouch.errors import LayoutError
from manytouch.values import Detections, Frame, Roi
from manytouch.values.arrays import Mask
from manytouch.values.images.grey_levels import level_scale


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Survey:
    """Result of a survey.

    Attributes:
        appearance: of the dots.
        detections: the dots of the reference frame.
        frame_index: index of the reference frame.
        regular: share of the dots in a locally regular pattern.
        notes: sentences about unusual properties.
    """

    appearance: Appearance
    detections: Detections
    frame_index: int
    regular: float
    notes: tuple[str, ...] = ()


def survey(frames: Sequence[Frame], *, roi_px: Roi | None = None, known: Appearance | None = None) -> Survey:
    """Determines the appearance of the dots of a recording.

    Args:
        frames: the first frames of a recording; the first one with dots is the reference.
        roi_px: x, y, width, height of the region of interest; None for the whole image.
        known: channel and polarity of the dots, from a survey of other frames; None: all are tried.

    Raises:
        LayoutError: no frame could be decoded, or no dots were found.
    """
    pictures = [frame for frame in frames if frame.image is not None]
    if not pictures:
        raise LayoutError("no frame could be decoded: check the source")
    tried = sorted({0, len(pictures) // 2, len(pictures) - 1})
    for place in tried:
        frame = pictures[place]
        assert frame.image is not None
        image, corner = crop(frame.image, roi_px)
        scale = level_scale(frame.image)
        pattern = best_pattern(image, scale, known) if min(image.shape[:2]) >= 16 else None
        if pattern is not None:
            return _measure_pattern(frame, image, corner, scale, pattern)
    height, width = pictures[0].image.shape[:2] if pictures[0].image is not None else (0, 0)
    where = f"the {width} x {height} px image" if roi_px is None else f"the region {roi_px} of the image"
    raise LayoutError(
        f"no dots were found in {where}: expected at least {FEWEST} round spots of similar size, regularly "
        "spaced, lighter or darker than their background; check focus, light and region"
    )


def _measure_pattern(
    frame: Frame, image: np.ndarray, corner: Float64[np.ndarray, "2"], scale: float, pattern: Pattern
) -> Survey:
    """Measures the dots of a pattern and summarises their appearance."""
    sign = 1.0 if pattern.polarity == "light" else -1.0
    noise = estimate_noise(image, pattern.weights)
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
    keep[kept[~find_single_dots(measured.centre_px[kept], radius_px, weight, 0.9)]] = False
    detections = measured.at(keep, corner)
    typical = pattern.alike & keep
    radius_px = np.sqrt(measured.area_px2[typical if typical.any() else keep] / np.pi)
    colour = None
    if image.ndim == 3:
        ratio = pattern.weights / scale
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
        regular=pattern.regular,
        notes=_notes(pattern, keep),
    )


def _is_half_visible(image: np.ndarray, dots: MeasuredDots, keep: Mask) -> Mask:
    """(n,) whether about half of the dot or more is inside the image, compared with the dots near it."""
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
        notes.append(f"{odd} of {int(keep.sum())} dots are weak, damaged or irregular.")
    if pattern.regular < 0.5:
        notes.append("The dots are not a locally regular pattern.")
    return tuple(notes)
