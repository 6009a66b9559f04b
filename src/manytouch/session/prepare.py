"""An input that is open, with its sensor and the pipeline to read it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from manytouch.calibration import register_rest, sensor_from_rest
from manytouch.errors import ManytouchError, SensorError, SourceError
from manytouch.pipeline import Pipeline
from manytouch.session.methods import default_method, kernels, pipeline_for
from manytouch.session.warm_up import rehearse
from manytouch.sources import Source, open_source
from manytouch.sources.cameras.camera import without_password
from manytouch.sources.cameras.capture import CameraRequest
from manytouch.sources.files.images import ImagesSource
from manytouch.sources.files.replay import ReplaySource
from manytouch.sources.source import ASSUMED_FPS, Device
from manytouch.values import Frame, Reading, Roi, Sensor
from manytouch.values.sensor_file import load_sensor

REST_FRAMES = 15
NO_PRETENSION = (
    "The sheet has no pretension, since its file names none; where it has one, forces are too small and "
    "contacts may seem to be at its rim (manytouch calibrate sheet finds it)."
)
NO_RATE = (
    f"There are {ASSUMED_FPS:g} frames per second, since the input does not say how many (--fps says it)."
)

Pitch = float | tuple[float, float]


@runtime_checkable
class Observer(Protocol):
    """Somebody who follows a run while it goes on."""

    def say(self, sentence: str) -> None:
        """Something to tell the user, once."""

    def begin(self, job: "Job") -> None:
        """The sensor is known; reading starts."""

    def read(self, reading: Reading) -> None:
        """A frame has been read."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Job:
    """An input that is open, with the sensor and the pipeline to read it.

    Attributes:
        text: the input as it was named.
        source: where the frames come from.
        frames: all frames, in order; of a live source those from now on. Can be gone through once.
        samples: the first two frames, to warm up with.
        sensor: found in the first frames, fitted to them, or the source's own.
        pipeline, method: what reads the frames.
        roi_px: x, y, width, height of the part of the image to look at, or None.
    """

    text: str
    source: Source
    frames: Iterator[Frame]
    samples: tuple[Frame, ...]
    sensor: Sensor
    pipeline: Pipeline
    method: str
    roi_px: Roi | None = None

    @property
    def is_video(self) -> bool:
        """Is the input a moving picture, not single images?"""
        return not isinstance(self.source, ImagesSource)

    @property
    def recording(self) -> dict[str, Any]:
        """What is known of the input, for the record."""
        source = self.source
        return {
            "source": self.text,
            "name": source.name,
            "width_px": source.width_px,
            "height_px": source.height_px,
            "fps": source.fps,
            "frame_count": source.frame_count,
        }

    def warm_up(self) -> None:
        """Read two frames, and a touch where it is new, so that compiling is in no frame's time.

        Raises:
            ManytouchError: they cannot be read so.
        """
        rehearse(self.method)
        try:
            for _ in self.pipeline.run(self.samples, self.sensor):
                pass
        except (ArithmeticError, ValueError) as error:
            raise ManytouchError(f"this cannot be read with: {error}") from error

    def readings(self) -> Iterator[Reading]:
        """Every frame, read, in order. To be called once."""
        return self.pipeline.run(self.frames, self.sensor)


def prepare(
    input: str | Path | Source,  # noqa: A002 - the word of the command line
    *,
    sensor: str | Path | Sensor | None = None,
    method: str | None = None,
    pitch_mm: Pitch | None = None,
    hfov_deg: float | None = None,
    roi_px: Roi | None = None,
    fps: float | None = None,
    camera: CameraRequest | None = None,
    progress: Observer | None = None,
) -> Job:
    """Open an input and know its sensor.

    Args:
        input: a source, or what `open_source` takes.
        sensor: a sensor, or its file; None takes the source's own, or finds the layout in the first frames.
        method: one of `METHODS`; None takes `mechanics` where the sheet is known, else `perimeter`.
        pitch_mm: distance of neighbouring markers, one number or (x, y); None leaves lengths in pitches.
        hfov_deg: horizontal field of view of the camera; None assumes 60 degrees.
        roi_px: x, y, width, height of the part of the image to look at.
        fps: frame rate to use instead of the source's own.
        camera: what to ask a camera for; the size is the sensor's unless it is asked for.
        progress: told when something takes long.

    Raises:
        SourceError: the input cannot be opened, or the region lies outside its image.
        SensorError: the sensor's file is wrong or does not fit the input.
        LayoutError: the first frames show no usable arrangement of dots.
        ManytouchError: there is no such method.
    """
    if method is not None:
        pipeline_for(method, roi_px)  # a name that is wrong is told before anything is opened
    given = load_sensor(sensor) if isinstance(sensor, str | Path) else sensor
    if given is not None and (pitch_mm is not None or hfov_deg is not None):
        raise SensorError(
            f"the sensor {given.name!r} already says pitch and camera: "
            "give either a sensor file or --pitch-mm and --hfov-deg"
        )
    source, text = _opened(input, fps, _sized(camera, given))
    if progress is not None and isinstance(source, ReplaySource) and source.warning is not None:
        progress.say(source.warning)
    if progress is not None and not any(kernels().values()):
        progress.say("compiling, once: this takes some seconds now, and none in later runs")
    try:
        found, first, frames = _met(source, text, given, pitch_mm=pitch_mm, hfov_deg=hfov_deg, roi_px=roi_px)
    except BaseException:
        close(source)
        raise
    chosen = method or default_method(found)
    assumed = [NO_PRETENSION] if _lacks_pretension(found, chosen) else []
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
        pipeline=pipeline_for(chosen, roi_px),
        method=chosen,
        roi_px=roi_px,
    )


def _lacks_pretension(sensor: Sensor, method: str) -> bool:
    """Does `mechanics` have to take a sheet for slack, because its file does not say how it is stretched?"""
    sheet = sensor.sheet
    return (
        method == "mechanics"
        and sheet is not None
        and not sheet.is_assumed
        and sheet.pretension_N_per_mm is None
    )


def close(source: Source) -> None:
    """Let go of the source's device, where it has one."""
    if isinstance(source, Device):
        source.close()


def _met(
    source: Source,
    text: str,
    given: Sensor | None,
    *,
    pitch_mm: Pitch | None,
    hfov_deg: float | None,
    roi_px: Roi | None,
) -> tuple[Sensor, tuple[Frame, ...], Iterator[Frame]]:
    """The sensor as the first frames show it, these, and the frames after them."""
    check_region(source, text, roi_px)
    if given is not None:
        _check_fit(source, text, given)
    if isinstance(source, Device):
        source.is_colour = True  # for the first frames, which tell whether colour is needed
    frames = iter(source)
    first = tuple(islice(frames, REST_FRAMES))
    if not first:
        raise SourceError(f"{text} holds no frame; give a video or pictures that show the dotted sheet")
    own = getattr(source, "sensor", None)
    if given is not None:
        found = register_rest(given, first, roi_px=roi_px)
    elif own is not None:
        found = own
    else:
        found = sensor_from_rest(first, name=source.name, pitch_mm=pitch_mm, hfov_deg=hfov_deg, roi_px=roi_px)
    if isinstance(source, Device):
        source.is_colour = found.layout is not None and found.layout.colour_weights is not None
    return found, first, frames


def _sized(camera: CameraRequest | None, sensor: Sensor | None) -> CameraRequest:
    """The wishes, with the size of the sensor's camera where no size was asked for."""
    wishes = CameraRequest() if camera is None else camera
    if sensor is None or wishes.size_px is not None:
        return wishes
    return replace(wishes, size_px=(sensor.camera.width_px, sensor.camera.height_px))


def _opened(given: str | Path | Source, fps: float | None, camera: CameraRequest) -> tuple[Source, str]:
    """A source and what to call it."""
    if isinstance(given, str | Path):
        return open_source(str(given), fps=fps, camera=camera), without_password(str(given))
    return given, given.name


def check_region(source: Source, text: str, roi_px: Roi | None) -> None:
    """Refuse a region that does not lie inside the images.

    Raises:
        SourceError: it does not.
    """
    if roi_px is not None and source.width_px is not None and source.height_px is not None:
        roi_px.require_inside(source.width_px, source.height_px, text)


def _check_fit(source: Source, text: str, sensor: Sensor) -> None:
    camera = sensor.camera
    if (camera.width_px, camera.height_px) != (source.width_px, source.height_px):
        raise SensorError(
            f"the sensor {sensor.name!r} is for images of {camera.width_px} x {camera.height_px} px, but "
            f"{text} has {source.width_px} x {source.height_px} px; give this camera's sensor file, or none"
        )
