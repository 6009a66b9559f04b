"""How well the dots of a recording can be read, in frank sentences with a remedy."""

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from manytouch import calibration
from manytouch.calibration import LayoutReport
from manytouch.calibration.sharpness import edge_width_px, is_soft
from manytouch.detection import Appearance, survey
from manytouch.detection.search import level_of
from manytouch.errors import LayoutError, SourceError
from manytouch.session.diagnosis.camera import rate_in_words, settings_in_words
from manytouch.session.methods import Roi
from manytouch.session.prepare import REST_FRAMES, check_region
from manytouch.sources import Source, open_source
from manytouch.sources.source import Device
from manytouch.values import Detections, Frame

LOW_CONTRAST, SMALL_RADIUS_PX = 20.0, 2.5
MUCH_SATURATED, DARK_MEAN, UNSTEADY = 0.05, 40.0, 0.1
NOISY_PX, MANY_MISSING, PRESSED_PITCHES = 0.15, 0.1, 0.15


def examine(text: str, roi_px: Roi | None = None) -> Iterator[str]:
    """Lines about the first frames of a source.

    Raises:
        SourceError: it cannot be opened, or its first frames cannot be decoded.
    """
    source = open_source(text)
    if not isinstance(source, Device):
        yield from _examined(source, text, roi_px)
        return
    try:
        yield from settings_in_words(source.settings)
        yield rate_in_words(source)
        source.is_colour = True
        yield from _examined(source, text, roi_px)
    finally:
        source.close()


def _examined(source: Source, text: str, roi_px: Roi | None) -> Iterator[str]:
    check_region(source, text, roi_px)
    yield _source_in_words(source)
    frames = [frame for frame in islice(source, REST_FRAMES) if frame.image is not None]
    if not frames:
        raise SourceError(
            f"none of the first {REST_FRAMES} frames of {text} could be decoded; try another player"
        )
    yield _exposure(frames)
    try:
        surveyed = survey(frames, roi_px=roi_px)
    except LayoutError as error:
        yield f"dots: {error}"
        return
    reference = next(frame for frame in frames if frame.index == surveyed.frame_index)
    yield _dots(surveyed.detections, surveyed.appearance)
    yield _contrast(surveyed.detections)
    yield _focus(reference, surveyed.detections, surveyed.appearance, roi_px)
    yield from (f"odd: {note}" for note in surveyed.notes)
    try:
        layout = calibration.examine(frames, roi_px=roi_px)
    except LayoutError as error:
        yield f"arrangement: none found: {error}"
        return
    yield _arrangement(layout)
    yield _rest(layout, len(frames))
    yield _noise(layout)


def _source_in_words(source: Source) -> str:
    rate = "rate not known" if source.fps is None else f"{source.fps:g} frames per second"
    count = "" if source.frame_count is None else f", {source.frame_count} frames promised"
    return f"{source.width_px} x {source.height_px} px, {rate}{count}"


def _exposure(frames: Sequence[Frame]) -> str:
    levels = [
        np.asarray(frame.image, dtype=np.float32) * level_of(np.asarray(frame.image)) for frame in frames
    ]
    means = np.array([level.mean() for level in levels])
    saturated = float(np.mean(levels[-1] >= 254.5))
    words = f"exposure: mean grey {means[-1]:.0f} of 255, {saturated:.1%} of the picture saturated"
    if saturated > MUCH_SATURATED:
        words += "; too bright: shorten the exposure or dim the light, dots in white areas lose their edges"
    elif means[-1] < DARK_MEAN:
        words += "; dark: more light, or a longer exposure"
    if np.ptp(means) > UNSTEADY * means.max():
        words += (
            f"; it drifts from {means[0]:.0f} to {means[-1]:.0f} over these {len(frames)} frames: "
            "switch off automatic exposure and white balance"
        )
    return words


def _dots(found: Detections, appearance: Appearance) -> str:
    small, large = appearance.radius_min_px, appearance.radius_max_px
    count, size = len(found.centre_px), f"{small:.1f} to {large:.1f} px"
    words = f"dots: {count}, {appearance.polarity}er than their ground, radius {size}"
    if large < SMALL_RADIUS_PX:
        words += "; small: come nearer, zoom in, or take a higher resolution"
    return words


def _contrast(found: Detections) -> str:
    if len(found.contrast) == 0:
        return "contrast: not known, for there are no dots"
    middle, weak = np.quantile(found.contrast, [0.5, 0.1])
    words = f"contrast: {middle:.0f} grey levels in the median, {weak:.0f} for the weakest tenth"
    if middle < LOW_CONTRAST:
        words += "; low: brighter and more even light, or darker print"
    return words


def _focus(frame: Frame, found: Detections, appearance: Appearance, roi_px: Roi | None) -> str:
    if len(found.centre_px) == 0 or frame.image is None:
        return "focus: not known, for there are no dots"
    weights = appearance.weights(1 if frame.image.ndim == 2 else frame.image.shape[2])
    radius_px = np.sqrt(found.area_px2 / np.pi)
    width = edge_width_px(frame.image, weights, found.centre_px, radius_px, roi_px=roi_px)
    if np.isnan(width):
        return "focus: not known, for no dot is whole"
    words = f"focus: edges of the dots are {width:.1f} px wide"
    if is_soft(width, radius_px):
        words += "; soft: focus the lens, or shorten the exposure when the view moves"
    return words


def _arrangement(layout: LayoutReport) -> str:
    x_px, y_px = layout.pitch_px
    if layout.rows is None:
        words = f"arrangement: {layout.markers} markers that form no rectangle, about {x_px:.0f} px apart"
    else:
        words = (
            f"arrangement: {layout.rows} rows x {layout.columns} columns, pitch {x_px:.1f} x {y_px:.1f} px"
        )
    if layout.missing:
        words += f", {layout.missing} of {layout.markers} places without a dot"
    if layout.missing > MANY_MISSING * layout.markers:
        words += "; many: even light, cleaner print, or --roi around the dots"
    return words


def _rest(layout: LayoutReport, frames: int) -> str:
    first = "the only frame" if frames == 1 else f"the first {frames} frames"
    words = f"rest: nothing moves in {layout.still_frames} of {first}"
    if layout.bulge_pitches > PRESSED_PITCHES:
        words += (
            f", but the markers depart by {layout.bulge_pitches:.2f} pitches from a smooth lattice: "
            "the sheet looks pressed; begin the recording untouched"
        )
    return words


def _noise(layout: LayoutReport) -> str:
    if not np.isfinite(layout.noise_px):
        return "noise: not known from so few still frames; give a recording of the untouched sheet"
    words = f"noise: {layout.noise_px:.3f} px per marker in the still frames"
    if layout.noise_px > NOISY_PX:
        words += "; high: steady the camera, brighten the light, or lower the gain"
    return words
