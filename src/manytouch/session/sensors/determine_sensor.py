"""The sensor of a source: registered to its first frames, stated by it, or found in its frames."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from manytouch.calibration import register_rest, rest_of_recording, sensor_from_rest
from manytouch.calibration.outline.pad_outline import pad_of
from manytouch.calibration.rest.adapt_nominal import register_nominal
from manytouch.calibration.rest.register_rest import may_begin_pressed, register_to_recording
from manytouch.calibration.rest.whole_recording import is_still, with_doubt_of_start, with_unrelated_pictures
from manytouch.errors import SourceError
from manytouch.session.background_iterator import BackgroundIterator
from manytouch.session.result_hashes import Pitch
from manytouch.session.sensors.source_checks import require_fit, require_region, require_views
from manytouch.sources import Source
from manytouch.sources.first_frames import can_be_read_twice, first_frames, spread_frames
from manytouch.values import Frame, Roi, Sensor

START_FRAMES = 15
"""Number of first frames that show the sensor and its rest positions."""
STILL_TRIES = 8
"""How often `START_FRAMES` more are read from a live source whose markers moved in the ones before."""

_AHEAD = 4  # frames that are decoded before the ones before them were searched


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StartedSource:
    """A source of which the first frames were read.

    Attributes:
        sensor: the one that describes them.
        first: the frames that it was determined from, one or more.
        frames: those that follow.
    """

    sensor: Sensor
    first: tuple[Frame, ...]
    frames: Iterator[Frame]


def determine_sensor(
    source: Source,
    text: str,
    given: Sensor | None,
    *,
    pitch_mm: Pitch | None,
    hfov_deg: float | None,
    roi_px: Roi | None,
    whole_recording: bool,
    on_message: Callable[[str], object] | None,
) -> StartedSource:
    """Read the first frames of a source and determine its sensor.

    Args:
        source: its frames have not been read.
        text: the source in messages.
        given: registered to the first frames; None takes the sensor that the source states, if it states one,
            and else finds the layout in them.
        pitch_mm, hfov_deg, roi_px, whole_recording: see `prepare`.
        on_message: is called before the whole recording is read.

    Raises:
        SourceError, SensorError, LayoutError: see `prepare`.
    """
    require_views(source, text, given, roi_px)
    require_region(source, text, roi_px)
    if given is not None:
        require_fit(source, text, given)
    is_read_twice = whole_recording and can_be_read_twice(source)
    spread = partial(spread_frames, source) if is_read_twice else None
    device, own = source.capabilities.device, source.capabilities.sensor
    if device is not None:
        device.is_colour = True  # for the first frames, which show whether colour is needed
    frames = iter(source)
    first = first_frames(frames, START_FRAMES, device)
    if not first:
        raise SourceError(f"{text} contains no frame: give a video or images that show the dotted sheet")
    if given is not None and given.is_nominal:
        found = register_nominal(given, first, roi_px=roi_px, spread=spread)
    elif given is not None:
        found = register_rest(given, first, roi_px=roi_px)
    elif own is not None:
        found = own
    else:
        find = partial(
            sensor_from_rest, name=source.name, pitch_mm=pitch_mm, hfov_deg=hfov_deg, roi_px=roi_px
        )
        if source.is_live:
            found, first = _find_while_still(source, frames, first, find)
        else:
            found = find(first, spread=spread)
    if device is not None:
        device.is_colour = found.layout is not None and found.layout.colour_weights is not None
    if is_read_twice:
        found = _with_whole_recording(found, source, given, roi_px=roi_px, on_message=on_message)
    return StartedSource(sensor=found, first=first, frames=frames)


def _find_while_still(
    source: Source,
    frames: Iterator[Frame],
    first: tuple[Frame, ...],
    find: Callable[[Sequence[Frame]], Sensor],
) -> tuple[Sensor, tuple[Frame, ...]]:
    """The sensor that frames of a live source show, and these frames.

    Later frames are taken until their markers are still. If they never are, the rest of the sensor is
    doubtful.
    """
    found = find(first)
    for _ in range(STILL_TRIES):
        if is_still(found, len(first)):
            break
        first = first_frames(frames, START_FRAMES, source.capabilities.device) or first
        found = find(first)
    return with_doubt_of_start(found, len(first)), first


def _with_whole_recording(
    found: Sensor,
    source: Source,
    given: Sensor | None,
    *,
    roi_px: Roi | None,
    on_message: Callable[[str], object] | None,
) -> Sensor:
    """The sensor with the rest positions that the whole recording shows, where it may begin pressed.

    Pictures without a frame rate are no series, and have no common rest: they are only searched for the
    markers of the first ones.
    """
    has_sensor = given is not None or source.capabilities.sensor is not None
    if source.capabilities.is_images and source.fps is None:
        return found if has_sensor else with_unrelated_pictures(found, spread_frames(source), roi_px)
    is_calibrated_pad = given is not None and pad_of(given) is not None and not given.is_nominal
    is_nominal = given is not None and given.is_nominal
    is_known_sheet = has_sensor and not is_nominal and not is_calibrated_pad
    if is_known_sheet and (given is None or not may_begin_pressed(given, found)):
        return found
    if on_message is not None:
        on_message("reading the whole recording once, for the rest positions of its markers")
    with BackgroundIterator(iter(source), ahead=_AHEAD, thread_name="manytouch-reading") as frames:
        if is_known_sheet and given is not None:
            return register_to_recording(given, found, frames, frame_count=source.frame_count, roi_px=roi_px)
        settled = rest_of_recording(found, frames, frame_count=source.frame_count, roi_px=roi_px)
    # recordings with a calibrated file should begin at rest: only a result without doubt corrects that
    return found if settled.doubt is not None and is_calibrated_pad else settled.sensor
