"""Every frame of an input into the files of a folder."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from manytouch.errors import OutputError
from manytouch.pipeline import Sink
from manytouch.session.prepare import Job, Observer, Pitch, prepare
from manytouch.sinks.files.atomic_output import output_errors, remove, temporary_path
from manytouch.sinks.files.summary import Summary
from manytouch.sinks.files.surface_store import SurfaceStore, require_zarr
from manytouch.sinks.files.tables import ContactTable, FrameTable, MarkerTable
from manytouch.sinks.pictures.annotate import AnnotatedPictures
from manytouch.sources import Source
from manytouch.sources.files.images import ImagesSource
from manytouch.sources.files.video import VideoSource
from manytouch.values import Roi, Sensor

RESULTS = (
    *("contacts.csv", "markers.parquet", "frames.csv", "summary.json"),
    *("surface.zarr", "annotated.mp4", "annotated"),
)
CHOSEN = "picture-[0-9][0-9][0-9][0-9][0-9][0-9]*.png"


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
    progress: Observer | None = None,
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
    progress: Observer | None = None,
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
    files, summary = files_in(folder, job, surface=surface, annotate=annotate)
    read_all(job, [*files, *sinks, summary], progress=progress, stop=stop)
    return summary


def files_in(
    folder: Path, job: Job, *, surface: bool = False, annotate: bool = False
) -> tuple[list[Sink], Summary]:
    """Sinks for the files of a folder, and the one that sums up, which is to come last.

    Results of an earlier run in the folder are removed.

    Raises:
        OutputError: the folder cannot be written, or what is read lies in it.
        MissingExtraError: `surface` needs a package that is not installed.
    """
    if surface:
        require_zarr()
    _check_apart(folder, job.source)
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
        files.append(SurfaceStore(folder, job.sensor))
    if annotate:
        files.append(AnnotatedPictures(folder, job.sensor, as_video=job.is_video, fps=job.source.fps))
    return files, summary


def read_all(
    job: Job,
    sinks: Sequence[Sink],
    *,
    progress: Observer | None = None,
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


def _check_apart(folder: Path, source: Source) -> None:
    """Results replace those of an earlier run, so that what is read must be none of them."""
    read: Sequence[Path] = ()
    if isinstance(source, ImagesSource):
        read = source.paths
    elif isinstance(source, VideoSource):
        read = [source.path]
    for path in read:
        place = folder / path.name
        if (path.match(CHOSEN) or path.name in RESULTS) and place.exists() and path.samefile(place):
            raise OutputError(
                f"the results would go into {folder} and replace {path.name}, which is read: choose another "
                "folder for them"
            )


def _clear(folder: Path) -> None:
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for left in folder.glob(CHOSEN):
            left.unlink()
        for name in RESULTS:
            remove(folder / name)
            remove(temporary_path(folder / name))
