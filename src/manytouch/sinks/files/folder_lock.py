"""A lock file, held by the operating system for a process until it ends, however it ends."""

import json
import os
import socket
import sys
import time
from pathlib import Path
from typing import Any

from manytouch.errors import OutputError

LOCKED_BYTE = 2**30  # Windows locks bytes; beyond the text, which others read


class FolderInUseError(OutputError):
    """Another process writes the folder."""


class FolderLock:
    """Exclusive use of a folder's name by one process.

    The file contains process number, host and time as JSON, for the message of others. The operating system
    releases the lock of a process that has died, so that its file is taken over. File systems without locks
    give none: `is_held` is then false.
    """

    def __init__(self, path: Path, purpose: Path) -> None:
        """Take the lock.

        Args:
            path: of the lock file; its folder exists.
            purpose: what is locked, for the message.

        Raises:
            FolderInUseError: another process has it.
            OSError: the file cannot be written.
        """
        self._path = path
        self.is_held = True
        while True:
            self._handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
            try:
                _lock(self._handle)
            except (BlockingIOError, PermissionError) as error:
                os.close(self._handle)
                raise FolderInUseError(
                    f"{purpose} is being written by {_holder(path)}: wait until it has ended, or choose "
                    "another folder"
                ) from error
            except OSError:
                self.is_held = False
            if not self.is_held or _is_same_file(self._handle, path):
                break
            os.close(self._handle)  # its holder has removed it between opening and locking
        try:
            os.ftruncate(self._handle, 0)
            os.write(self._handle, json.dumps(_this_process()).encode())
        except OSError:  # a full disk; the lock holds without its text
            os.ftruncate(self._handle, 0)

    def release(self) -> None:
        """Remove the file and give the lock back."""
        if self._handle < 0:
            return
        if self.is_held and os.name != "nt":
            self._path.unlink(missing_ok=True)
        os.close(self._handle)
        self._handle = -1


def _this_process() -> dict[str, Any]:
    return {
        "pid": os.getpid(),
        "host": socket.gethostname(),
        "since": time.strftime("%Y-%m-%d %H:%M:%S"),
    }


def _holder(path: Path) -> str:
    """The process that holds a lock, in words."""
    try:
        found = json.loads(path.read_bytes()[:1000])
        pid, host, since = int(found["pid"]), str(found["host"])[:80], str(found["since"])[:40]
    except (OSError, ValueError, KeyError, TypeError):
        return "another process"
    return f"process {pid} on {host} since {since}"


def _is_same_file(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False


if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> None:
        os.lseek(handle, LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        os.lseek(handle, 0, os.SEEK_SET)

else:
    import fcntl

    def _lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
