"""Lines of text about the first frames of a source: exposure, dots, focus, layout, noise, and remedies."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice

import numpy as np

from manytouch import calibration
from manytouch.calibration import LayoutReport
from manytouch.calibration.dot_shape import height_over_width
from manytouch.calibration.dot_sharpness import edge_width_px, is_soft
from manytouch.calibration.marker_tracks import track_markers
from manytouch.calibration.rest.first_frames import IN_FRONT_OF_A_SCENE
from manytouch.calibration.rest.local_bulge import PRESSED_PITCHES
from manytouch.detection import Appearance, survey
from manytouch.errors import LayoutError, SourceError
from manytouch.session.diagnosis.camera import describe_frame_rate, describe_settings
from manytouch.session.sensors.determine_sensor import START_FRAMES
from manytouch.session.sensors.source_checks import require_region
from manytouch.sources import Source, open_source
from manytouch.sources.first_frames import can_be_read_twice, spread_frames
from manytouch.sources.source import close
from manytouch.tracking import COMPRESSED_VIDEO
from manytouch.values import Detections, Frame, Roi
from manytouch.values.arrays import Scalars
from manytouch.values.display.text import count_of
from manytouch.values.images.grey_levels import level_scale

LOW_CONTRAST, SMALL_RADIUS_PX = 20.0, 2.5
MUCH_SATURATED, DARK_MEAN, UNSTEADY = 0.05, 40.0, 0.1
SATURATED_LEVEL = 254.5  # the largest one, also of 16 bits that are scaled to 255
NOISY_PX, MANY_MISSING = 0.15, 0.1
ODD_PITCHES = 0.05
ODD_DOTS = 0.5  # of the ratio of the pitches, as logarithms: halfway between round and squeezed dots


def diagnose(text: str, roi_px: Roi | None = None) -> Iterator[str]:
    """Lines about the first frames of a source.

    Raises:
        SourceError: it cannot be opened, or its first frames cannot be decoded.
    """
    source = open_source(text)
    device = source.capabilities.device
    try:
        if device is not None:
            yield from describe_settings(device.settings)
            yield describe_frame_rate(source)
            device.is_colour = True
        yield from _diagnose_frames(source, text, roi_px)
    finally:
        close(source)


def _diagnose_frames(source: Source, text: str, roi_px: Roi | None) -> Iterator[str]:
    require_region(source, text, roi_px)
    yield _describe_source(source)
    frames = [frame for frame in islice(source, START_FRAMES) if frame.image is not None]
    if not frames:
        raise SourceError(
            f"none of the first {START_FRAMES} frames of {text} could be decoded; convert the file, or "
            "check it in a video player"
        )
    yield _describe_brightness(frames)
    try:
        surveyed = survey(frames, roi_px=roi_px)
    except LayoutError as error:
        yield from _diagnose_scene(source, frames, roi_px, str(error))
        return
    reference = next(frame for frame in frames if frame.index == surveyed.frame_index)
    yield _describe_dots(surveyed.detections, surveyed.appearance)
    yield _describe_contrast(surveyed.detections)
    yield _describe_focus(reference, surveyed.detections, surveyed.appearance, roi_px)
    yield from (f"warning: {note}" for note in surveyed.notes)
    try:
        layout = calibration.examine(frames, roi_px=roi_px)
    except LayoutError as error:
        yield f"layout: none found: {error}"
        return
    yield _describe_layout(
        layout, _of_dots(height_over_width, reference, surveyed.detections, surveyed.appearance, roi_px)
    )
    yield _describe_rest(layout, len(frames))
    yield _describe_noise(layout)
    sensor = calibration.sensor_from_rest(frames, name=source.name, roi_px=roi_px)
    if track_markers(sensor, frames, roi_px).compression_std_px > 0.0:
        yield f"warning: {COMPRESSED_VIDEO}"
    if source.capabilities.device is None and source.frame_count != len(frames):
        yield f"only the first {len(frames)} frames were looked at: manytouch process looks at all"


def _diagnose_scene(
    source: Source, frames: Sequence[Frame], roi_px: Roi | None, no_dots: str
) -> Iterator[str]:
    """Lines about few dots before other things, which frames of the whole recording show."""
    spread = None
    if can_be_read_twice(source):
        yield f"the first {len(frames)} frames show no dots of a regular print: the whole recording is read"
        spread = partial(spread_frames, source)
    try:
        layout = calibration.examine(frames, roi_px=roi_px, spread=spread)
    except LayoutError:
        yield f"dots: {no_dots}"
        return
    yield f"dots: {layout.dots}; {IN_FRONT_OF_A_SCENE[0].lower()}{IN_FRONT_OF_A_SCENE[1:-1]}"
    yield _describe_layout(layout, np.nan)


def _describe_source(source: Source) -> str:
    rate = "frame rate unknown" if source.fps is None else f"{source.fps:g} frames per second"
    if source.capabilities.is_images:
        count = f", {count_of(source.frame_count or 0, 'image')}"
    else:
        count = "" if source.frame_count is None else f", {source.frame_count} frames according to its header"
    return f"{source.width_px} x {source.height_px} px, {rate}{count}"


def _describe_brightness(frames: Sequence[Frame]) -> str:
    levels = [
        np.asarray(frame.image, dtype=np.float32) * level_scale(np.asarray(frame.image)) for frame in frames
    ]
    means = np.array([level.mean() for level in levels])
    saturated = float(np.mean(levels[-1] >= SATURATED_LEVEL))
    text = f"exposure: mean grey {means[-1]:.0f} of 255, {saturated:.1%} of the image saturated"
    if saturated > MUCH_SATURATED:
        text += "; too bright: shorten the exposure or dim the light, because dots lose their edges"
    elif means[-1] < DARK_MEAN:
        text += "; dark: use more light, or a longer exposure"
    if np.ptp(means) > UNSTEADY * means.max():
        text += (
            f"; it changes from {means[0]:.0f} to {means[-1]:.0f} over these {len(frames)} frames: "
            "switch off automatic exposure and white balance"
        )
    return text


def _describe_dots(found: Detections, appearance: Appearance) -> str:
    small, large = appearance.radius_min_px, appearance.radius_max_px
    count, size = len(found.centre_px), f"{small:.1f} to {large:.1f} px"
    text = f"dots: {count}, {appearance.polarity}er than their background, radius {size}"
    if large < SMALL_RADIUS_PX:
        text += "; small: move the camera closer, zoom in, or use a higher resolution"
    return text


def _describe_contrast(found: Detections) -> str:
    if len(found.contrast) == 0:
        return "contrast: unknown, because there are no dots"
    middle, weak = np.quantile(found.contrast, [0.5, 0.1])
    text = f"contrast: {middle:.0f} grey levels (median), {weak:.0f} (10th percentile)"
    if middle < LOW_CONTRAST:
        text += "; low: use brighter and more even light, or darker print"
    return text


def _describe_focus(frame: Frame, found: Detections, appearance: Appearance, roi_px: Roi | None) -> str:
    if len(found.centre_px) == 0 or frame.image is None:
        return "focus: unknown, because there are no dots"
    width = _of_dots(edge_width_px, frame, found, appearance, roi_px)
    if np.isnan(width):
        return "focus: unknown, because every dot is cut off"
    text = f"focus: the edges of the dots are {width:.1f} px wide"
    if is_soft(width, _radius_px(found)):
        text += "; soft: focus the lens, or shorten the exposure if the camera moves"
    return text


def _of_dots(
    measure: Callable[..., float],
    frame: Frame,
    found: Detections,
    appearance: Appearance,
    roi_px: Roi | None,
) -> float:
    """A measure of the dots of a frame; NaN if there are none."""
    if len(found.centre_px) == 0 or frame.image is None:
        return np.nan
    weights = appearance.weights(1 if frame.image.ndim == 2 else frame.image.shape[2])
    return measure(frame.image, weights, found.centre_px, _radius_px(found), roi_px=roi_px)


def _radius_px(found: Detections) -> Scalars:
    return np.asarray(np.sqrt(found.area_px2 / np.pi))


def _describe_layout(layout: LayoutReport, dot_height_over_width: float) -> str:
    x_px, y_px = layout.pitch_px
    differs = max(x_px, y_px) / min(x_px, y_px) - 1.0
    if layout.rows is None:
        text = f"layout: {layout.markers} markers that do not form a lattice, about {x_px:.0f} px apart"
    else:
        text = f"layout: {layout.rows} rows x {layout.columns} columns, pitch {x_px:.1f} x {y_px:.1f} px"
    if layout.rows is not None and differs > ODD_PITCHES:
        text += _describe_odd_pitch(x_px, y_px, differs, dot_height_over_width)
    if layout.missing:
        text += f", {layout.missing} of {layout.markers} markers missing"
    if layout.missing > MANY_MISSING * layout.markers:
        text += "; many: use more even light, a cleaner print, or --roi around the dots"
    return text


def _describe_odd_pitch(x_px: float, y_px: float, differs: float, dot_height_over_width: float) -> str:
    """Whether the picture is squeezed, with its dots, or the print is uneven."""
    text = f"; the pitch differs by {differs:.0%} along x and y"
    dots = np.log(dot_height_over_width) / np.log(y_px / x_px)  # 1 if the dots are squeezed as the pitch is
    if not np.isfinite(dots):
        return f"{text}: give --pitch-mm X,Y"
    taller = max(dot_height_over_width, 1.0 / dot_height_over_width) - 1.0
    if dots > ODD_DOTS:
        longer = "taller than wide" if y_px > x_px else "wider than tall"
        return (
            f"{text}, and the dots are {taller:.0%} {longer}: the picture is squeezed, or the camera "
            "looks at a slant; store it in the camera's proportions, or place the camera straight in front"
        )
    return f"{text}, but the shape of the dots does not: the print is so; give --pitch-mm X,Y"


def _describe_rest(layout: LayoutReport, frames: int) -> str:
    text = f"rest: no motion in {layout.still_frames} of the first {frames} frames"
    if frames == 1:
        text = "rest: taken from the only frame, which shows no motion"
    if layout.bulge_pitches > PRESSED_PITCHES:
        text += (
            f", but the markers deviate by {layout.bulge_pitches:.2f} pitches from a smooth lattice: "
            "the sheet is probably pressed; start the recording while nothing touches it"
        )
    return text


def _describe_noise(layout: LayoutReport) -> str:
    if not np.isfinite(layout.noise_px):
        return "noise: unknown, because too few frames are at rest; give a recording of the untouched sheet"
    text = f"noise: {layout.noise_px:.3f} px per marker in the frames at rest"
    if layout.noise_px > NOISY_PX:
        text += "; high: fix the camera, use more light, or lower the gain"
    return text
