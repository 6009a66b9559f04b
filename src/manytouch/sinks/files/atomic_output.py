"""Results that are complete or absent: written under a temporary name, renamed at the end."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from manytouch.errors import OutputError


class AtomicOutput:
    """A result, a file or a folder, that gets its final name when it is complete.

    It is written to `temporary_path`, a hidden name in the same folder with the same suffix; `commit` flushes
    it to the disk and renames it. What an interrupted run left there is removed first.

    Attributes:
        path: the final name.
        temporary_path: where to write until `commit`.
    """

    def __init__(self, path: Path) -> None:
        """Prepare the folder.

        Raises:
            OutputError: the folder cannot be written.
        """
        self.path = path
        self.temporary_path = temporary_path(path)
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            remove(self.temporary_path)

    def commit(self) -> None:
        """Flush the result to the disk and give it its final name.

        Raises:
            OutputError: the result cannot be written.
        """
        with output_errors(self.path):
            for part in _parts(self.temporary_path):
                _flush(part)
            if self.path.is_dir():
                shutil.rmtree(self.path)
            self.temporary_path.replace(self.path)
            _flush(self.path.parent)

    def discard(self) -> None:
        """Remove what was written."""
        remove(self.temporary_path)


def check_writable(folder: Path) -> None:
    """Check, before a long computation, that its results can be written; leaves no trace.

    Raises:
        OutputError: the folder cannot be written.
    """
    probe = folder / f".{os.getpid()}.probe"
    created = [each for each in (folder, *folder.parents) if not each.exists()]
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
        for each in created:
            each.rmdir()


def temporary_path(path: Path) -> Path:
    """The name under which a result is written until it is complete."""
    return path.with_name(f".{path.stem}.partial{path.suffix}")


def remove(path: Path) -> None:
    """Remove a file or a folder, if it exists."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Report a refusal of the file system as an error that names the result and a remedy.

    Raises:
        OutputError: instead of any OSError inside.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(
            f"cannot write {path}: {reason}; choose a folder that is writable and has enough space"
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
