"""Opens an input, determines its sensor and selects the pipeline that processes it."""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from numbers import Integral
from pathlib import Path
from types import NoneType
from typing import Any

from manytouch.blas_threads import limit_blas_threads
from manytouch.calibration import register_rest, rest_of_recording, sensor_from_rest
from manytouch.calibration.outline.pad_outline import pad_of
from manytouch.calibration.rest.adapt_nominal import register_nominal
from manytouch.calibration.rest.whole_recording import is_still, with_doubt_of_start, with_unrelated_pictures
from manytouch.errors import ManytouchError, SensorError, SourceError, require_type, without_password
from manytouch.pipeline import Pipeline, Sink
from manytouch.session.methods import (
    DEFAULT,
    ParameterValue,
    default_method,
    pipeline_for,
    require_method_for,
)
from manytouch.session.result_hashes import Pitch, Request
from manytouch.session.run import OBSERVER, NoObserver, Observer, StopCondition
from manytouch.session.warm_up import warm_up_for
from manytouch.sources import Source, open_source
from manytouch.sources.cameras.capture import CameraRequest
from manytouch.sources.first_frames import first_frames
from manytouch.sources.source import ASSUMED_FPS, close
from manytouch.values import Frame, Reading, Roi, Sensor
from manytouch.values.arrays import plain
from manytouch.values.display.text import count_of
from manytouch.values.images.roi import require_roi
from manytouch.values.sensor_file import load_sensor

START_FRAMES = 15  # the first ones, which show the sensor and its rest positions
INPUT = "the path of a video or image, the number of a camera, or what manytouch.open_source returns"
SPREAD_FRAMES = 16
STILL_TRIES = 8  # times `START_FRAMES`, for a live source to be still at its start
UNKNOWN_PRETENSION = (
    "The pretension of the sheet is estimated from what presses it, since its file does not state both "
    "pretension_N_per_mm and young_MPa; the standard deviations of forces contain that of the estimate "
    "(manytouch calibrate sheet measures the pretension)."
)
NO_RATE = f"The frame rate is {ASSUMED_FPS:g} frames per second, since the input states none (--fps sets it)."


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Job:
    """An input that is open, with the sensor and the pipeline to process it; `manytouch.session.Readings`.

    Run as it is, every frame is processed as fast as possible.

    Attributes:
        text: the input as it was given, without password.
        source: where the frames come from.
        frames: all frames in order, of a live source those from now on; can be iterated once.
        samples: the first two frames, to warm up with.
        sensor: determined from the first frames, registered to them, or the source's own.
        pipeline, method: what processes the frames.
        roi_px: the part of the image that is processed; None for all of it.
        request: the arguments of `prepare`.
        files_stamp: of the input where its files are copies, such as of an object store; see `files_stamp`.
    """

    text: str
    source: Source
    frames: Iterator[Frame]
    samples: tuple[Frame, ...]
    sensor: Sensor
    pipeline: Pipeline
    method: str
    roi_px: Roi | None = None
    request: Request
    files_stamp: str | None = None

    def __repr__(self) -> str:
        frames = "" if self.frame_count is None else f", {count_of(self.frame_count, 'frame')}"
        return (
            f"Job({self.text!r}{frames}, sensor {self.sensor.name!r}, method {self.method}, "
            f"lengths in {self.sensor.length_unit})"
        )

    @property
    def frame_count(self) -> int | None:
        """Expected number of frames; None when not known."""
        return self.source.frame_count

    @property
    def own_sinks(self) -> tuple[Sink, ...]:
        """A job has no sinks of its own."""
        return ()

    @property
    def input_info(self) -> dict[str, Any]:
        """Properties of the input, for summary and recording."""
        source = self.source
        timeline = source.capabilities.seek
        return {
            "source": self.text,
            "name": source.name,
            "width_px": source.width_px,
            "height_px": source.height_px,
            "fps": source.fps,
            "frame_count": source.frame_count,
            "warning": None if timeline is None else timeline.warning,
        }

    def warm_up(self, on_message: Callable[[str], object] | None = None) -> Any:
        """Compile by processing two frames, and a simulated contact where the method is new on this machine.

        Args:
            on_message: gets the progress of compiling.

        Returns:
            The state of the estimation before the first frame.

        Raises:
            ManytouchError: the frames cannot be processed with this pipeline and sensor.
        """
        warm_up_for(self.method, self.sensor, on_message)
        try:
            estimation = self.pipeline.estimate.start(self.sensor)
            tracked = self.pipeline.track_frames(self.samples, self.sensor)
            for _ in self.pipeline.estimate_readings(tracked, self.sensor, estimation):
                pass
        except (ArithmeticError, ValueError) as error:
            raise ManytouchError(f"frames cannot be processed with this setup: {error}") from error
        return estimation

    def readings(self) -> Iterator[Reading]:
        """Every frame's reading, in order; can be iterated once.

        Raises:
            ManytouchError: no frame is left.
        """
        return self._readings(None)

    def start(self, observer: Observer, stop: StopCondition) -> Generator[Reading, None, None]:
        """Every frame's reading, in order.

        Raises:
            ManytouchError: the first frames cannot be processed.
        """
        estimation = self.warm_up(None if isinstance(observer, NoObserver) else observer.on_message)
        yield from self._readings(estimation)

    def _readings(self, estimation: Any) -> Iterator[Reading]:
        """Every frame's reading, from a state of the estimation; None: it is computed."""
        if (first := next(self.frames, None)) is None:
            raise ManytouchError(f"the frames of {self.text} were read already: prepare it again")
        tracked = self.pipeline.track_frames(chain((first,), self.frames), self.sensor)
        yield from self.pipeline.estimate_readings(tracked, self.sensor, estimation)

    def close(self) -> None:
        """Release the source."""
        close(self.source)


def prepare(
    input: str | Path | int | Source,  # noqa: A002 - the word of the command line
    *,
    sensor: str | Path | Sensor | None = None,
    method: str | None = None,
    pitch_mm: Pitch | None = None,
    hfov_deg: float | None = None,
    roi_px: Roi | None = None,
    fps: float | None = None,
    parameters: Mapping[str, ParameterValue] | None = None,
    camera: CameraRequest | None = None,
    whole_recording: bool = False,
    observer: Observer | None = None,
) -> Job:
    """Open an input and determine its sensor.

    Args:
        input: a source, or what `open_source` takes.
        sensor: a sensor, or its file; None uses the source's own, or finds the layout in the first frames.
        method: one of `METHODS`; None selects `mechanics` where the sheet is known, else `perimeter`.
        pitch_mm: distance of neighbouring markers, one number or (x, y); None gives lengths in pitches.
        hfov_deg: horizontal field of view of the camera; None assumes 60 degrees.
        roi_px: the part of the image to process.
        fps: frame rate to use instead of the source's own.
        parameters: of the method, other than the defaults; see `pipeline_for`.
        camera: what to request of a camera; the size is the sensor's unless it is requested.
        whole_recording: without a sensor or with the file of a pad, take the stillest and most common
            positions of the markers in the whole of a video, or of images whose rate is known, as rest
            instead of those in the first frames; it is then read twice.
        observer: gets messages.

    Returns:
        The job; running it releases the source, else its `close` does.

    Raises:
        SourceError: the input cannot be opened, or the region is outside its image.
        SensorError: the sensor's file is invalid or does not fit the input.
        LayoutError: the first frames show no usable arrangement of dots.
        ManytouchError: there is no such method or parameter.
    """
    limit_blas_threads()
    require_type("the input", input, (str, Path, Integral, Source), INPUT)
    require_type("the sensor", sensor, (str, Path, Sensor, NoneType), "a Sensor, or the path of its file")
    require_type("parameters", parameters, (Mapping, NoneType), "a dictionary of names and values")
    require_roi(roi_px)
    require_type("the observer", observer, (Observer, NoneType), OBSERVER)
    pitch_mm, hfov_deg, fps = plain(pitch_mm), plain(hfov_deg), plain(fps)
    if method is not None:
        pipeline_for(method, roi_px, parameters)  # reports a wrong name before anything is opened
    given = load_sensor(sensor) if isinstance(sensor, str | Path) else sensor
    if given is not None and (pitch_mm is not None or hfov_deg is not None):
        what = f"the sensor {given.name!r} already states pitch and camera"
        raise SensorError(f"{what}: give either a sensor file or --pitch-mm and --hfov-deg")
    source, text = _open(input, fps, _with_size(camera, given))
    timeline = source.capabilities.seek
    if observer is not None and timeline is not None and timeline.warning is not None:
        observer.on_message(timeline.warning)
    try:
        known = source.capabilities.sensor if given is None else given
        if given is not None or known is None:
            chosen = method or (DEFAULT if known is None else default_method(known))
            warm_up_for(chosen, known, None if observer is None else observer.on_message)
        spread = partial(spread_frames, source) if whole_recording and can_be_read_twice(source) else None
        found, first, frames = _determine_sensor(
            source, text, given, pitch_mm=pitch_mm, hfov_deg=hfov_deg, roi_px=roi_px, spread=spread
        )
        is_unrelated = source.capabilities.is_images and source.fps is None  # a rate makes pictures a series
        if spread is not None and known is None and is_unrelated:
            found = with_unrelated_pictures(found, spread(), roi_px)
        elif spread is not None and not is_unrelated and _may_begin_pressed(given, known):
            if observer is not None:
                observer.on_message("reading the whole recording once, for the rest positions of its markers")
            settled = rest_of_recording(found, source, frame_count=source.frame_count, roi_px=roi_px)
            # a calibrated file promises a recording that begins at rest: only a clear result corrects that
            found = found if settled.doubt is not None and _is_calibrated_pad(given) else settled.sensor
        chosen = method or default_method(found)
        require_method_for(found, chosen)
    except BaseException:
        close(source)
        raise
    assumed = [UNKNOWN_PRETENSION] if _estimates_pretension(found, chosen) else []
    if source.fps is None and not source.is_live and source.frame_count != 1:
        assumed.append(NO_RATE)
    if new := [sentence for sentence in assumed if sentence not in found.assumptions]:
        found = replace(found, assumptions=(*found.assumptions, *new))
    return Job(
        text=text,
        source=source,
        frames=frames if source.is_live else chain(first, frames),
        samples=first[:2],
        sensor=found,
        pipeline=pipeline_for(chosen, roi_px, parameters),
        method=chosen,
        roi_px=roi_px,
        request=Request(
            sensor=given,
            method=method,
            pitch_mm=pitch_mm,
            hfov_deg=hfov_deg,
            roi_px=roi_px,
            fps=fps,
            parameters=parameters or {},
        ),
    )


def require_region(source: Source, text: str, roi_px: Roi | None) -> None:
    """Check that a region is inside the images of a source.

    Raises:
        SourceError: it is not.
    """
    if roi_px is not None and source.width_px is not None and source.height_px is not None:
        roi_px.require_inside(source.width_px, source.height_px, text)


def _may_begin_pressed(given: Sensor | None, known: Sensor | None) -> bool:
    """Whether the rest is that of the whole recording: without a sensor, or with the file of a pad."""
    return known is None or (given is not None and given.is_nominal) or _is_calibrated_pad(given)


def _is_calibrated_pad(given: Sensor | None) -> bool:
    return given is not None and pad_of(given) is not None and not given.is_nominal


def can_be_read_twice(source: Source) -> bool:
    """Whether frames of the whole source can be read before it is processed."""
    return not source.is_live and source.frame_count != 1


def spread_frames(source: Source) -> list[Frame]:
    """Frames spread evenly over a recording."""
    step = max(1, (source.frame_count or SPREAD_FRAMES) // SPREAD_FRAMES)
    return list(islice(source, 0, step * SPREAD_FRAMES, step))


def _estimates_pretension(sensor: Sensor, method: str) -> bool:
    """Whether `mechanics` estimates the pretension, since the file does not state it with Young's modulus."""
    sheet = sensor.sheet
    return (
        method == "mechanics"
        and sheet is not None
        and not sheet.is_assumed
        and sheet.boundary == "clamped"
        and not sheet.states_pretension
    )


def _determine_sensor(
    source: Source,
    text: str,
    given: Sensor | None,
    *,
    pitch_mm: Pitch | None,
    hfov_deg: float | None,
    roi_px: Roi | None,
    spread: Callable[[], Sequence[Frame]] | None = None,
) -> tuple[Sensor, tuple[Frame, ...], Iterator[Frame]]:
    """The sensor according to the first frames, these, and the frames after them."""
    _require_views(source, text, given, roi_px)
    require_region(source, text, roi_px)
    if given is not None:
        _require_fit(source, text, given)
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
        found = sensor_from_rest(
            first, name=source.name, pitch_mm=pitch_mm, hfov_deg=hfov_deg, roi_px=roi_px, spread=spread
        )
        for _ in range(STILL_TRIES if source.is_live else 0):
            if is_still(found, len(first)):
                break
            first = first_frames(frames, START_FRAMES, device) or first
            found = sensor_from_rest(
                first, name=source.name, pitch_mm=pitch_mm, hfov_deg=hfov_deg, roi_px=roi_px
            )
        found = with_doubt_of_start(found, len(first)) if source.is_live else found
    if device is not None:
        device.is_colour = found.layout is not None and found.layout.colour_weights is not None
    return found, first, frames


def _with_size(camera: CameraRequest | None, sensor: Sensor | None) -> CameraRequest:
    """The request, with the size of the sensor's camera where it has no size."""
    request = CameraRequest() if camera is None else camera
    if sensor is not None and sensor.camera.views:
        sensor = replace(sensor, camera=sensor.camera.views[0].camera)
    if sensor is None or request.size_px is not None:
        return request
    return replace(request, size_px=(sensor.camera.width_px, sensor.camera.height_px))


def _open(given: str | Path | int | Source, fps: float | None, camera: CameraRequest) -> tuple[Source, str]:
    """A source, and its name in messages."""
    if not isinstance(given, Source):
        return open_source(str(given), fps=fps, camera=camera), without_password(str(given))
    if fps is not None:
        raise SourceError(f"{given.name!r} is an open source: give fps={fps} to manytouch.open_source")
    return given, given.name


def _require_views(source: Source, text: str, given: Sensor | None, roi_px: Roi | None) -> None:
    """Check that several views come with a sensor that has them, and without a region of interest."""
    known = given or source.capabilities.sensor
    if roi_px is not None and known is not None and known.camera.views:
        raise SensorError(
            f"a region of interest is a part of one picture, but {known.name!r} has several views: omit it"
        )
    if given is None and source.capabilities.views > 1:
        raise SensorError(
            f"{text} needs a sensor file with [[views]], which states where each camera is: give --sensor"
        )


def _require_fit(source: Source, text: str, sensor: Sensor) -> None:
    camera, views = sensor.camera, source.capabilities.views
    if views > 1 and views != max(len(camera.views), 1):
        raise SensorError(
            f"{text} has {views} views, but the sensor {sensor.name!r} has "
            f"{max(len(camera.views), 1)}: name one source for each of its [[views]], in their order"
        )
    stated = (source.width_px, source.height_px)  # what a source does not state is compared with its frames
    if None not in stated and stated != (camera.width_px, camera.height_px):
        raise SensorError(
            f"the sensor {sensor.name!r} is for images of {camera.width_px} x {camera.height_px} px, but "
            f"{text} has {source.width_px} x {source.height_px} px: give this camera's sensor file, or none"
        )
