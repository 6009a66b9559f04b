"""A file system that is soon full, where the rights allow one."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def small_disk_at(folder: Path, megabytes: int) -> Iterator[Path]:
    """A file system of so many MB in a new folder; the test is skipped without the rights of root."""
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(words, capture_output=True, check=False).returncode:
        pytest.skip("mounting a file system needs the rights of root")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def fill(folder: Path, left_bytes: int) -> Path:
    """Fill the file system of a folder but for so many bytes; the file that fills it."""
    filling = folder / "filling"
    filling.write_bytes(bytes(shutil.disk_usage(folder).free - left_bytes))
    return filling
