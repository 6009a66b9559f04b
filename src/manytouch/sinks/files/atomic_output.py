"""Results that are complete or absent: written aside in the same folder, renamed at the end."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from manytouch.errors import OutputError


class AtomicOutput:
    """One result, a file or a folder, on its way to its final name.

    It is written under `aside`, a hidden name in the same folder that keeps the suffix; `finish`
    flushes it to the disk and renames it. What a killed run left aside is removed first.

    Attributes:
        path: the final name.
        aside: where it is written until then.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.aside = aside(path)
        with told(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            remove(self.aside)

    def finish(self) -> None:
        """Give the result its final name; from here on it is complete."""
        with told(self.path):
            for part in _parts(self.aside):
                _flush(part)
            if self.path.is_dir():
                shutil.rmtree(self.path)
            self.aside.replace(self.path)
            _flush(self.path.parent)

    def discard(self) -> None:
        """Remove what was written aside."""
        remove(self.aside)


def try_writing(folder: Path) -> None:
    """Write into a folder and leave no trace, before something is computed for long that shall go there.

    Raises:
        OutputError: it cannot be written.
    """
    trial = folder / f".{os.getpid()}.trial"
    new = [each for each in (folder, *folder.parents) if not each.exists()]
    with told(folder):
        folder.mkdir(parents=True, exist_ok=True)
        trial.touch()
        trial.unlink()
        for each in new:
            each.rmdir()


def aside(path: Path) -> Path:
    """The temporary name of a result."""
    return path.with_name(f".{path.stem}.partial{path.suffix}")


def remove(path: Path) -> None:
    """Remove a file or a folder, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Say which result could not be written when the file system refuses.

    Raises:
        OutputError: instead of any OSError inside.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(
            f"cannot write {path}: {reason}; choose a folder that can be written and has room"
        ) from error


def _parts(path: Path) -> Iterator[Path]:
    if path.is_dir():
        yield from (part for part in path.rglob("*") if part.is_file())
    yield path


def _flush(path: Path) -> None:
    try:
        handle = os.open(path, os.O_RDONLY)
    except PermissionError:  # folders cannot be opened on Windows; renaming is safe without it
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
