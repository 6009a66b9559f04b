"""Files of results whose writing can be completed when their disk takes no more.

The free space of a disk does not show the quota of a user. A file in the folder of the results, the reserve,
is removed when writing fails, and the write is repeated in the room of it. It has random bytes, since some
file systems store zeros in no space. What a network disk refuses only when a file is flushed is not repeated.
"""

import errno
import os
from io import BufferedWriter, FileIO, TextIOWrapper
from pathlib import Path
from typing import Any

RESERVE_NAME = ".reserve"
NO_MORE = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""Errors of a write that may succeed once there is room, or when it is repeated."""
_BLOCK_BYTES = 1 << 20
_BUFFER_BYTES = 4096  # a block of most file systems, as `open` takes: rows of a table reach the disk as soon


def reserve(folder: Path, size: int) -> None:
    """Let the reserve of a folder have at least so many bytes.

    Raises:
        OSError: there is no room for it.
    """
    path = folder / RESERVE_NAME
    with path.open("ab", buffering=0) as file:
        while (missing := size - file.tell()) > 0:
            file.write(os.urandom(min(missing, _BLOCK_BYTES)))


def release(folder: Path) -> bool:
    """Remove the reserve of a folder; whether there was one."""
    try:
        (folder / RESERVE_NAME).unlink()
    except OSError:
        return False
    return True


def reserved_bytes(folder: Path) -> int:
    """Size of the reserve of a folder; 0 without one."""
    path = folder / RESERVE_NAME
    return path.stat().st_size if path.exists() else 0


def is_released(folder: Path) -> bool:
    """Whether a folder has no reserve."""
    return not (folder / RESERVE_NAME).exists()


def create_binary(path: Path) -> BufferedWriter:
    """Create a file of results, or empty one."""
    return BufferedWriter(_RepeatingFile(path, "w"), _BUFFER_BYTES)


def create_text(path: Path) -> TextIOWrapper:
    """Create a text file of results, or empty one; line breaks are written as they are given."""
    return TextIOWrapper(create_binary(path), encoding="utf-8", newline="")


class _RepeatingFile(FileIO):
    """A file that repeats a write that failed, if that has released the reserve of its folder."""

    def write(self, data: Any, /) -> int:
        try:
            return os.write(self.fileno(), data)
        except OSError as error:
            if error.errno not in NO_MORE or not release(Path(os.fsdecode(self.name)).parent):
                raise
            return os.write(self.fileno(), data)
