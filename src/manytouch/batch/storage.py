"""The results of a batch: a folder, or a prefix of an object store, which has neither locks nor renaming."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from manytouch.batch.remote_files import file_system, is_remote, remote_errors
from manytouch.errors import OutputError, without_password
from manytouch.sinks.files.atomic_output import atomic_file, output_errors, remove
from manytouch.sinks.files.result_folder import is_in_use

SUMMARY = "summary.json"


@runtime_checkable
class Store(Protocol):
    """A folder of result folders and tables."""

    def names(self) -> list[str]:
        """Names of the result folders that have a summary.json, sorted."""

    def entries(self, name: str) -> set[str]:
        """Names of files and folders in a result folder; empty where there is none."""

    def read(self, path: str) -> bytes | None:
        """Content of a file, by its path relative to the store, with /; None where there is none."""

    def tables(self, pattern: str) -> list[str]:
        """Names of the files directly in the store that match a glob pattern, sorted."""

    def new_file(self, path: str) -> Any:
        """A context with a local path to write; at its end the file is in the store as a whole."""

    def remove(self, path: str) -> None:
        """Remove a file, if it exists."""

    def is_in_use(self, name: str) -> bool:
        """Whether another process of this machine writes a result folder; False for an object store."""


def store_at(out: str) -> Store:
    """The store at a path or an address.

    Raises:
        MissingExtraError: a package for the object store is not installed.
    """
    return RemoteStore(out) if is_remote(out) else LocalStore(Path(out))


class LocalStore:
    """A folder of the file system."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def names(self) -> list[str]:
        if not self.path.is_dir():
            return []
        folders = (each.name for each in self.path.iterdir() if not each.name.startswith("."))
        return sorted(name for name in folders if (self.path / name / SUMMARY).is_file())

    def entries(self, name: str) -> set[str]:
        folder = self.path / name
        return {each.name for each in folder.iterdir()} if folder.is_dir() else set()

    def read(self, path: str) -> bytes | None:
        try:
            return (self.path / path).read_bytes()
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
            return None

    def tables(self, pattern: str) -> list[str]:
        return sorted(each.name for each in self.path.glob(pattern) if each.is_file())

    @contextmanager
    def new_file(self, path: str) -> Iterator[Path]:
        with atomic_file(self.path / path) as partial:
            yield partial

    def remove(self, path: str) -> None:
        with output_errors(self.path / path):
            remove(self.path / path)

    def is_in_use(self, name: str) -> bool:
        return self.path.is_dir() and is_in_use(self.path / name)


class RemoteStore:
    """A prefix of an object store. An object appears as a whole; the last one of a result is summary.json."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        self._files, root = file_system(self.url)
        self._root = root.rstrip("/")

    def names(self) -> list[str]:
        with self._errors("read"):
            found = self._files.glob(f"{self._root}/*/{SUMMARY}")
        return sorted(str(each).rsplit("/", 2)[-2] for each in found)

    def entries(self, name: str) -> set[str]:
        try:
            with self._errors("read"):
                found = self._files.ls(f"{self._root}/{name}", detail=False, refresh=True)
        except FileNotFoundError:
            return set()
        return {str(each).rstrip("/").rsplit("/", 1)[-1] for each in found}

    def read(self, path: str) -> bytes | None:
        try:
            with self._errors("read"):
                return bytes(self._files.cat_file(f"{self._root}/{path}"))
        except FileNotFoundError:
            return None

    def tables(self, pattern: str) -> list[str]:
        with self._errors("read"):
            self._files.invalidate_cache()
            return sorted(
                str(each).rsplit("/", 1)[-1] for each in self._files.glob(f"{self._root}/{pattern}")
            )

    @contextmanager
    def new_file(self, path: str) -> Iterator[Path]:
        with tempfile.TemporaryDirectory(prefix="manytouch-") as folder:
            local = Path(folder) / Path(path).name
            yield local
            with self._errors("write"):
                self._files.put_file(str(local), f"{self._root}/{path}")

    def remove(self, path: str) -> None:
        with self._errors("write"):
            if self._files.exists(f"{self._root}/{path}"):
                self._files.rm(f"{self._root}/{path}", recursive=True)

    def is_in_use(self, name: str) -> bool:
        return False

    def upload(self, folder: Path, name: str) -> None:
        """Replace a result: the old summary.json is removed first, and the new one is written last.

        Objects that the new result does not have are removed too.

        Args:
            folder: a complete result folder; it is deleted after the upload.
            name: of the result in the store.

        Raises:
            OutputError: an object cannot be written; the result then counts as missing.
        """
        target = f"{self._root}/{name}"
        with self._errors("write"):
            self._files.invalidate_cache()
            before = set(self._files.find(target)) if self._files.exists(target) else set()
            summary = f"{target}/{SUMMARY}"
            if summary in before:
                self._files.rm_file(summary)
            written = {summary}
            for path in sorted(folder.rglob("*")):
                if path.is_file() and path != folder / SUMMARY:
                    written.add(f"{target}/{path.relative_to(folder).as_posix()}")
                    self._files.put_file(str(path), f"{target}/{path.relative_to(folder).as_posix()}")
            for left in sorted(before - written):
                self._files.rm_file(left)
            self._files.put_file(str(folder / SUMMARY), summary)
        shutil.rmtree(folder, ignore_errors=True)

    def _errors(self, verb: str) -> Any:
        return remote_errors(OutputError, f"cannot {verb} {without_password(self.url)}")
