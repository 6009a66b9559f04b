"""The loop of a batch: what is missing or changed goes to an engine; then the tables are rebuilt."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol, runtime_checkable

from manytouch.batch.completion import (
    TO_BE_COMPARED,
    is_current,
    parse_summary,
    why_not_complete,
)
from manytouch.batch.failures import merge_failures, shard_file, shards_of, write_failures
from manytouch.batch.one_recording import process_recording, stamp_of
from manytouch.batch.result_tables import merge_result_tables, write_result_tables
from manytouch.batch.settings import Settings
from manytouch.batch.storage import SUMMARY, LocalStore, Store, store_at
from manytouch.batch.tasks import Engine, Outcome, Task, TaskFunction, TaskState
from manytouch.errors import ManytouchError, OutputError
from manytouch.session.run import StopCondition
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.folder_lock import FolderInUseError, FolderLock
from manytouch.values.display.text import count_of

BUSY_POLL_S = 2.0


@runtime_checkable
class BatchObserver(Protocol):
    """An object that is notified of the progress of a batch."""

    def on_message(self, sentence: str) -> None:
        """A sentence for the user."""

    def on_begin(self, count: int) -> None:
        """So many recordings are in the batch."""

    def on_outcome(self, outcome: Outcome) -> None:
        """A recording is done, has failed, or is current already."""


@dataclass(kw_only=True)
class BatchReport:
    """What a batch has done.

    Attributes:
        computed, current: numbers of results.
        failed: by name.
        is_stopped: whether it was ended early.
        complete: complete results in the tables.
    """

    computed: int = 0
    current: int = 0
    failed: dict[str, Outcome] = field(default_factory=dict)
    is_stopped: bool = False
    complete: int = 0

    def add(self, outcome: Outcome) -> None:
        """Count an outcome."""
        self.failed.pop(outcome.task.name, None)
        if outcome.state is TaskState.COMPUTED:
            self.computed += 1
        elif outcome.state is TaskState.CURRENT:
            self.current += 1
        elif outcome.state is TaskState.FAILED:
            self.failed[outcome.task.name] = outcome


def plan(tasks: Iterable[Task], settings: Settings) -> Iterator[Task | Outcome]:
    """Each task with the reason why it has to be processed, or as an outcome where its result is current.

    No input is read: whether one with another size or time has other bytes is decided by the worker.
    """
    store = store_at(settings.out)
    for task in tasks:
        summary = parse_summary(store.read(f"{task.name}/{SUMMARY}"))
        reason = why_not_complete(store, task.name, settings, summary)
        if reason is None and summary is not None:
            try:
                if is_current(summary, stamp_of(task.input), settings):
                    yield Outcome(task=task, state=TaskState.CURRENT)
                    continue
            except ManytouchError:
                pass  # the worker reports it
            reason = TO_BE_COMPARED
        yield replace(task, reason=reason or "")


def run_batch(
    tasks: Sequence[Task],
    settings: Settings,
    engine: Engine,
    *,
    observer: BatchObserver,
    stop: StopCondition,
    shard: tuple[int, int] | None = None,
) -> BatchReport:
    """Bring all results up to date, then failures.csv, results.parquet and contacts.parquet.

    A recording that another batch is processing is waited for.

    Args:
        tasks: the recordings; of this shard only.
        settings: how they are processed.
        engine: what runs them.
        observer: notified of each outcome.
        stop: ends the batch early; what is complete then stays.
        shard: I and N; the tables are then those of the shard.

    Raises:
        OutputError: the tables cannot be written.
        ManytouchError: the engine has failed; the tables contain what is complete.
    """
    report, store = BatchReport(), store_at(settings.out)
    observer.on_begin(len(tasks))
    broken: ManytouchError | None = None
    remaining = list(tasks)
    work = partial(process_recording, settings)
    try:
        while remaining and not stop():
            busy: list[Task] = []
            for outcome in _outcomes(remaining, settings, engine, work, stop):
                if outcome.state is TaskState.BUSY:
                    busy.append(outcome.task)
                    continue
                report.add(outcome)
                observer.on_outcome(outcome)
            remaining = wait_until_free(busy, store, observer, stop)
    except ManytouchError as error:
        broken = error
    report.is_stopped = stop()
    _write_tables(store, tasks, report, shard)
    if broken is not None:
        raise broken
    return report


def merge(out: str) -> int:
    """Join the tables of all shards to one pair, and remove them; the number of shards.

    Raises:
        OutputError: there are none, or one has no counterpart.
    """
    store = store_at(out)
    results, contacts = (shards_of(store.tables(f"{stem}-*"), stem) for stem in ("results", "contacts"))
    if not results or [each.partition("-")[2] for each in results] != [
        each.partition("-")[2] for each in contacts
    ]:
        raise OutputError(
            f"{out} has {len(results)} results-*.parquet and {len(contacts)} contacts-*.parquet, expected "
            "one pair per shard: run the shards first"
        )
    failures = shards_of(store.tables("failures-*"), "failures")
    with _tables_lock(store):
        parts = list(zip(results, contacts, strict=True))
        merge_result_tables(store, parts, "results.parquet", "contacts.parquet")
        merge_failures(store, failures, "failures.csv")
        for name in (*results, *contacts, *failures):
            store.remove(name)
    return len(results)


def _outcomes(
    tasks: Sequence[Task], settings: Settings, engine: Engine, work: TaskFunction, stop: StopCondition
) -> Iterator[Outcome]:
    """Outcomes of the engine and of the plan, as they come."""
    current: list[Outcome] = []

    def to_do() -> Iterator[Task]:
        for each in plan(tasks, settings):
            if isinstance(each, Task):
                yield each
            else:
                current.append(each)

    for outcome in engine.run(work, to_do(), stop):
        yield from current
        current.clear()
        yield outcome
    yield from current


def wait_until_free(
    busy: list[Task], store: Store, observer: BatchObserver, stop: Callable[[], bool]
) -> list[Task]:
    """Wait until another batch has ended one of the recordings; returns all, to be compared again."""
    if busy:
        observer.on_message(f"waiting for {count_of(len(busy), 'recording')} of another batch")
    while busy and not stop():
        if not all(store.is_in_use(task.name) for task in busy):
            break
        time.sleep(BUSY_POLL_S)
    return busy


def _write_tables(
    store: Store, tasks: Sequence[Task], report: BatchReport, shard: tuple[int, int] | None
) -> None:
    with _tables_lock(store):
        write_failures(store, shard_file("failures", ".csv", shard), report.failed.values())
        names = store.names() if shard is None else [task.name for task in tasks]
        report.complete = write_result_tables(
            store,
            names,
            report.failed,
            shard_file("results", ".parquet", shard),
            shard_file("contacts", ".parquet", shard),
        )
        if shard is None:  # these tables contain the results of all shards
            for stem in ("results", "contacts", "failures"):
                for part in shards_of(store.tables(f"{stem}-*"), stem):
                    store.remove(part)


@contextmanager
def _tables_lock(store: Store) -> Iterator[None]:
    """Only one process of a machine rebuilds the tables of a folder at a time."""
    if not isinstance(store, LocalStore):
        yield
        return
    with output_errors(store.path):
        store.path.mkdir(parents=True, exist_ok=True)
        while True:
            try:
                lock = FolderLock(store.path / ".tables.lock", store.path)
                break
            except FolderInUseError:
                time.sleep(BUSY_POLL_S / 4)
    try:
        yield
    finally:
        lock.release()
