"""failures.csv: what could not be processed, why, and where the traceback is."""

import csv
import re
from collections.abc import Collection, Iterable
from pathlib import Path

from manytouch.batch.storage import Store
from manytouch.batch.tasks import Outcome
from manytouch.errors import without_password
from manytouch.values.display.text import count_of

COLUMNS = ("input", "sentence", "traceback")
TRACEBACKS = ".tracebacks"


def write_failures(store: Store, file: str, failed: Iterable[Outcome]) -> None:
    """Write the table, with the header alone if nothing has failed, and a file for each traceback.

    Raises:
        OutputError: they cannot be written.
    """
    rows = []
    for outcome in sorted(failed, key=lambda each: each.task.name):
        place = ""
        if outcome.traceback:
            place = f"{TRACEBACKS}/{outcome.task.name}.txt"
            with store.new_file(place) as path:
                path.write_text(outcome.traceback, encoding="utf-8")
        rows.append((without_password(outcome.task.input), " ".join(outcome.reason.split()), place))
    with store.new_file(file) as path:
        _write(path, rows)


def read_failures(store: Store, file: str) -> list[tuple[str, str, str]]:
    """Rows of a table; empty where there is none."""
    content = store.read(file)
    if content is None:
        return []
    rows = csv.DictReader(content.decode("utf-8").splitlines())
    return [(row["input"], row["sentence"], row["traceback"]) for row in rows]


def describe_failures(failed: Collection[Outcome], count: int, table: str) -> str:
    """One sentence: how many of `count` recordings failed, why the first one did, and the table with all."""
    first = min(failed, key=lambda each: each.task.name)
    reason = " ".join(first.reason.split()).rstrip(".")
    which = f"the first is {first.task.name}: " if len(failed) > 1 else f"{first.task.name}: "
    return (
        f"{len(failed)} of {count_of(count, 'recording')} failed, {which}{reason}; {table} lists all of them "
        "with their reasons, and the same command tries them again"
    )


def merge_failures(store: Store, files: Iterable[str], merged: str) -> None:
    """Join the tables of shards."""
    rows = [row for file in files for row in read_failures(store, file)]
    with store.new_file(merged) as path:
        _write(path, rows)


def shard_file(stem: str, suffix: str, shard: tuple[int, int] | None) -> str:
    """Name of a table of a shard, such as results-0003-of-1000.parquet; of all without a shard."""
    if shard is None:
        return f"{stem}{suffix}"
    width = len(str(shard[1]))
    return f"{stem}-{shard[0] % shard[1]:0{width}d}-of-{shard[1]}{suffix}"


def shards_of(names: Iterable[str], stem: str) -> list[str]:
    """The names that are tables of shards."""
    pattern = re.compile(rf"{re.escape(stem)}-\d+-of-\d+\.[a-z]+")
    return sorted(name for name in names if pattern.fullmatch(name))


def _write(path: Path, rows: Iterable[tuple[str, str, str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)
