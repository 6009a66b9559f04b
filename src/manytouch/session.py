"""A source, a pipeline and its sinks, put together and run.

    from manytouch import process
    folder = process("video.mp4", out="out/video")

`prepare` opens the input and finds or fits its sensor; `process` reads every frame of it into tables.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from manytouch.calibration import refer, sensor_from_rest
from manytouch.detection import DotSearch
from manytouch.detection.paper import PaperDetection
from manytouch.errors import ManytouchError, SensorError, SourceError
from manytouch.estimation import PerimeterDepth
from manytouch.estimation.paper import PaperEstimate
from manytouch.pipeline import Pipeline, Sink
from manytouch.sinks.annotate import AnnotatedPictures
from manytouch.sinks.staging import aside, remove, told
from manytouch.sinks.summary import Summary
from manytouch.sinks.surface import SurfaceMap, require_zarr
from manytouch.sinks.tables import ContactTable, FrameTable, MarkerTable
from manytouch.sources import Source, open_source
from manytouch.sources.images import ImagesSource
from manytouch.tracking import FollowGrid
from manytouch.tracking.paper import PaperTracking
from manytouch.values import Frame, Reading, Sensor
from manytouch.values.sensor_file import load_sensor

METHODS = ("perimeter", "paper")
REST_FRAMES = 15
RESULTS = (
    *("contacts.csv", "markers.parquet", "frames.csv", "summary.json"),
    *("surface.zarr", "annotated.mp4", "annotated"),
)

Roi = tuple[int, int, int, int]
Pitch = float | tuple[float, float]


@runtime_checkable
class Watch(Protocol):
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
        frames: all frames, in order; can be gone through once.
        samples: the first two frames, to warm up with.
        sensor: found in the first frames, fitted to them, or the source's own.
        pipeline, method: what reads the frames.
    """

    text: str
    source: Source
    frames: Iterator[Frame]
    samples: tuple[Frame, ...]
    sensor: Sensor
    pipeline: Pipeline
    method: str

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
        """Read two frames for nothing, so that compiling and first touches are in no frame's time."""
        for _ in self.pipeline.run(self.samples, self.sensor):
            pass

    def readings(self) -> Iterator[Reading]:
        """Every frame, read, in order. To be called once."""
        return self.pipeline.run(self.frames, self.sensor)


def kernels() -> dict[str, bool]:
    """The compiled functions in use by name, and whether the disk holds machine code of each."""
    found = {}
    for module in [module for name, module in sys.modules.items() if name.startswith("manytouch.")]:
        for value in vars(module).values():
            path = getattr(getattr(value, "stats", None), "cache_path", None)
            if path is not None:
                function = value.py_func
                pattern = f"{Path(function.__code__.co_filename).stem}.{function.__qualname__}-*.nbi"
                found[f"{function.__module__}.{function.__qualname__}"] = any(Path(path).glob(pattern))
    return found


def pipeline_for(method: str | None = None, roi_px: Roi | None = None) -> Pipeline:
    """The stages of a method.

    Args:
        method: one of `METHODS`; None takes the best that there is.
        roi_px: x, y, width, height of the part of the image to look at, or None.

    Raises:
        ManytouchError: there is no such method.
    """
    match method or METHODS[0]:
        case "perimeter":
            return Pipeline(
                detect=DotSearch(roi_px=roi_px), track=FollowGrid(roi_px=roi_px), estimate=PerimeterDepth()
            )
        case "paper":
            return Pipeline(
                detect=PaperDetection(roi_px=roi_px), track=PaperTracking(), estimate=PaperEstimate()
            )
    raise ManytouchError(f"there is no method {method!r}; there are: {', '.join(METHODS)}")


def prepare(
    input: str | Path | Source,  # noqa: A002 - the word of the command line
    *,
    sensor: str | Path | Sensor | None = None,
    method: str | None = None,
    pitch_mm: Pitch | None = None,
    hfov_deg: float | None = None,
    roi_px: Roi | None = None,
    fps: float | None = None,
    progress: Watch | None = None,
) -> Job:
    """Open an input and know its sensor.

    Args:
        input: a source, or what `open_source` takes.
        sensor: a sensor, or its file; None takes the source's own, or finds the layout in the first frames.
        method: one of `METHODS`.
        pitch_mm: distance of neighbouring markers, one number or (x, y); None leaves lengths in pitches.
        hfov_deg: horizontal field of view of the camera; None assumes 60 degrees.
        roi_px: x, y, width, height of the part of the image to look at.
        fps: frame rate to use instead of the source's own.
        progress: told when something takes long.

    Raises:
        SourceError: the input cannot be opened, or the region lies outside its image.
        SensorError: the sensor's file is wrong or does not fit the input.
        LayoutError: the first frames show no usable arrangement of dots.
        ManytouchError: there is no such method.
    """
    pipeline = pipeline_for(method, roi_px)
    given = load_sensor(sensor) if isinstance(sensor, str | Path) else sensor
    if given is not None and (pitch_mm is not None or hfov_deg is not None):
        raise SensorError(
            f"the sensor {given.name!r} already says pitch and camera: "
            "give either a sensor file or --pitch-mm and --hfov-deg"
        )
    source, text = _opened(input, fps)
    if progress is not None and not any(kernels().values()):
        progress.say("compiling, once: this takes some seconds now, and none in later runs")
    check_region(source, text, roi_px)
    if given is not None:
        _check_fit(source, text, given)
    frames = iter(source)
    first = tuple(islice(frames, REST_FRAMES))
    if not first:
        raise SourceError(f"{text} holds no frame; give a video or pictures that show the dotted sheet")
    own = getattr(source, "sensor", None)
    if given is not None:
        found = refer(given, first, roi_px=roi_px)
    elif own is not None:
        found = own
    else:
        found = sensor_from_rest(first, name=source.name, pitch_mm=pitch_mm, hfov_deg=hfov_deg, roi_px=roi_px)
    return Job(
        text=text,
        source=source,
        frames=chain(first, frames),
        samples=first[:2],
        sensor=found,
        pipeline=pipeline,
        method=method or METHODS[0],
    )


def process(
    input: str | Path,  # noqa: A002 - the word of the command line
    *,
    out: str | Path,
    sensor: str | Path | Sensor | None = None,
    method: str | None = None,
    surface: bool = False,
    annotate: bool = False,
    pitch_mm: Pitch | None = None,
    hfov_deg: float | None = None,
    roi_px: Roi | None = None,
    fps: float | None = None,
    progress: Watch | None = None,
    stop: Callable[[], bool] | None = None,
) -> Path:
    """Read every frame of an input and write its tables.

    Args:
        input: a video file, an image, a folder of images, or `sim:`.
        out: the results go into a folder in it that has the input's name.
        sensor, method, pitch_mm, hfov_deg, roi_px, fps: see `prepare`.
        surface, annotate, progress, stop: see `read_into`.

    Returns:
        The folder of the results.

    Raises:
        ManytouchError: see `prepare`; OutputError when the results cannot be written.
    """
    job = prepare(
        input,
        sensor=sensor,
        method=method,
        pitch_mm=pitch_mm,
        hfov_deg=hfov_deg,
        roi_px=roi_px,
        fps=fps,
        progress=progress,
    )
    folder = Path(out) / result_name(str(input))
    read_into(job, folder, surface=surface, annotate=annotate, progress=progress, stop=stop)
    return folder


def read_into(
    job: Job,
    folder: Path,
    *,
    surface: bool = False,
    annotate: bool = False,
    sinks: Sequence[Sink] = (),
    progress: Watch | None = None,
    stop: Callable[[], bool] | None = None,
) -> Summary:
    """Read all frames of a job into the files of a folder.

    Whatever ends the run, the files are complete for the frames read so far. Results of an earlier
    run in the same folder are removed first, so that all files there belong to one run.

    Args:
        job: from `prepare`.
        folder: where the results go.
        surface: write surface.zarr too (needs the extra `surface`).
        annotate: draw an annotated video, or pictures when the input is pictures.
        sinks: others that shall see every reading; they are closed too.
        progress, stop: see `read_all`.

    Raises:
        OutputError: a result cannot be written.
        MissingExtraError: `surface` needs a package that is not installed.
    """
    if surface:
        require_zarr()
    _clear(folder)
    summary = Summary(
        folder, sensor=job.sensor, pipeline=job.pipeline, method=job.method, recording=job.recording
    )
    files: list[Sink] = [
        ContactTable(folder, job.sensor),
        MarkerTable(folder, job.sensor),
        FrameTable(folder),
    ]
    if surface:
        files.append(SurfaceMap(folder, job.sensor))
    if annotate:
        files.append(AnnotatedPictures(folder, job.sensor, as_video=job.is_video, fps=job.source.fps))
    read_all(job, [*files, *sinks, summary], progress=progress, stop=stop)
    return summary


def read_all(
    job: Job,
    sinks: Sequence[Sink],
    *,
    progress: Watch | None = None,
    stop: Callable[[], bool] | None = None,
) -> None:
    """Read all frames of a job into sinks, and close them whatever happens.

    Args:
        job: from `prepare`.
        sinks: shall see every reading, in this order; they are closed in the same order.
        progress: told what happens.
        stop: asked after each frame; once it says True the run ends.
    """
    with ExitStack() as closing:
        for sink in reversed(sinks):
            closing.callback(sink.close)
        if progress is not None:
            progress.begin(job)
        job.warm_up()
        for reading in job.readings():
            for sink in sinks:
                sink.write(reading)
            if progress is not None:
                progress.read(reading)
            if stop is not None and stop():
                break


def result_name(text: str) -> str:
    """Name of the folder for an input's results: its stem, without what a file name cannot hold."""
    if text.startswith("sim:"):
        scene = text.removeprefix("sim:")
        return f"sim-{Path(scene).stem}" if scene else "sim"
    path = Path(text).resolve()
    name = path.name if path.is_dir() else path.stem
    return name or "input"


def _clear(folder: Path) -> None:
    with told(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in RESULTS:
            remove(folder / name)
            remove(aside(folder / name))


def _opened(given: str | Path | Source, fps: float | None) -> tuple[Source, str]:
    """A source and what to call it."""
    if isinstance(given, str | Path):
        return open_source(str(given), fps=fps), str(given)
    return given, given.name


def check_region(source: Source, text: str, roi_px: Roi | None) -> None:
    """Refuse a region that does not lie inside the images.

    Raises:
        SourceError: it does not.
    """
    if roi_px is None or source.width_px is None or source.height_px is None:
        return
    x, y, width, height = roi_px
    right, bottom = x + width, y + height
    if min(x, y) < 0 or min(width, height) < 1 or right > source.width_px or bottom > source.height_px:
        raise SourceError(
            f"the region {x},{y},{width},{height} (x,y,width,height) does not lie inside the image of "
            f"{text}, which has {source.width_px} x {source.height_px} px; give one that does, or none"
        )


def _check_fit(source: Source, text: str, sensor: Sensor) -> None:
    camera = sensor.camera
    if (camera.width_px, camera.height_px) != (source.width_px, source.height_px):
        raise SensorError(
            f"the sensor {sensor.name!r} is for images of {camera.width_px} x {camera.height_px} px, but "
            f"{text} has {source.width_px} x {source.height_px} px; give this camera's sensor file, or none"
        )
