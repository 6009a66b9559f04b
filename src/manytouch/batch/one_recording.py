"""One recording of a batch, in a worker: compared with its result, computed, stored."""

import tempfile
import time
import traceback
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import manytouch
from manytouch.batch.completion import parse_summary, why_changed, why_not_complete
from manytouch.batch.remote_files import download, is_remote, remote_stamp
from manytouch.batch.settings import Settings, request_of
from manytouch.batch.storage import SUMMARY, LocalStore, RemoteStore, Store, store_at
from manytouch.batch.tasks import Outcome, Task, TaskState
from manytouch.errors import ManytouchError, OutputError, SourceError, without_password
from manytouch.session import ResultFiles, prepare, request_hashes, run
from manytouch.session.prepare import Job
from manytouch.session.result_hashes import files_stamp
from manytouch.session.results import require_finite
from manytouch.session.run import StopCondition
from manytouch.sinks.files.folder_lock import FolderInUseError
from manytouch.sources import open_source
from manytouch.sources.source import close


def process_recording(settings: Settings, task: Task, stop: StopCondition | None = None) -> Outcome:
    """Bring one result up to date.

    Args:
        settings: of the batch.
        task: the recording.
        stop: once it returns True, the recording is given up, and its earlier result stays.

    Returns:
        What became of it; a failure of any kind is an outcome too.
    """
    begun_s = time.monotonic()
    try:
        _require_version(settings.version)
        outcome = _processed(settings, task, stop)
    except FolderInUseError as error:
        outcome = Outcome(task=task, state=TaskState.BUSY, reason=str(error))
    except ManytouchError as error:
        outcome = Outcome(
            task=task, state=TaskState.FAILED, reason=str(error), traceback=traceback.format_exc()
        )
    except Exception as error:  # noqa: BLE001 - one bad recording must not stop the batch
        outcome = Outcome(
            task=task,
            state=TaskState.FAILED,
            reason=_vanished(task) if _is_gone(task) else f"internal error: {type(error).__name__}: {error}",
            traceback=traceback.format_exc(),
        )
    return replace(
        outcome,
        reason=without_password(outcome.reason),
        traceback=without_password(outcome.traceback),
        seconds=time.monotonic() - begun_s,
    )


def _is_gone(task: Task) -> bool:
    return not is_remote(task.input) and not Path(task.input).exists()


def _vanished(task: Task) -> str:
    return (
        f"{task.input} changed or vanished while it was processed: run the same command again when it is "
        "complete"
    )


def _require_version(version: str) -> None:
    if version != manytouch.__version__:
        raise ManytouchError(
            f"this worker has manytouch {manytouch.__version__}, the batch {version}: install the same "
            "version on both"
        )


def stamp_of(text: str) -> str | None:
    """What changes when an input changes, without reading it; None where it cannot be known.

    Raises:
        SourceError: a server refuses it.
    """
    try:
        return remote_stamp(text) if is_remote(text) else files_stamp(text)
    except FileNotFoundError:
        raise SourceError(f"there is no {text}: check the address") from None


def _processed(settings: Settings, task: Task, stop: StopCondition | None) -> Outcome:
    store, text = store_at(settings.out), task.input
    with ExitStack() as closing:
        stamp = stamp_of(text)
        if is_remote(text):
            folder = closing.enter_context(tempfile.TemporaryDirectory(prefix="manytouch-"))
            local = str(download(text, Path(folder)))
        else:
            require_finite(text)
            local = text
        summary = parse_summary(store.read(f"{task.name}/{SUMMARY}"))
        reason = why_not_complete(store, task.name, settings, summary)
        if reason is None and summary is not None:
            reason = _why_changed(settings, summary, local, text)
        if reason is None:
            return Outcome(task=task, state=TaskState.CURRENT)
        job = replace(_prepared(settings, local), text=without_password(text), files_stamp=stamp)
        frames = _written(job, store, task, settings, stop)
    return Outcome(task=task, state=TaskState.COMPUTED, reason=reason, frames=frames)


def _why_changed(settings: Settings, summary: Mapping[str, Any], local: str, text: str) -> str | None:
    source = open_source(local, fps=settings.fps)
    try:
        hashes = request_hashes(source, text, request_of(settings))
    finally:
        close(source)
    return why_changed(summary, hashes, without_password(text))


def _prepared(settings: Settings, local: str) -> Job:
    request = request_of(settings)
    return prepare(
        local,
        sensor=request.sensor,
        method=request.method,
        pitch_mm=request.pitch_mm,
        hfov_deg=request.hfov_deg,
        roi_px=request.roi_px,
        fps=request.fps,
        parameters=request.parameters,
        whole_recording=True,
    )


def _written(job: Job, store: Store, task: Task, settings: Settings, stop: StopCondition | None) -> int:
    """Process all frames and put the result in its place; the number of frames."""
    if isinstance(store, LocalStore):
        return _written_to(store.path / task.name, job, task, settings, stop)
    assert isinstance(store, RemoteStore)
    with tempfile.TemporaryDirectory(prefix="manytouch-") as folder:
        local = Path(folder) / task.name
        frames = _written_to(local, job, task, settings, stop)
        store.upload(local, task.name)
    return frames


def _written_to(folder: Path, job: Job, task: Task, settings: Settings, stop: StopCondition | None) -> int:
    with ResultFiles(folder, job, surface=settings.surface, annotate=settings.annotate) as files:
        try:
            is_whole = run(job, files.sinks, stop=stop)
        except Exception as error:
            if job.files_stamp != stamp_of(task.input):
                raise OutputError(_vanished(task)) from error
            raise
        if not is_whole:
            raise OutputError(f"{task.input} was stopped: run the same command again")
        if job.files_stamp != stamp_of(task.input):
            raise OutputError(_vanished(task))
        files.is_complete = True
    return files.summary.frames
