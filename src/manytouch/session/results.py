"""Every frame of an input into the files of a result folder."""

from collections.abc import Sequence
from pathlib import Path

from manytouch.errors import OutputError, SourceError
from manytouch.pipeline import Sink
from manytouch.session.prepare import Job, Pitch, prepare
from manytouch.session.run import Observer, StopCondition, run
from manytouch.sinks.files.atomic_output import output_errors, remove, temporary_path
from manytouch.sinks.files.summary import Summary
from manytouch.sinks.files.surface_store import SurfaceStore, require_zarr
from manytouch.sinks.files.tables import ContactTable, FrameTable, MarkerTable
from manytouch.sinks.pictures.annotate import AnnotatedPictures
from manytouch.sources import Source
from manytouch.sources.cameras.camera import without_password
from manytouch.sources.opening import is_camera
from manytouch.values import Roi, Sensor

RESULTS = (
    *("contacts.csv", "markers.parquet", "frames.csv", "summary.json"),
    *("surface.zarr", "annotated.mp4", "annotated"),
)
PICTURES = "picture-[0-9][0-9][0-9][0-9][0-9][0-9]*.png"


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
    observer: Observer | None = None,
    stop: StopCondition | None = None,
) -> Path:
    """Process every frame of an input and write its tables.

    Args:
        input: a video file, an image, a folder of images, a recording, or `sim:`.
        out: the results go into a folder in it that has the input's name.
        sensor, method, pitch_mm, hfov_deg, roi_px, fps: see `prepare`.
        surface, annotate, observer, stop: see `process_job`.

    Returns:
        The folder of the results.

    Raises:
        ManytouchError: see `prepare`.
        OutputError: the results cannot be written.
    """
    job = prepare(
        input,
        sensor=sensor,
        method=method,
        pitch_mm=pitch_mm,
        hfov_deg=hfov_deg,
        roi_px=roi_px,
        fps=fps,
        observer=observer,
    )
    folder = Path(out) / result_name(str(input))
    process_job(job, folder, surface=surface, annotate=annotate, observer=observer, stop=stop)
    return folder


def process_job(
    job: Job,
    folder: Path,
    *,
    surface: bool = False,
    annotate: bool = False,
    sinks: Sequence[Sink] = (),
    observer: Observer | None = None,
    stop: StopCondition | None = None,
) -> Summary:
    """Process all frames of a job into the files of a folder.

    Whatever ends the run, the files are complete for the frames processed so far. Results of an earlier run
    in the same folder are removed first, so that all files there belong to one run.

    Args:
        job: from `prepare`.
        folder: where the results go.
        surface: write surface.zarr too (needs the extra `surface`).
        annotate: draw an annotated video, or annotated images when the input is images.
        sinks: others that get every reading; they are closed too.
        observer, stop: see `run`.

    Raises:
        OutputError: a result cannot be written.
        MissingExtraError: `surface` needs a package that is not installed.
    """
    files, summary = result_sinks(folder, job, surface=surface, annotate=annotate)
    run(job, [*files, *sinks, summary], observer, stop)
    return summary


def result_sinks(
    folder: Path, job: Job, *, surface: bool = False, annotate: bool = False
) -> tuple[list[Sink], Summary]:
    """Create the sinks for the files of a folder, and the summary, which is to be the last sink.

    Results of an earlier run in the folder are removed.

    Raises:
        OutputError: the folder cannot be written, or the input is in it.
        MissingExtraError: `surface` needs a package that is not installed.
    """
    if surface:
        require_zarr()
    _require_apart(folder, job.source)
    _clear(folder)
    summary = Summary(
        folder, sensor=job.sensor, pipeline=job.pipeline, method=job.method, recording=job.input_info
    )
    files: list[Sink] = [
        ContactTable(folder, job.sensor),
        MarkerTable(folder, job.sensor),
        FrameTable(folder),
    ]
    if surface:
        files.append(SurfaceStore(folder, job.sensor))
    if annotate:
        is_video = not job.source.capabilities.is_images
        files.append(AnnotatedPictures(folder, job.sensor, as_video=is_video, fps=job.source.fps))
    return files, summary


def result_name(text: str) -> str:
    """Name of the folder for an input's results: its stem, without what a file name cannot contain."""
    if text.startswith("sim:"):
        scene = text.removeprefix("sim:")
        return f"sim-{Path(scene).stem}" if scene else "sim"
    path = Path(text).resolve()
    name = path.name if path.is_dir() else path.stem
    return name or "input"


def result_names(inputs: Sequence[str]) -> list[str]:
    """One folder name per input: its stem, or stem-2, stem-3 if it is taken (a, b, a: a, b, a-2)."""
    taken: set[str] = set()
    names = []
    for text in inputs:
        stem = result_name(text)
        name, number = stem, 1
        while name.casefold() in taken:
            number += 1
            name = f"{stem}-{number}"
        taken.add(name.casefold())
        names.append(name)
    return names


def require_finite(text: str) -> None:
    """Check that an input has an end.

    Raises:
        SourceError: it is a camera or a stream.
    """
    if is_camera(text):
        raise SourceError(
            f"{without_password(text)!r} is a camera or a stream, which has no end: use manytouch run, and "
            "--record to process the recording later"
        )


def _require_apart(folder: Path, source: Source) -> None:
    """Results replace those of an earlier run, so that no file of the input may be one of them."""
    for path in source.capabilities.files:
        place = folder / path.name
        if (path.match(PICTURES) or path.name in RESULTS) and place.exists() and path.samefile(place):
            raise OutputError(
                f"the results would go into {folder} and replace {path.name}, which is the input: choose "
                "another folder for them"
            )


def _clear(folder: Path) -> None:
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for left in folder.glob(PICTURES):
            left.unlink()
        for name in RESULTS:
            remove(folder / name)
            remove(temporary_path(folder / name))
