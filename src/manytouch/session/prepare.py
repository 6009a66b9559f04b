"""Opens an input, determines its sensor and selects the pipeline that processes it."""

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from numbers import Integral
from pathlib import Path
from types import NoneType
from typing import Any

from manytouch.blas_threads import limit_blas_threads
from manytouch.calibration.rest.register_rest import require_markers
from manytouch.errors import ManytouchError, SensorError, SourceError, require_type, without_password
from manytouch.pipeline import Pipeline, Sink
from manytouch.session.background_iterator import BackgroundIterator, short_switch_interval
from manytouch.session.methods import (
    DEFAULT,
    ParameterValue,
    default_method,
    pipeline_for,
    require_method_for,
)
from manytouch.session.result_hashes import Pitch, Request
from manytouch.session.run import OBSERVER, NoObserver, Observer, StopCondition
from manytouch.session.sensors.determine_sensor import determine_sensor
from manytouch.session.warm_up import warm_up_for
from manytouch.sources import Source, open_source
from manytouch.sources.cameras.capture import CameraRequest
from manytouch.sources.source import ASSUMED_FPS, close
from manytouch.values import Frame, Reading, Roi, Sensor
from manytouch.values.arrays import plain
from manytouch.values.display.text import count_of
from manytouch.values.images.roi import require_roi
from manytouch.values.sensor_file.assumed_sheet import ASSUMED_SHEET

INPUT = "the path of a video or image, the number of a camera, or what manytouch.open_source returns"
UNKNOWN_PRETENSION = (
    "The pretension of the sheet is estimated from what presses it, since its file does not state both "
    "pretension_N_per_mm and young_MPa; the standard deviations of forces contain that of the estimate "
    "(manytouch calibrate sheet measures the pretension)."
)
_WITHOUT_SHEET = {"mechanics": ASSUMED_SHEET, "perimeter": "The sheet is one pitch thick."}
_AHEAD = 4  # frames that are tracked and wait for estimation
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
        if not self.source.capabilities.files:  # what makes frames on demand may depend on the readings
            yield from self.pipeline.estimate_readings(tracked, self.sensor, estimation)
            return
        ahead = BackgroundIterator(tracked, ahead=_AHEAD, thread_name="manytouch-track")
        with short_switch_interval(), ahead as stream:
            yield from self.pipeline.estimate_readings(stream, self.sensor, estimation)

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
        method: one of `METHODS`; None selects `mechanics` where a sheet is known or assumed, or `perimeter`.
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
    given = sensor if sensor is None or isinstance(sensor, Sensor) else _loaded(sensor)
    if given is not None:
        require_markers(given)
    _refuse_two_scales("the sensor file", given, pitch_mm, hfov_deg)
    on_message = None if observer is None else observer.on_message
    source, text = _open(input, fps, _with_size(camera, given))
    timeline = source.capabilities.seek
    if on_message is not None and timeline is not None and timeline.warning is not None:
        on_message(timeline.warning)
    try:
        known = source.capabilities.sensor if given is None else given
        _refuse_two_scales(text, known, pitch_mm, hfov_deg)
        if given is not None or known is None:
            warm_up_for(method or (DEFAULT if known is None else default_method(known)), known, on_message)
        started = determine_sensor(
            source,
            text,
            given,
            pitch_mm=pitch_mm,
            hfov_deg=hfov_deg,
            roi_px=roi_px,
            whole_recording=whole_recording,
            on_message=on_message,
        )
        chosen = method or default_method(started.sensor)
        require_method_for(started.sensor, chosen)
        pipeline = pipeline_for(chosen, roi_px, parameters)
    except BaseException:
        close(source)
        raise
    return Job(
        text=text,
        source=source,
        # an iterator releases its tuple
        frames=started.frames if source.is_live else chain(iter(started.first), started.frames),
        samples=started.first[:2],
        sensor=_with_assumptions(started.sensor, source, chosen),
        pipeline=pipeline,
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


def _loaded(path: str | Path) -> Sensor:
    from manytouch.values.sensor_file.read import load_sensor  # what checks files takes 80 ms to import

    return load_sensor(path)


def _with_assumptions(sensor: Sensor, source: Source, method: str) -> Sensor:
    """The sensor with what this method assumes of it, and of the frame rate of its source."""
    assumed = [UNKNOWN_PRETENSION] if _estimates_pretension(sensor, method) else []
    if sensor.sheet is None and method in _WITHOUT_SHEET:
        assumed.append(f"The sensor file has no [sheet]. {_WITHOUT_SHEET[method]}")
    if source.fps is None and not source.is_live and source.frame_count != 1:
        assumed.append(NO_RATE)
    new = [sentence for sentence in assumed if sentence not in sensor.assumptions]
    return replace(sensor, assumptions=(*sensor.assumptions, *new)) if new else sensor


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


def _refuse_two_scales(origin: str, sensor: Sensor | None, pitch_mm: object, hfov_deg: object) -> None:
    """Refuse a pitch and a field of view where a sensor is known, from a file or from the input itself."""
    if sensor is not None and (pitch_mm is not None or hfov_deg is not None):
        what = f"the sensor {sensor.name!r} of {origin} already states pitch and camera"
        raise SensorError(f"{what}: omit --pitch-mm and --hfov-deg, or give another sensor file")
