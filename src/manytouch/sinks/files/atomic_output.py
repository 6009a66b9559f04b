"""Single files that are complete or absent; folders of results are in `result_folder`."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from manytouch.errors import OutputError


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """A hidden file next to `path` with the same suffix, to be written within the block.

    At the end of the block it is flushed to the disk and gets the final name; after an error it is removed.

    Raises:
        OutputError: the file cannot be written.
    """
    partial = path.with_name(f".{path.stem}.{secrets.token_hex(4)}.partial{path.suffix}")
    try:
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            yield partial
            flush(partial)
            partial.replace(path)
            flush(path.parent)
    finally:
        with suppress(OSError):
            partial.unlink()


def check_writable(folder: Path) -> None:
    """Check, before a long computation, that its results can be written; leaves no trace.

    Raises:
        OutputError: the folder cannot be written.
    """
    probe = folder / f".{os.getpid()}.probe"
    with output_errors(folder):
        created = [each for each in (folder, *folder.parents) if not each.exists()]
        existing = next((each for each in (folder, *folder.parents) if each.exists()), Path())
        if not existing.is_dir():
            raise OutputError(
                f"cannot write {folder}: {existing} is a file, not a folder; choose another folder"
            )
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
        for each in created:
            each.rmdir()


def check_file_writable(path: Path) -> None:
    """Check, before a long computation, that a file can be written; leaves no trace.

    Raises:
        OutputError: its folder cannot be written, or the path is a folder.
    """
    if path.is_dir():
        raise OutputError(f"cannot write {path}: it is a folder; give the path of a file in it")
    check_writable(path.absolute().parent)


def next_free(path: Path) -> Path | None:
    """The name that `rename_existing` gives: of press.mcap press-1.mcap, or the next one that is free.

    Returns:
        None where there is no file, or an empty one.
    """
    if not path.is_file() or path.stat().st_size == 0:
        return None
    number = 1
    while (free := path.with_name(f"{path.stem}-{number}{path.suffix}")).exists():
        number += 1
    return free


def rename_existing(path: Path) -> Path | None:
    """Rename an existing file to the next free name, which is returned."""
    free = next_free(path)
    if free is not None:
        with output_errors(path):
            path.rename(free)
    return free


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


def flush(path: Path) -> None:
    """Flush a file, or the entries of a folder, to the disk."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except PermissionError:  # folders cannot be opened on Windows; renaming is safe without it
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
