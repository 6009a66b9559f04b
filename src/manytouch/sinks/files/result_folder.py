"""A folder of results that is replaced as a whole, or not at all."""

import errno
import hashlib
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from manytouch.errors import OutputError
from manytouch.sinks.files.atomic_output import flush, output_errors, remove
from manytouch.sinks.files.folder_lock import FolderInUseError, FolderLock
from manytouch.sinks.files.reserved_space import is_released, release, reserve, reserved_bytes
from manytouch.values import Reading

PARTIAL, OLD = "partial", "old"
REMOVALS = 40
LONGEST_LABEL = 200  # bytes of a name that still has room for the suffixes
END_BYTES, END_SHARE = 8 * 2**20, 0.01
"""What completing the files of a session takes at most, as a constant and a share of what is written: the
last row groups of the tables, of which that of the regions is the largest (8192 outlines of 48 points, 0.5 kB
each, 4 MB), and the lists of row groups (by estimate 1 kB per group of 1 MB)."""
_ENDED = (
    "the session has ended, and the folder has its results up to here; free space, or choose another disk"
)
CHECK_INTERVAL = 30  # readings; a choice: a second of most cameras


class ResultFolder:
    """A folder that gets its name when all its files are complete; what had the name before is then removed.

    Within its block, `partial_path` receives the files: a hidden folder with a random name, next to the
    final one. `commit` flushes them to the disk and swaps both folders: the old one is renamed, the new one
    gets the final name, the old one is removed. Entries of the old folder that are not results are moved to
    the new one. A swap that was interrupted is completed by the next process that opens the folder. Without
    `commit` the block leaves no trace.

    Attributes:
        path: the final name.
        partial_path: where to write until `commit`.
        free_bytes: free space on the disk at the beginning.
        lock: held from the beginning to the end.
    """

    def __init__(self, path: Path, results: Collection[str]) -> None:
        """Lock the folder, complete an interrupted swap, and create an empty folder to write to.

        Args:
            path: the folder; it may exist.
            results: patterns of the names of its results; other entries are kept.

        Raises:
            OutputError: it cannot be written, another process writes it, or it must not be replaced.
        """
        self.path = path
        self._results = tuple(results)
        self._final = path.resolve()
        self._parent = self._final.parent
        self._prefix = _prefix(self._final)
        _require_replaceable(path, self._final)
        token = secrets.token_hex(4)
        self.partial_path = self._parent / f"{self._prefix}{token}.{PARTIAL}"
        self._old_path = self._parent / f"{self._prefix}{token}.{OLD}"
        with output_errors(path):
            self._created = [each for each in (self._parent, *self._parent.parents) if not each.exists()]
            self._parent.mkdir(parents=True, exist_ok=True)
            self.lock = FolderLock(self._parent / f"{self._prefix}lock", path)
        try:
            with output_errors(path):
                if self.lock.is_held:
                    self._complete_swap()
                self.free_bytes = shutil.disk_usage(self._parent).free
                self.partial_path.mkdir()
        except BaseException:
            self.lock.release()
            raise

    def __enter__(self) -> "ResultFolder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def commit(self) -> None:
        """Flush the files to the disk and give the folder its final name.

        Raises:
            OutputError: it cannot be written; the folder of before is still there.
        """
        with output_errors(self.path):
            for part in sorted(self.partial_path.rglob("*")):
                flush(part)
            flush(self.partial_path)
            if self._final.exists():
                self._swap()
            else:
                self.partial_path.rename(self._final)
                flush(self._parent)

    def close(self) -> None:
        """Remove what was not committed, and release the lock."""
        for _ in range(REMOVALS):  # after an error, threads of zarr may still create files
            shutil.rmtree(self.partial_path, ignore_errors=True)
            if not self.partial_path.exists():
                break
            time.sleep(0.05)
        self.lock.release()
        if not self._final.exists():
            for created in self._created:
                try:
                    created.rmdir()
                except OSError:
                    break

    def _swap(self) -> None:
        self._final.rename(self._old_path)
        try:
            self.partial_path.rename(self._final)
        except OSError:
            self._old_path.rename(self._final)
            raise
        flush(self._parent)
        self._remove_old(self._old_path)

    def _complete_swap(self) -> None:
        """Complete or undo a swap that a process did not survive, and remove what others have left."""
        for old in self._left(OLD):
            if not self._final.exists():
                new = old.with_suffix(f".{PARTIAL}")  # complete, since the swap had begun
                (new if new.is_dir() else old).rename(self._final)
            if old.exists():
                self._remove_old(old)
        for partial in self._left(PARTIAL):
            shutil.rmtree(partial)

    def _left(self, suffix: str) -> Iterator[Path]:
        names = (path.name for path in self._parent.iterdir())
        kept = [name for name in names if name.startswith(self._prefix) and name.endswith(f".{suffix}")]
        for name in sorted(kept):
            token = name[len(self._prefix) : -len(suffix) - 1]
            if len(token) == 8 and set(token) <= set("0123456789abcdef"):
                yield self._parent / name

    def _remove_old(self, old: Path) -> None:
        for entry in sorted(old.iterdir()):
            kept = self._final / entry.name
            if any(entry.match(pattern) for pattern in self._results):
                remove(entry)
            elif not kept.exists():
                entry.rename(kept)
        old.rmdir()


class NearlyFullError(OutputError):
    """The disk has no more room than completing the files takes."""


class RoomCheck:
    """A sink that ends a session while its files can still be completed, as a session cannot be repeated.

    It does so where the disk is nearly full, and where a write has taken the space that is reserved in the
    folder, since the free space of the disk does not show a quota, or errors of the disk.
    """

    def __init__(self, folder: ResultFolder) -> None:
        """Check the room at the beginning.

        Args:
            folder: that the other sinks write to.

        Raises:
            OutputError: the disk has too little room to begin.
        """
        self._folder = folder
        self._readings = 0
        if folder.free_bytes < END_BYTES:
            raise OutputError(
                f"cannot write {folder.path}: its disk has {_megabytes(folder.free_bytes)} left, and "
                f"{_megabytes(END_BYTES)} are kept for the end of the files; free some space, or choose "
                "another disk"
            )
        with output_errors(folder.path):
            reserve(folder.partial_path, END_BYTES)

    def write(self, reading: Reading) -> None:
        """Count a reading; check the room after some.

        Raises:
            NearlyFullError: the disk is nearly full, or a write has failed and was repeated.
            OutputError: the folder was removed.
        """
        self._readings += 1
        is_written_with_reserve = is_released(self._folder.partial_path)
        if is_written_with_reserve or self._readings % CHECK_INTERVAL == 0:
            self._check()
        if is_written_with_reserve:
            raise NearlyFullError(
                f"a write to {self._folder.path} failed, as its disk or a quota is full, or the disk has "
                f"errors: {_ENDED}"
            )

    def close(self) -> None:
        """Give up the reserved space: the files are complete, except for what `ResultFiles` adds."""
        release(self._folder.partial_path)

    def _check(self) -> None:
        partial, path = self._folder.partial_path, self._folder.path
        try:
            free_bytes = shutil.disk_usage(partial).free
        except FileNotFoundError as error:
            raise OutputError(
                f"cannot write {path}: {partial.name}, the folder of its files until the end, was removed; "
                "start again, and leave hidden folders there"
            ) from error
        except OSError:
            return  # unknown here; a failing write ends the session
        kept_bytes = END_BYTES + int(END_SHARE * (folder_bytes(partial) - reserved_bytes(partial)))
        if free_bytes < kept_bytes:
            raise NearlyFullError(
                f"the disk of {path} is nearly full ({_megabytes(free_bytes)} are left, and "
                f"{_megabytes(kept_bytes)} are kept for the end of the files): {_ENDED}"
            )
        with suppress(OSError):  # a failing write ends the session
            reserve(partial, kept_bytes)


def _megabytes(count: int) -> str:
    return f"{count / 1e6:.3g} MB"


def is_in_use(path: Path) -> bool:
    """Whether another process writes a folder of results now."""
    final = path.resolve()
    try:
        FolderLock(final.parent / f"{_prefix(final)}lock", path).release()
    except FolderInUseError:
        return True
    return False


def _prefix(final: Path) -> str:
    """Start of the hidden names that belong to a folder."""
    label = final.name
    if len(os.fsencode(label)) > LONGEST_LABEL:
        label = hashlib.sha256(os.fsencode(label)).hexdigest()[:16]
    return f".{label}."


def _require_replaceable(path: Path, final: Path) -> None:
    """Check that no folder is replaced that others rely on.

    Raises:
        OutputError: it is the present folder, the home or the temporary folder, contains one of them, is the
            root of a disk, or is a file.
    """
    if final.exists() and not final.is_dir():
        raise OutputError(f"cannot write {path}: a file has this name; choose another folder")
    in_use = (Path.cwd(), Path("~").expanduser(), Path(tempfile.gettempdir()).resolve())
    if final.is_mount() or any(each.is_relative_to(final) for each in in_use):
        raise OutputError(
            f"cannot replace {path}, which is in use or the root of a disk, by a folder of results: "
            f"choose a folder in it, such as {path / 'results'}"
        )


def is_disk_full(error: BaseException | None) -> bool:
    """Whether an error, or one that caused it, is that of a full disk."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        error = error.__cause__ or error.__context__
    return False


def folder_bytes(folder: Path) -> int:
    """Size of all files of a folder, while others may remove some of them."""
    total = 0
    for path in folder.rglob("*"):
        with suppress(FileNotFoundError):
            total += path.stat().st_size if path.is_file() else 0
    return total
