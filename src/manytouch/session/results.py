"""Every frame of an input into the files of a result folder."""

import hashlib
import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from manytouch.errors import OutputError, SourceError, require_type, without_password
from manytouch.pipeline import Sink
from manytouch.session.methods import ParameterValue
from manytouch.session.prepare import Job, prepare
from manytouch.session.result_hashes import Pitch, files_stamp, request_hash, request_hashes, result_stamp
from manytouch.session.run import Observer, StopCondition, run
from manytouch.sinks.files.regions import RegionTable
from manytouch.sinks.files.result_folder import (
    NearlyFullError,
    ResultFolder,
    RoomCheck,
    folder_bytes,
    is_disk_full,
)
from manytouch.sinks.files.summary import Summary
from manytouch.sinks.files.surface_store import SurfaceStore, require_zarr
from manytouch.sinks.files.tables import ContactList, ContactTable, FrameTable, MarkerTable
from manytouch.sinks.pictures.annotate import AnnotatedPictures
from manytouch.sinks.pictures.surface_picture import SelectedFrames
from manytouch.source_names import VIEWS_PREFIX, is_camera, split_topic, views_of
from manytouch.sources import Source
from manytouch.sources.files.images import late_images
from manytouch.values import Roi, Sensor

RESULTS = (
    *("contacts.csv", "contact_list.csv", "regions.parquet", "markers.parquet", "frames.csv", "summary.json"),
    *("surface.zarr", "annotated.mp4", "annotated", "picture.png"),
    "picture-[0-9][0-9][0-9][0-9][0-9][0-9]*.png",
)
"""Names of all results, as patterns; what else is in a result folder belongs to the user and is kept."""

VIDEO_SHARE = 2.3
"""Bit rate of annotated.mp4 over that of its source at most, so that no file is three times as large."""


def process(
    input: str | Path | Source,  # noqa: A002 - the word of the command line
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
    parameters: Mapping[str, ParameterValue] | None = None,
    observer: Observer | None = None,
    stop: StopCondition | None = None,
) -> Path:
    """Process every frame of an input and write its tables.

    Args:
        input: a video file, an image, a folder of images, a recording, `sim:`, or an open source.
        out: the results go into a folder in it that has the input's name.
        sensor, method, pitch_mm, hfov_deg, roi_px, fps, parameters: see `prepare`.
        surface, annotate, observer, stop: see `process_job`.

    Returns:
        The folder of the results.

    Raises:
        ManytouchError: see `prepare`.
        OutputError: the results cannot be written.
    """
    require_type("out", out, (str, Path), "the path of a folder")
    job = prepare(
        input,
        sensor=sensor,
        method=method,
        pitch_mm=pitch_mm,
        hfov_deg=hfov_deg,
        roi_px=roi_px,
        fps=fps,
        parameters=parameters,
        whole_recording=True,
        observer=observer,
    )
    folder = Path(out) / (_file_name(input.name) if isinstance(input, Source) else result_name(str(input)))
    process_job(job, folder, surface=surface, annotate=annotate, observer=observer, stop=stop)
    return folder


def process_job(
    job: Job,
    folder: Path,
    *,
    surface: bool = False,
    annotate: bool = False,
    pictures: Collection[int] = (),
    sinks: Sequence[Sink] = (),
    observer: Observer | None = None,
    stop: StopCondition | None = None,
) -> "ResultFiles":
    """Process all frames of a job into a folder, which replaces that of an earlier run at the end.

    Args:
        job: from `prepare`.
        folder: where the results go.
        surface, annotate, pictures: see `ResultFiles`.
        sinks: others that get every reading; they are closed too.
        observer, stop: see `run`.

    Raises:
        OutputError: a result cannot be written; nothing is changed then.
        MissingExtraError: a result needs a package that is not installed.
    """
    with ResultFiles(folder, job, surface=surface, annotate=annotate, pictures=pictures) as files:
        files.is_complete = run(job, [*files.sinks, *sinks], observer, stop)
    return files


class ResultFiles:
    """The files of a result folder; they replace those of an earlier run at the end of its block.

    An error of writing, or one before the first reading, leaves the earlier folder as it was. Any other one,
    also `KeyboardInterrupt`, keeps what was computed; summary.json then contains `"complete": false`. What is
    not repeatable, a session, ends with such an error before its disk is full.

    Attributes:
        folder: the final folder; the files are in its `partial_path` until the end of the block.
        sinks: they get every reading.
        summary: counts and warnings; one of the sinks.
        contact_list: a line per contact; one of the sinks.
        pictures: draws single frames, if any were requested; one of the sinks.
        is_complete: to be set when all frames of the input have been processed.
        is_repeatable: to be set to whether the results depend on input and job alone; summary.json has no
            hash where commands have changed them.
    """

    def __init__(
        self,
        folder: Path,
        job: Job,
        *,
        surface: bool = False,
        annotate: bool = False,
        pictures: Collection[int] = (),
        is_repeatable: bool = True,
        warnings: Callable[[], Sequence[str]] = tuple,
    ) -> None:
        """Lock the folder and create the sinks for its files.

        Args:
            folder: where the results go.
            job: what is processed.
            surface: write surface.zarr too (extra `lab`).
            annotate: draw an annotated video, or annotated images when the input is images.
            pictures: numbers of the frames whose surface is drawn (extra `lab`).
            is_repeatable: see the attribute; False for a session until it has ended.
            warnings: called at the end, for warnings of the session that summary.json shall contain.

        Raises:
            OutputError: the folder cannot be written, is being written, or a file of the input would be
                replaced.
            MissingExtraError: a result needs a package that is not installed.
        """
        if surface:
            require_zarr()
        _require_apart(folder, job.source)
        self.is_complete = False
        self._job = job
        self.is_repeatable, self._session_warnings = is_repeatable, warnings
        self._is_session = not is_repeatable
        self.stamp = result_stamp(job.files_stamp or files_stamp(job.text), request_hash(job.request))
        self.hashes = dict(request_hashes(job.source, job.text, job.request))
        self.summary = Summary(
            sensor=job.sensor,
            pipeline=job.pipeline,
            method=job.method,
            recording=job.input_info,
            roi_px=job.roi_px,
        )
        self.folder = ResultFolder(folder, RESULTS)
        partial, sensor = self.folder.partial_path, job.sensor
        self.sinks: list[Sink] = []
        try:
            room = None if is_repeatable else RoomCheck(self.folder)
            self.pictures = SelectedFrames(partial, sensor, pictures) if pictures else None
            self.sinks.append(ContactTable(partial, sensor))
            self.sinks.append(RegionTable(partial, sensor))
            self.sinks.append(MarkerTable(partial, sensor))
            self.sinks.append(FrameTable(partial, job.method))
            self.contact_list = ContactList(partial, sensor)
            self.sinks.append(self.contact_list)
            if surface:
                self.sinks.append(SurfaceStore(partial, sensor))
            if annotate:
                is_video = not job.source.capabilities.is_images
                self.sinks.append(
                    AnnotatedPictures(
                        partial,
                        sensor,
                        as_video=is_video,
                        fps=job.source.fps,
                        most_bits_per_s=_video_limit(job.source),
                    )
                )
            if self.pictures is not None:
                self.sinks.append(self.pictures)
        except BaseException as error:
            self._close_sinks()
            self.folder.close()
            raise (self._with_space(error) if isinstance(error, OutputError) else error) from error
        self.sinks.append(self.summary)
        if room is not None:
            self.sinks.append(room)

    def __enter__(self) -> "ResultFiles":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self.folder:
            if error is not None and self._is_of_writing(error):
                self._close_sinks()
                raise self._with_space(error) from error
            if error is not None and self.summary.frames == 0:
                self._close_sinks()
                return
            try:
                for sink in self.sinks:
                    sink.close()  # again, or for the first time if the run has not begun
                self.summary.add_warnings([*self._session_warnings(), *late_images(self._job.source)])
                self.summary.save(
                    self.folder.partial_path,
                    is_complete=self.is_complete and error is None,
                    hashes=self.hashes if self.is_repeatable else {**self.hashes, "input": None},
                    stamp=self.stamp if self.is_repeatable else None,
                )
                self.folder.commit()
            except OutputError as failed:
                self._close_sinks()
                raise self._with_space(failed) from failed

    def _is_of_writing(self, error: BaseException) -> bool:
        """Whether a result could not be written.

        An error of a full disk that names no result may come from standard output; then the results of a
        session are kept if they can be completed.
        """
        if isinstance(error, OutputError):
            return not isinstance(error, NearlyFullError)
        return not self._is_session and is_disk_full(error)

    def _close_sinks(self) -> None:
        """Release the files, which are removed."""
        for sink in self.sinks:
            with suppress(Exception):
                sink.close()

    def _with_space(self, error: BaseException) -> BaseException:
        """The error; if the disk is full, with an estimate of the space that all results need."""
        if not is_disk_full(error):
            return error
        written, frames = folder_bytes(self.folder.partial_path), self.summary.frames
        total = self._job.frame_count
        needed = f"more than {_size_text(self.folder.free_bytes)} are needed"
        if frames and total:
            estimate = written * max(total, frames) // frames
            needed = f"about {_size_text(estimate)} are needed (by the first {frames} of {total} frames)"
        return OutputError(
            f"cannot write {self.folder.path}: the disk is full; {needed}, and "
            f"{_size_text(self.folder.free_bytes)} were free: free some space, or choose another disk; "
            "nothing was written"
        )


LONGEST_NAME = 100


def result_name(text: str) -> str:
    """Name of the folder for an input's results: its stem, or of a stream its address.

    An address lacks user, password and query, which may contain a password too; streams that differ in the
    query differ in its hash.
    """
    if "://" in text:
        address, query = without_password(text).partition("://")[2].partition("?")[0], text.partition("?")[2]
        which = f"-{hashlib.sha256(query.encode()).hexdigest()[:8]}" if query else ""
        return _file_name(f"stream-{address.partition('#')[0].strip('/')}")[:LONGEST_NAME] + which
    if text.startswith("sim:"):
        scene = text.removeprefix("sim:")
        return f"sim-{Path(scene).stem}" if scene else "sim"
    if text.startswith(VIEWS_PREFIX):
        return "-".join(result_name(part) for part in views_of(text))[:LONGEST_NAME]
    bare, topic = split_topic(text)
    path = Path(os.path.abspath(bare))  # noqa: PTH100 - the name of a link, not that of its target
    name = path.name if path.is_dir() else path.stem
    if name.strip(".") == "":
        name = "input"  # the stem of "...png" is the folder above
    return name if topic is None or topic.startswith("/") else f"{name}-{topic}"  # a sensor of a rig


def _file_name(name: str) -> str:
    """A name without what file names cannot contain on some system."""
    return re.sub(r'[\x00-\x1f\\/:*?"<>|]+', "-", name).strip(" .") or "input"


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
        is_result = any(Path(path.name).match(pattern) for pattern in RESULTS)
        if is_result and place.exists() and path.samefile(place):
            raise OutputError(
                f"the results would go into {folder} and replace {path.name}, which is the input: choose "
                "another folder for them"
            )


def _video_limit(source: Source) -> float | None:
    """Bit rate of an annotated video such that it is not larger than `VIDEO_SHARE` times its source."""
    files, fps, frames = source.capabilities.files, source.fps, source.frame_count
    if len(files) != 1 or not fps or not frames:
        return None
    return VIDEO_SHARE * 8.0 * files[0].stat().st_size * fps / frames


def _size_text(count: int) -> str:
    """A number of bytes as text, such as "1.2 MB"."""
    return f"{count / 1e6:.3g} MB" if count < 1e9 else f"{count / 1e9:.3g} GB"
